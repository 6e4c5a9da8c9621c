"""The common contract of all drives, on three dialects and their wires."""

from __future__ import annotations

import pytest

from chairward.testing.drive_contract import DriveContract
from chairward.testing.drive_extras import (
    ExclusivePortContract,
    PowerContract,
    RampContract,
    SoftStartContract,
    StopInputContract,
    VersionContract,
)
from chairward.testing.drive_measured import MeasurableContract
from chairward.testing.drive_rig import DriveRig


class TestRnetOverSlcan(
    DriveContract, RampContract, SoftStartContract, PowerContract, ExclusivePortContract, MeasurableContract
):
    """Takeover `follow`: a power module and the user's joystick behind an slcan adapter on a pty."""

    @pytest.fixture
    def rig(self, rnet_rig: DriveRig) -> DriveRig:
        return rnet_rig


class OfDbc(
    DriveContract,
    RampContract,
    SoftStartContract,
    StopInputContract,
    PowerContract,
    ExclusivePortContract,
    MeasurableContract,
):
    """What any controller with a DBC file promises, whatever the wire."""


class TestDbcOverVirtual(OfDbc):
    """python-can's virtual bus has no descriptor, so the two promises about one are kept the other way round."""

    @pytest.fixture
    def rig(self, dbc_rig: DriveRig) -> DriveRig:
        return dbc_rig

    def test_connect_leads_to_a_link_with_a_real_descriptor(self, rig: DriveRig) -> None:
        assert rig.connect().linked
        assert rig.drive.fileno() == -1

    def test_the_descriptor_wakes_the_guard_when_the_controller_answers(self, rig: DriveRig) -> None:
        rig.connect()
        assert rig.drive.fileno() == -1


class TestDbcOverSlcan(OfDbc):
    """The same controller behind an slcan adapter."""

    @pytest.fixture
    def rig(self, dbc_slcan_rig: DriveRig) -> DriveRig:
        return dbc_slcan_rig


class TestCia402OverSlcan(
    DriveContract, RampContract, SoftStartContract, ExclusivePortContract, VersionContract, MeasurableContract
):
    """Two CANopen motor controllers behind an slcan adapter on a pty."""

    @pytest.fixture
    def rig(self, cia402_rig: DriveRig) -> DriveRig:
        return cia402_rig

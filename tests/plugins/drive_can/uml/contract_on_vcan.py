"""Run inside User-Mode Linux by boot.py: the drive contract over the kernel's own SocketCAN (collected only there)."""

from __future__ import annotations

import select
import subprocess
from collections.abc import Iterator
from typing import Any

import pytest

from chairward.components import DriveError
from chairward.testing.drive_contract import DriveContract
from chairward.testing.drive_extras import ExclusivePortContract, PowerContract, RampContract, SoftStartContract
from chairward.testing.drive_rig import DriveRig
from chairward_drive_can.bus import Bus, LibraryBus
from chairward_drive_can.frames import Frame
from chairward_drive_can.settings import CanSettings

VCAN = "vcan0"


class FarEnd(LibraryBus):
    """The simulated chair's own socket; it does not care for its own frames."""

    def __init__(self, settings: CanSettings) -> None:
        super().__init__(settings.model_copy(update={"options": {"receive_own_messages": False}}))
        self._echoes = False
        self.spoke = False

    def send(self, frame: Frame) -> None:
        super().send(frame)
        self.spoke = True


def wait_for(descriptor: int) -> None:
    """Until there is something to read, for a moment at most."""
    if descriptor >= 0:
        select.select([descriptor], [], [], 0.2)


def link(state: str) -> None:
    """Bring the interface up or down, as pulling the adapter out does."""
    subprocess.run(["ip", "link", "set", VCAN, state], check=True)


@pytest.fixture
def vcan_settings(rnet_settings: CanSettings) -> CanSettings:
    return rnet_settings.model_copy(update={"interface": "socketcan", "channel": VCAN})


@pytest.fixture
def vcan_rig(vcan_settings: CanSettings, rnet_rig_type: Any) -> Iterator[DriveRig]:
    class VcanRig(rnet_rig_type):  # type: ignore[misc]
        step_ns = 5_000_000
        silence_s = 0.24
        seen = 0

        def open_end(self) -> Bus:
            link("up")
            return FarEnd(self.settings)

        def run(self, seconds: float) -> None:
            """The kernel delivers in its own time; the tests' clock waits for it."""
            if self.end is not None and self.drive._sent != self.seen:
                self.seen = self.drive._sent
                wait_for(self.end.fileno())
            super().run(seconds)
            if self.end is not None and self.end.spoke:
                self.end.spoke = False
                wait_for(self.drive.fileno())

        def unplug(self) -> None:
            link("down")
            super().unplug()

    rig = VcanRig(vcan_settings)
    yield rig
    rig.close()
    link("up")


class TestRnetOverVcan(DriveContract, RampContract, SoftStartContract, PowerContract, ExclusivePortContract):
    """Takeover `follow` on a real CAN socket."""

    @pytest.fixture
    def rig(self, vcan_rig: DriveRig) -> DriveRig:
        return vcan_rig


def test_our_own_frames_come_back_as_answers_and_are_not_heard_as_others(vcan_settings: CanSettings) -> None:
    from chairward_drive_can import rnet

    bus = LibraryBus(vcan_settings)
    bus.send(rnet.joystick(1, 0, 0))
    assert bus.unanswered == 1
    wait_for(bus.fileno())
    assert bus.receive() == []
    assert bus.unanswered == 0
    bus.close()


def test_a_down_interface_is_one_sentence_with_what_to_do(vcan_settings: CanSettings) -> None:
    from chairward_drive_can.bus import open_bus

    with pytest.raises(DriveError, match=r"socketcan vcan9 cannot be opened: .*ip link set vcan9 up"):
        open_bus(vcan_settings.model_copy(update={"channel": "vcan9"}))

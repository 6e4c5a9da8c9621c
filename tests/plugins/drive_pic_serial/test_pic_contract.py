"""The drive contract on the Python model and on the real firmware in gpsim."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import pytest

from chairward.testing import (
    DriveContract,
    ExclusivePortContract,
    MeasurableContract,
    PowerContract,
    RampContract,
    SoftStartContract,
    StopInputContract,
    VersionContract,
)
from chairward_drive_pic_serial.engine import Engine, ModelEngine
from chairward_drive_pic_serial.rig import PicRig


@pytest.fixture
def rig(engine: Engine, tmp_path: Path) -> Iterator[PicRig]:
    rig = PicRig(engine, tmp_path, step_us=1000 if isinstance(engine, ModelEngine) else 5000)
    yield rig
    rig.close()


class TestPicSerial(
    DriveContract,
    RampContract,
    SoftStartContract,
    StopInputContract,
    PowerContract,
    ExclusivePortContract,
    VersionContract,
):
    """All contracts, each on both engines."""


@pytest.mark.timeout(900)
class TestMeasuredPic(MeasurableContract):
    """On both engines too; half a minute of firmware time, many times that on a busy machine."""

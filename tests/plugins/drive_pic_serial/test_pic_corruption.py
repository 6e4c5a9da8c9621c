"""Corrupted frames: none is obeyed, and the next good one always is."""

from __future__ import annotations

from collections.abc import Callable

import pytest

from chairward_drive_pic_serial.corruption import Tally, corrupt
from chairward_drive_pic_serial.engine import ModelEngine
from chairward_drive_pic_serial.gpsim import Gpsim


def _spotless(tally: Tally, frames: int) -> None:
    assert tally.frames == frames
    assert tally.naks > frames / 2  # they did arrive
    assert (tally.accepted, tally.good_lost) == (0, 0), tally


def test_thousands_of_corrupted_frames_never_move_the_model() -> None:
    _spotless(corrupt(ModelEngine(), 6_000, seed=1), 6_000)


@pytest.mark.needs_gpsim
def test_hundreds_of_corrupted_frames_never_move_the_firmware(new_gpsim: Callable[..., Gpsim]) -> None:
    _spotless(corrupt(new_gpsim(), 300, seed=2), 300)

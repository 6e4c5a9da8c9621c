"""Engines and rigs for the tests of the PIC drive."""

from __future__ import annotations

import shutil
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest

from chairward_drive_pic_serial.engine import Engine, ModelEngine
from chairward_drive_pic_serial.gpsim import Gpsim


def _need_gpsim() -> None:
    if not (shutil.which("gpsim") and shutil.which("gpasm")):
        pytest.skip("needs gpsim and gpasm: sudo apt-get install gpsim gputils")


@pytest.fixture
def new_gpsim() -> Iterator[Callable[..., Gpsim]]:
    """Starts gpsim processes that end with the test."""
    _need_gpsim()
    started: list[Gpsim] = []

    def start(*defines: str) -> Gpsim:
        started.append(Gpsim(defines))
        return started[-1]

    yield start
    for each in started:
        each.close()


@pytest.fixture(params=["model", pytest.param("gpsim", marks=pytest.mark.needs_gpsim)])
def engine(request: pytest.FixtureRequest) -> Iterator[Engine]:
    """A PIC of each kind."""
    if request.param == "gpsim":
        _need_gpsim()
    made: Engine = ModelEngine() if request.param == "model" else Gpsim()
    yield made
    made.close()


@pytest.fixture
def short_dir(tmp_path: Path) -> Path:
    """A folder for links and states."""
    return tmp_path

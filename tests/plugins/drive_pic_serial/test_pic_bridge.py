"""gpsim on a pty of its own: the firmware as a program, with a cable that can be pulled."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest

from chairward.shared_state import PIN_NAMES, SharedState
from chairward_drive_pic_serial import bridge
from chairward_drive_pic_serial.bridge import GpsimOnPty
from chairward_drive_pic_serial.commands import probe
from chairward_drive_pic_serial.firmware import FirmwareError
from chairward_drive_pic_serial.wire import State

WAIT_S = 30.0


def until(done: Callable[[], bool]) -> None:
    end = time.monotonic() + WAIT_S
    while not done():
        assert time.monotonic() < end, f"waited {WAIT_S} s in vain"
        time.sleep(0.01)


@pytest.fixture
def pic(tmp_path: Path) -> Iterator[GpsimOnPty]:
    if not bridge.available():
        pytest.skip(f"needs the pty bridge for gpsim: {bridge.INSTALL}")
    SharedState.create(tmp_path / "pins", PIN_NAMES).close()
    try:
        pic = GpsimOnPty(tmp_path / "pic", tmp_path / "pins", log=tmp_path / "log")
    except FirmwareError as error:
        pytest.skip(str(error))
    until(pic.ready)
    yield pic
    pic.close()


@pytest.mark.needs_gpsim
@pytest.mark.processes
def test_the_firmware_answers_publishes_its_pins_and_survives_its_cable(pic: GpsimOnPty, tmp_path: Path) -> None:
    port, pins = tmp_path / "pic", SharedState.attach(tmp_path / "pins")
    until(lambda: "Chairward PIC, protocol 1" in probe(str(port)))
    assert pins.names == PIN_NAMES
    until(lambda: pins.read()["state"] == State.NEUTRAL)
    assert (pins.read()["brake"], pins.read()["drive_in1"], pins.read()["drive_in2"]) == (1.0, 0.0, 0.0)
    pic.unplug()
    until(lambda: not port.is_symlink())
    assert "there is no such port" in probe(str(port))
    pic.plug()
    until(port.is_symlink)
    until(lambda: "reset no. 1 (power on)" in probe(str(port)))  # the same boot: only the cable was out
    pins.close()
    lines = [line.split() for line in (tmp_path / "log").read_text(encoding="ascii").splitlines()]
    assert {line[0] for line in lines} == {"byte", "pins"}
    cycles = [int(line[1]) for line in lines]
    assert cycles == sorted(cycles)
    pic.close()
    assert pic.process.poll() is not None
    assert not port.is_symlink()


def test_without_its_headers_the_error_says_what_to_install(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(bridge, "HEADERS", tmp_path / "none")
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    assert not bridge.available()
    with pytest.raises(FirmwareError, match=r"apt-get install gpsim-dev libglib2\.0-dev g"):
        bridge.library()


def test_a_source_that_the_compiler_refuses_leaves_nothing_behind(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    if not bridge.available():
        pytest.skip(f"needs the pty bridge for gpsim: {bridge.INSTALL}")
    wrong = tmp_path / "wrong.cc"
    wrong.write_text("nonsense\n", encoding="ascii")
    monkeypatch.setattr(bridge, "SOURCE", wrong)
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    with pytest.raises(FirmwareError, match=r"g\+\+ refuses .*wrong\.cc"):
        bridge.library()
    assert list((tmp_path / "chairward").iterdir()) == []

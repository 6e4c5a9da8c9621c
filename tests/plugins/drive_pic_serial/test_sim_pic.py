"""The simulated PIC as a program of its own, in real time, and a host that dies."""

from __future__ import annotations

import os
import re
import select
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest
from typer.testing import CliRunner

from chairward.shared_state import PIN_NAMES, SharedState
from chairward_drive_pic_serial import wire
from chairward_drive_pic_serial.commands import pic, probe

pytestmark = pytest.mark.processes  # in real time

WAIT_S = 60.0
"""How long a busy machine may take; how long the firmware takes is measured in its own time, in other files."""
SIM = """
import sys, time
from pathlib import Path
from chairward_drive_pic_serial.sim_pic import SimPic, SimPicSettings
end = time.monotonic() + 110
engine, _, slices = sys.argv[2].partition(" ")
SimPic(SimPicSettings(engine=engine, bridge=not slices), Path(sys.argv[1])).run(
    lambda: print("ready", flush=True), lambda: time.monotonic() > end)
"""
HOST = """
import sys, time, select
from chairward.components import Motion, STILL, DriveError
from chairward_drive_pic_serial.drive import PicSerialDrive
from chairward_drive_pic_serial.settings import PicSerialSettings
drive = PicSerialDrive(PicSerialSettings(port=sys.argv[1]))
armed = told = False
while True:
    now = time.monotonic_ns()
    try:
        status = drive.poll(now)
        if not status.linked:
            drive.connect(now)
        elif not status.armed:
            drive.arm(now)
        drive.command(now, Motion(500.0, 0.0) if status.armed else STILL)
        if (status.speed_mm_s or 0) > 300 and not told:
            told = True
            print("driving", flush=True)
    except DriveError as error:
        print(error, file=sys.stderr, flush=True)
    time.sleep(0.02)
"""


@pytest.fixture
def start() -> Iterator[Callable[..., subprocess.Popen[str]]]:
    """Starts Python programs, waits for their first line, ends them with the test."""
    started: list[subprocess.Popen[str]] = []

    def run(program: str, *args: str) -> subprocess.Popen[str]:
        process = subprocess.Popen(
            [sys.executable, "-c", program, *args], stdout=subprocess.PIPE, text=True, start_new_session=True
        )
        started.append(process)
        assert process.stdout is not None
        assert select.select([process.stdout], [], [], WAIT_S)[0], f"said nothing for {WAIT_S:g} s"
        assert process.stdout.readline().strip() in ("ready", "driving")
        return process

    yield run
    for process in started:
        if process.poll() is None:
            os.killpg(process.pid, signal.SIGKILL)
        process.wait()
        if process.stdout is not None:
            process.stdout.close()


def _driving(pins: SharedState) -> bool:
    values = pins.read()
    return values["drive_in1"] != values["drive_in2"] and values["drive_duty"] > 0


def _until(done: Callable[[], bool]) -> None:
    end = time.monotonic() + WAIT_S
    while not done():
        assert time.monotonic() < end, f"waited {WAIT_S:g} s in vain"
        time.sleep(0.005)


ENGINES = ["model", pytest.param("gpsim", marks=pytest.mark.needs_gpsim)]


@pytest.mark.parametrize("engine", ENGINES)
@pytest.mark.parametrize("how", [signal.SIGKILL, signal.SIGSTOP])
def test_a_host_that_dies_or_hangs_leaves_no_motor_on(
    start: Callable[..., subprocess.Popen[str]],
    request: pytest.FixtureRequest,
    tmp_path: Path,
    engine: str,
    how: signal.Signals,
) -> None:
    if engine == "gpsim":
        request.getfixturevalue("new_gpsim")  # skips where it is missing
    start(SIM, str(tmp_path), engine)
    pins = SharedState.attach(tmp_path / "pins", 5.0)
    host = start(HOST, str(tmp_path / "pic"))
    _until(lambda: _driving(pins))  # a host that was held up has been stopped meanwhile, and arms again
    host.send_signal(how)
    _until(lambda: not _driving(pins) and pins.read()["state"] != wire.State.ARMED)
    assert pins.read()["brake"] == 1
    pins.close()


def test_the_monitor_shows_a_live_line_records_it_and_gives_everything_back(
    start: Callable[..., subprocess.Popen[str]], tmp_path: Path
) -> None:
    start(SIM, str(tmp_path), "model")
    watched, recording, shown = tmp_path / "watched", tmp_path / "exchange.txt", tmp_path / "shown.txt"
    code = "from chairward.cli.app import main; main()"
    with shown.open("w") as out:
        monitor = subprocess.Popen(
            [sys.executable, "-uc", code, "pic", "monitor", tmp_path / "pic", "--link", watched, "--record", recording],
            stdout=out,
            stderr=subprocess.STDOUT,
        )
    try:
        _until(watched.exists)
        start(HOST, str(watched))
        _until(lambda: all(part in shown.read_text() for part in ("HELLO protocol 1", "DRIVE", "STATUS ARMED")))
        monitor.send_signal(signal.SIGINT)
        assert monitor.wait(WAIT_S) == 0
    finally:
        monitor.kill()
        monitor.wait()
    assert not os.path.lexists(watched)
    lines = [line for line in shown.read_text().splitlines()[1:] if line]
    read = CliRunner().invoke(pic, ["monitor", str(recording)])
    assert read.exit_code == 0
    assert read.output.splitlines()[: len(lines)] == lines  # Ctrl-C may have come between the two


def test_pins_are_published_under_the_agreed_names_and_kept_fresh(
    start: Callable[..., subprocess.Popen[str]], tmp_path: Path
) -> None:
    start(SIM, str(tmp_path), "model")
    pins = SharedState.attach(tmp_path / "pins", 5.0)
    assert pins.names == PIN_NAMES
    first = pins.read()["time_ns"]
    _until(lambda: pins.read()["time_ns"] != first)
    assert pins.read()["brake"] == 1
    pins.close()


def test_sim_pic_says_where_its_port_and_its_pins_are_and_takes_both_away(tmp_path: Path) -> None:
    code = "from chairward.cli.app import main; main()"
    sim = subprocess.Popen(
        [sys.executable, "-uc", code, "sim", "pic", "--link", tmp_path / "port"], stdout=subprocess.PIPE, text=True
    )
    assert sim.stdout is not None
    try:
        said = sim.stdout.readline()
        port, pins = (Path(found) for found in re.findall(r"(?:on|pins in) (/[^,;]+)", said))
        assert port.exists()
        SharedState.attach(pins, 5.0).close()
        sim.send_signal(signal.SIGINT)
        assert sim.wait(WAIT_S) == 0
    finally:
        sim.kill()
        sim.communicate()
    assert not os.path.lexists(port)
    assert not pins.exists()


@pytest.mark.parametrize("engine", ["model", pytest.param("gpsim in slices", marks=pytest.mark.needs_gpsim)])
def test_find_names_what_answers(
    start: Callable[..., subprocess.Popen[str]], request: pytest.FixtureRequest, tmp_path: Path, engine: str
) -> None:
    if engine != "model":
        request.getfixturevalue("new_gpsim")  # skips where it is missing
    start(SIM, str(tmp_path), engine)
    _until(lambda: "Chairward PIC, protocol 1" in probe(str(tmp_path / "pic"), wait_s=5.0))


def test_find_says_what_is_wrong_with_a_port(tmp_path: Path) -> None:
    assert "there is no such port" in probe(str(tmp_path / "none"))

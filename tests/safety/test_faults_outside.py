"""P1 when the supervisor dies, or the line to the controller: a controller in a process of its own is watched."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest
from rig import CHAIR, PERSON, duty, load, running

pytestmark = [pytest.mark.processes, pytest.mark.timeout(150)]

NO_COMPANION = CHAIR.partition("[companion.pic]")[0]
BUSY_MACHINE_S = 0.12


def wait(condition: Callable[[], bool], what: str, seconds: float) -> float:
    began = time.monotonic()
    while not condition():
        if time.monotonic() - began > seconds:
            raise AssertionError(f"waited {seconds:.1f} s for {what}")
        time.sleep(0.002)
    return time.monotonic() - began


@contextmanager
def controller(folder: Path) -> Iterator[subprocess.Popen[bytes]]:
    """A simulated PIC that does not end with the run; its port is folder/pic, its pins folder/pins."""
    (folder / "pins").unlink(missing_ok=True)
    program = (
        "import sys; from pathlib import Path; from chairward_drive_pic_serial.sim_pic import SimPic, SimPicSettings; "
        "SimPic(SimPicSettings(), Path(sys.argv[1])).run(lambda: None, lambda: False)"
    )
    process = subprocess.Popen([sys.executable, "-c", program, str(folder)])
    try:
        wait((folder / "pins").exists, "the simulated controller", 60.0)
        yield process
    finally:
        process.terminate()
        process.wait(10.0)


@contextmanager
def chairward_run(folder: Path) -> Iterator[subprocess.Popen[bytes]]:
    """`chairward run` as people start it, driving; whatever is left of it is ended."""
    (folder / "chairs").mkdir()
    (folder / "people").mkdir()
    (folder / "chairs" / "zoo.toml").write_text(NO_COMPANION.replace("{run}/pic", str(folder / "pic")))
    (folder / "people" / "keeper.toml").write_text(PERSON)
    (folder / "tmp").mkdir()
    with (folder / "run.err").open("wb") as err:
        process = subprocess.Popen(
            [
                sys.executable,
                "-m",
                "chairward",
                "run",
                "--chair",
                "zoo",
                "--person",
                "keeper",
                "--headless",
                "--no-record",
            ],
            env={**os.environ, "CHAIRWARD_PROFILES": str(folder), "TMPDIR": str(folder / "tmp")},
            stdout=err,
            stderr=err,
        )
    try:
        wait(lambda: duty(folder / "pins") > 0.0 or process.poll() is not None, "the chair to drive", 60.0)
        assert process.poll() is None, (folder / "run.err").read_text()
        yield process
    finally:
        process.kill()
        process.wait(10.0)


def processes_of(folder: Path) -> list[int]:
    """The processes whose command line names a folder."""
    found = []
    for path in Path("/proc").glob("[0-9]*/cmdline"):
        try:
            if str(folder).encode() in path.read_bytes():
                found.append(int(path.parent.name))
        except OSError:
            continue  # it has just ended
    return found


@pytest.mark.parametrize("how", [signal.SIGKILL, signal.SIGSTOP])
def test_a_supervisor_that_is_killed_or_stopped_stops_the_chair(tmp_path: Path, how: signal.Signals) -> None:
    with controller(tmp_path), chairward_run(tmp_path) as process:
        os.kill(process.pid, how)
        took = wait(lambda: duty(tmp_path / "pins") == 0.0, "the pins to be off", 2.0)
        assert took <= 0.25 + BUSY_MACHINE_S
        if how is signal.SIGKILL:
            wait(lambda: not processes_of(tmp_path / "tmp"), "every process of the run to leave", 15.0)


def test_ctrl_c_stops_the_chair_first_and_ends_in_order(tmp_path: Path) -> None:
    with controller(tmp_path), chairward_run(tmp_path) as process:
        process.send_signal(signal.SIGINT)
        took = wait(lambda: duty(tmp_path / "pins") == 0.0, "the pins to be off", 2.0)
        assert took <= 0.25 + BUSY_MACHINE_S
        assert process.wait(20.0) == 0
        assert not processes_of(tmp_path / "tmp")
        assert "SIGINT received" in (tmp_path / "run.err").read_text()


def test_an_unplugged_port_is_named_and_driving_needs_reset_and_arm_after_it_is_back(tmp_path: Path) -> None:
    plan = load(tmp_path, NO_COMPANION.replace("{run}/pic", str(tmp_path / "pic")))
    with controller(tmp_path) as first, running(plan, tmp_path / "run", pins=tmp_path / "pins") as rig:
        (rig.run_dir / "no-arm").touch()
        first.kill()
        unplugged_ns = time.monotonic_ns()
        rig.wait(lambda: str(tmp_path / "pic") in rig.records[-1].decision.latch, "the port to be named", 3.0)
        assert rig.records[-1].decision.motion == (0.0, 0.0)
        with controller(tmp_path):
            rig.wait(lambda: rig.records[-1].facts.drive.linked, "the line to be back", 10.0)
            back_ns = time.monotonic_ns()
            rig.wait(lambda: rig.records[-1].facts.now_ns > back_ns + 500_000_000, "the guard to go on", 5.0)
            assert all(
                r.decision.motion == (0.0, 0.0) for r in rig.records if r.facts.now_ns > unplugged_ns + 50_000_000
            )
            (rig.run_dir / "no-arm").unlink()
            rig.wait(rig.driving, "the chair to drive again", 30.0)

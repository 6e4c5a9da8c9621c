"""P1 in real processes: what dies or falls silent while the chair drives stops the wheels in time, and is named."""

from __future__ import annotations

import os
import signal
import time
from pathlib import Path

import pytest
from mcap.exceptions import McapError
from rig import CHAIR, MS, Rig, alive, load, running

from chairward.processes import LOG_BYTES
from chairward.recording import read

pytestmark = pytest.mark.processes
LANE_LIMIT_NS = {"front": 200 * MS, "voice": 300 * MS, "panel": 300 * MS}
WATCHDOG_S = 0.25
BUSY_MACHINE_S = 2.0
"""Added to every limit: a safety bound for a machine that shares its cores. The figures are in benchmarks/faults.py."""


def pins_off_within(rig: Rig, seconds: float) -> None:
    """Wait until the pins let the wheels stand."""
    rig.wait(lambda: rig.duty() == 0.0, "the pins to be off", seconds)


@pytest.mark.parametrize("lane", ["front", "voice", "panel"])
@pytest.mark.parametrize("how", [signal.SIGKILL, signal.SIGSTOP])
def test_a_lane_that_is_killed_or_stopped_stops_the_chair_within_its_limit(
    tmp_path: Path, lane: str, how: signal.Signals
) -> None:
    with running(load(tmp_path), tmp_path / "run") as rig:
        killed_ns = time.monotonic_ns()
        os.kill(rig.pid(lane), how)
        rig.wait(lambda: rig.first_still_after(killed_ns) is not None, "a stop command", 10.0)
        still = rig.first_still_after(killed_ns)
        assert still is not None
        assert still.wrote_ns - killed_ns <= LANE_LIMIT_NS[lane] + BUSY_MACHINE_S * 1e9
        assert rig.moved_on_silence(killed_ns) == []
        rig.wait(lambda: lane in rig.reasons(killed_ns), "the culprit to be named", 10.0)
        pins_off_within(rig, 10.0)


def test_a_lane_that_died_is_started_again_and_the_chair_can_drive_again(tmp_path: Path) -> None:
    with running(load(tmp_path), tmp_path / "run") as rig:
        old, killed_ns = rig.pid("front"), time.monotonic_ns()
        os.kill(old, signal.SIGKILL)
        rig.wait(lambda: rig.first_still_after(killed_ns) is not None, "a stop command", 10.0)
        rig.wait(lambda: rig.pid("front") != old, "a new process", 30.0)
        assert any("killed by SIGKILL" in event and "front" in event for event in rig.supervisor.events)
        rig.wait(rig.driving, "the chair to drive again", 60.0)


def test_a_guard_that_is_killed_leaves_the_stop_to_the_controllers_watchdog(tmp_path: Path) -> None:
    with running(load(tmp_path), tmp_path / "run") as rig:
        os.kill(rig.pid("guard"), signal.SIGKILL)
        pins_off_within(rig, WATCHDOG_S + BUSY_MACHINE_S)
        rig.wait(lambda: bool(rig.supervisor.ended_reason), "the run to end")
        assert "guard" in rig.supervisor.ended_reason


def test_a_guard_that_is_stopped_leaves_the_stop_to_the_watchdog_and_does_not_say_go_when_continued(
    tmp_path: Path,
) -> None:
    with running(load(tmp_path), tmp_path / "run") as rig:
        pid = rig.pid("guard")
        (rig.run_dir / "no-arm").touch()  # before, or RESET and ARM would wait in its line
        os.kill(pid, signal.SIGSTOP)
        try:
            pins_off_within(rig, WATCHDOG_S + BUSY_MACHINE_S)
        finally:
            continued_ns = time.monotonic_ns()  # before: its first decision comes at once
            os.kill(pid, signal.SIGCONT)
        rig.wait(lambda: rig.records[-1].facts.now_ns > continued_ns + 1_000 * MS, "the guard to go on", 30.0)
        assert all(r.decision.motion == (0.0, 0.0) for r in rig.records if r.facts.now_ns > continued_ns)
        said = rig.reasons(continued_ns)
        assert "clock" in said or "heard no command" in said, said  # whichever of guard and controller tells first


def test_the_processes_of_a_run_end_with_it(tmp_path: Path) -> None:
    with running(load(tmp_path), tmp_path / "run") as rig:
        pids = [rig.pid(name) for name in ("guard", "front", "voice", "panel", "pic")]
    assert rig.code == 0
    assert not any(alive(pid) for pid in pids)
    assert rig.duty() == 0.0


def test_a_recorder_that_is_killed_is_started_again_and_what_lanes_say_is_bounded(tmp_path: Path) -> None:
    recorder = '[observer.log]\ncomponent = "recorder"\nsettings = { path = "{run}/drive.mcap" }\n'
    with running(load(tmp_path, CHAIR + recorder), tmp_path / "run") as rig:
        first, second = rig.run_dir / "drive.mcap", rig.run_dir / "drive.2.mcap"
        rig.wait(lambda: recorded(first) != [], "the recorder to write", 60.0)
        with (rig.run_dir / "lane-front.log").open("ab") as log:
            log.write(b"." * 2 * LOG_BYTES)
        os.kill(rig.supervisor.observers["log"].process.pid, signal.SIGKILL)
        rig.wait(lambda: recorded(second) != [], "a new one to write", 60.0)
        rig.wait((rig.run_dir / "lane-front.old.log").exists, "the log to be cut", 30.0)
        assert any("observer 'log'" in event and "killed by SIGKILL" in event for event in rig.supervisor.events)
    assert recorded(first)[-1] < recorded(second)[0], "each decision is in one part"


def recorded(part: Path) -> list[int]:
    """The decisions in a file that is perhaps still written, by their number."""
    try:
        return [record.tick for record in read(part)]
    except (FileNotFoundError, McapError):
        return []  # nothing is in it yet

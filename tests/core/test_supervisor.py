"""How the supervisor watches lanes and observers: who dies, hangs or floods is ended with its children, named, and
started again after a pause that grows. (Whole chairs: tests/safety.)"""

from __future__ import annotations

import dataclasses
import os
import socket
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from itertools import count
from pathlib import Path

import pytest
from msgspec.structs import replace

from chairward import plan, records, wire
from chairward.companions import plan_file
from chairward.lane_process import BEATS_AT_ONCE, FLOOD_A_SECOND, HANG_S, NOTES_A_PROCESS, START_S, LaneProcess
from chairward.plan import LanePlan, Part
from chairward.processes import BACK_OFF_S, FORGIVEN_S
from chairward.supervisor import Supervisor
from chairward.testing.observer_contract import ride
from chairward.testing.ride import chair_plan

LANE = LanePlan(name="front", source=Part(component="nobody"))
WORKS = "import time; time.sleep(60)"


class Watched:
    """A supervisor with one lane: any Python process, and the ends of the lines that its lane and the guard hold."""

    def __init__(self, run_dir: Path, code: str = WORKS) -> None:
        process = subprocess.Popen([sys.executable, "-c", code], process_group=0, stdout=subprocess.PIPE)
        ours, self.its_end = wire.pair()
        control, self.guards_end = wire.pair()
        self.supervisor = Supervisor(
            chair_plan(lanes=(LANE,)),
            run_dir,
            lambda record: None,
        )
        self.supervisor._control = control
        self.process = process
        self.lane = LaneProcess(process, LANE, ours)
        self.supervisor.lanes["front"] = self.lane

    def look(self, now: float | None = None) -> None:
        self.supervisor._watch_lane(self.lane, time.monotonic() if now is None else now)

    def beats(self, **fields: int) -> None:
        wire.send_control(self.its_end, wire.Beat(**{"items": 1, "dropped": 0, **fields}))

    def guard_hears(self) -> list[tuple[wire.Control, int]]:
        """What the guard was told, and how many descriptors came with each."""
        heard = []
        while (received := wire.receive_control(self.guards_end)) is not None:
            message, fds = received
            heard.append((message, len(fds)))
            for fd in fds:
                os.close(fd)
        return heard

    def told(self) -> str:
        return "\n".join(self.supervisor.events)


@contextmanager
def watched(run_dir: Path, code: str = WORKS) -> Iterator[Watched]:
    it = Watched(run_dir, code)
    try:
        yield it
    finally:
        for process in {it.process, it.lane.process}:
            process.kill()
            process.wait(10.0)
        assert it.process.stdout is not None
        it.process.stdout.close()
        assert it.supervisor._control is not None
        for end in (it.its_end, it.guards_end, it.lane.control, it.supervisor._control):
            end.close()


def wait_for(true: Callable[[], bool], what: str) -> None:
    end = time.monotonic() + 30.0
    while not true():
        assert time.monotonic() < end, f"waited for {what}"
        time.sleep(0.01)


def test_a_lane_that_dies_again_and_again_is_started_after_longer_and_longer_pauses(tmp_path: Path) -> None:
    with watched(tmp_path, "raise SystemExit(3)") as it:
        it.process.wait(20.0)
        now, pauses = it.lane.started_s, []
        for _ in range(len(BACK_OFF_S) + 2):
            it.look(now)
            pauses.append(round(it.lane.restart_at_s - now, 6))
            it.lane.restart_at_s, it.lane.started_s = 0.0, now  # as a restart leaves it: and dead once more
        assert pauses == [*BACK_OFF_S, BACK_OFF_S[-1], BACK_OFF_S[-1]]
        it.look(now + FORGIVEN_S + 0.1)
        assert it.lane.restart_at_s - now - FORGIVEN_S - 0.1 == pytest.approx(BACK_OFF_S[0])
        assert it.lane.deaths == len(pauses) + 1
        died = [message for message, _ in it.guard_hears()]
        assert all(isinstance(message, wire.Died) and "ended with code 3" in message.reason for message in died)
        assert len(died) == it.lane.deaths


def test_it_is_not_started_before_the_pause_is_over_and_then_the_guard_gets_its_new_line(tmp_path: Path) -> None:
    with watched(tmp_path, "raise SystemExit(3)") as it:
        it.process.wait(20.0)
        plan.write(it.supervisor.plan, plan_file(tmp_path))
        it.supervisor.rings = {"front": os.open("/dev/null", os.O_RDWR)}
        it.look(1_000.0)
        it.guard_hears()
        it.look(1_000.0 + BACK_OFF_S[0] - 0.01)
        assert it.lane.process is it.process
        assert it.guard_hears() == []
        it.look(1_000.0 + BACK_OFF_S[0])
        assert it.lane.process is not it.process
        assert os.getpgid(it.lane.process.pid) == it.lane.process.pid, "in a group of its own"
        assert it.guard_hears() == [(wire.Attach("front"), 1)]
        os.close(it.supervisor.rings["front"])


@pytest.mark.parametrize(
    ("items", "silent_s", "says"),
    [(1, HANG_S + 0.1, "has not moved for 5 s"), (0, START_S + 0.1, "was not ready within 90 s")],
)
def test_a_lane_that_hangs_is_ended_with_all_that_it_started_and_named(
    tmp_path: Path, items: int, silent_s: float, says: str
) -> None:
    starts_a_child = (
        f"import subprocess, sys; print(subprocess.Popen([sys.executable, '-c', {WORKS!r}]).pid, flush=True)"
    )
    with watched(tmp_path, f"{starts_a_child}; {WORKS}") as it:
        assert it.process.stdout is not None
        child = int(it.process.stdout.readline())
        now = time.monotonic()
        it.beats(items=items)
        it.look(now)
        it.look(now + silent_s - 0.2)
        assert it.supervisor.events == []
        it.look(now + silent_s)
        assert "lane 'front'" in it.told()
        assert says in it.told()
        assert it.process.wait(10.0) == -9
        end = time.monotonic() + 10.0
        while Path(f"/proc/{child}/stat").exists() and Path(f"/proc/{child}/stat").read_text().split()[2] != "Z":
            assert time.monotonic() < end, "its child lives on"
            time.sleep(0.01)


def test_a_lane_that_beats_is_left_alone_however_long(tmp_path: Path) -> None:
    with watched(tmp_path) as it:
        for minute in range(10):
            it.beats(items=minute + 1)
            it.look(it.lane.started_s + 60.0 * minute)
        assert it.supervisor.events == []
        assert it.guard_hears() == []


def test_a_lane_that_floods_its_line_to_the_supervisor_is_ended_and_named(tmp_path: Path) -> None:
    with watched(tmp_path) as it:
        lies = (wire.Note(f"lie {nth}") for nth in count())
        for _ in range(2 * FLOOD_A_SECOND // BEATS_AT_ONCE):
            for _ in range(BEATS_AT_ONCE - 1):  # so that its line is empty after each look
                wire.send_control(it.its_end, next(lies))
            it.look(1_000.0)
        assert "lane 'front': its process floods its line to the supervisor" in it.told()
        assert it.process.wait(10.0) == -9
        assert len(it.supervisor.events) == NOTES_A_PROCESS + 1, "and what it says is not all written down"


def test_beats_that_waited_for_a_supervisor_that_stood_still_are_no_flood(tmp_path: Path) -> None:
    with watched(tmp_path) as it:
        while wire.send_control(it.its_end, wire.Beat(items=1, dropped=0)):
            pass
        for _ in range(10):
            it.look(1_000.0)
        assert wire.receive_control(it.lane.control) is None, "all is read"
        assert it.supervisor.events == []
        assert it.process.poll() is None


def test_a_lane_that_says_more_than_the_guard_takes_is_named_once(tmp_path: Path) -> None:
    with watched(tmp_path) as it:
        for dropped in (0, 5, 900):
            it.beats(dropped=dropped)
            it.look()
        assert it.told().count("lane 'front' says more than the guard listens to") == 1
        assert it.lane.dropped == 900


@pytest.mark.parametrize("ends_run", [True, False])
def test_the_end_of_an_input_ends_the_run_only_where_the_chair_file_says_so(tmp_path: Path, ends_run: bool) -> None:
    with watched(tmp_path, "pass") as it:
        it.process.wait(20.0)
        it.lane.plan = dataclasses.replace(LANE, ends_run=ends_run)
        wire.send_control(it.its_end, wire.Beat(items=9, dropped=0, ended=True))
        it.look()
        it.look()
        assert it.supervisor.ended_reason == ("the input of lane 'front' has ended" if ends_run else "")
        assert it.supervisor.events == ["lane 'front': its input has ended"]
        assert it.lane.restart_at_s == 0.0, "who has given all is not started again"


def test_a_lane_that_cannot_start_says_its_sentence_once_however_often_it_is_tried(tmp_path: Path) -> None:
    with watched(tmp_path) as it:
        for _ in range(3):
            wire.send_control(it.its_end, wire.Note("lane 'front' cannot start: no camera"))
            it.look()
            ours, its_end = wire.pair()
            it.its_end.close()
            it.its_end = its_end
            it.lane.started_again(it.process, ours)
        assert it.supervisor.events == ["lane 'front' cannot start: no camera"]


def test_a_lane_that_gives_descriptors_to_the_supervisor_fills_no_table(tmp_path: Path) -> None:
    with watched(tmp_path) as it:
        before = len(os.listdir("/proc/self/fd"))
        for _ in range(20):
            wire.send_control(it.its_end, wire.Beat(items=1, dropped=0), [it.its_end.fileno()])
        it.look()
        assert len(os.listdir("/proc/self/fd")) == before


def calls_help(guards_end: socket.socket) -> None:
    """What the guard says when help is called, to one observer."""
    told = ride(1)[0]
    guards_end.send(records.encode(replace(told, decision=replace(told.decision, help=True))))


def test_an_observer_that_dies_again_and_again_is_named_and_after_each_pause_a_new_one_calls_for_help(
    tmp_path: Path,
) -> None:
    with watched(tmp_path) as it:
        called = tmp_path / "called"
        settings = {"command": [sys.executable, "-c", "import sys; open(sys.argv[1], 'a').write('.')", str(called)]}
        helper = Part(component="call_help", plugin="core", settings=settings)
        plan.write(chair_plan(lanes=(LANE,), observers={"help": helper}), plan_file(tmp_path))
        guards_end = it.supervisor._start_observer("help")
        observer = it.supervisor.observers["help"]
        for nth, pause_s in enumerate(BACK_OFF_S[:2], start=1):
            it.supervisor._watch_observer("help", observer, observer.started_s)
            assert len(it.supervisor.events) == nth - 1, "who lives is left alone"
            calls_help(guards_end)
            wait_for(lambda nth=nth: called.exists() and len(called.read_text()) == nth, "the program to be started")
            died, now = observer.process, observer.started_s
            died.kill()
            died.wait(10.0)
            it.supervisor._watch_observer("help", observer, now)
            it.supervisor._watch_observer("help", observer, now + pause_s - 0.01)
            assert observer.process is died, "not before the pause is over"
            assert it.guard_hears() == []
            it.supervisor._watch_observer("help", observer, now + pause_s)
            assert observer.process is not died
            assert it.supervisor.events[-1].startswith("observer 'help': its process was killed by SIGKILL: ")
            assert it.supervisor.events[-1].endswith(f"starting it again in {pause_s:g} s")
            guards_end.close()
            received = wire.receive_control(it.guards_end)
            assert received is not None
            assert received[0] == wire.Observe()
            guards_end = wire.adopt(received[1][0])
        calls_help(guards_end)
        wait_for(lambda: len(called.read_text()) == 3, "the newest process to call")
        guards_end.close()
        assert observer.process.wait(20.0) == 0, "the guard's end is closed: it has seen all"

"""The kinds of fault that faults.py puts into a driving chair, each a function that gives one sample after another."""

from __future__ import annotations

import contextlib
import os
import random
import signal
import sys
import time
from collections.abc import Callable, Iterator
from itertools import count
from pathlib import Path
from typing import Any

ROOT = Path(__file__).resolve().parents[1]
sys.path[:0] = [str(ROOT / "tests" / "safety"), str(ROOT / "tests" / "safety" / "zoo")]

from rig import CHAIR, MS, Rig, controller, load, off_since, outside, running  # noqa: E402
from typed_run import chairward_run  # noqa: E402

from chairward import processes  # noqa: E402
from chairward.components import STILL, Motion  # noqa: E402
from chairward_drive_pic_serial.engine import Engine, ModelEngine  # noqa: E402
from chairward_drive_pic_serial.gpsim import Gpsim  # noqa: E402
from chairward_drive_pic_serial.rig import PicRig  # noqa: E402

WATCHDOG_NS = 200 * MS
STOP_SLACK_NS, OFF_SLACK_NS, FIRMWARE_SLACK_NS = 30 * MS, 50 * MS, 10 * MS
LIMIT_NS = {"front": 200 * MS, "voice": 300 * MS, "panel": 300 * MS, "drive": 200 * MS}
EAGER = """
[settings.voice_citizen]
word_ms = 150
[settings.panel_citizen]
press_ms = 60
"""
CAN = """
[drive.can]
dialect = "rnet"
interface = "slcan"
channel = "{run}/can"
acknowledged = true
silence_stop_ms = 200
silence_stop_measured = 2026-11-22
[drive.can.rnet]
takeover = "follow"
hazard_accepted = "two senders, the chair may jerk"
settle_ms = 300
[companion.pic]
component = "sim_can"
"""
Sample = dict[str, Any]
RUNS: dict[str, Callable[[Path], Iterator[Sample]]] = {}


def kind(run: Callable[[Path], Iterator[Sample]]) -> Callable[[Path], Iterator[Sample]]:
    """One kind of fault: gives one sample after the other."""
    RUNS[run.__name__] = run
    return run


def sample(who: str, took_ns: float, bound_ns: int) -> Sample:
    """One run: what failed, how long it took, how long it may."""
    return {"who": who, "ms": round(took_ns / MS, 2), "bound_ms": bound_ns / MS}


def told_to_stop(rig: Rig, fault: Callable[[], object]) -> int:
    """From the fault until the first command to stand was written, ns."""
    rig.wait(rig.driving, "the chair to drive")
    del rig.records[:-1]
    time.sleep(random.uniform(0.0, 0.04))
    began = time.monotonic_ns()
    fault()
    rig.wait(lambda: rig.first_still_after(began) is not None, "a stop", 20.0)
    still = rig.first_still_after(began)
    assert still is not None
    return still.wrote_ns - began


def off(pins: Path, fault: Callable[[], object]) -> float:
    """From the fault until the controller's pins were off, by its own clock, ns; 0 where they were off before."""
    end = time.monotonic() + 20.0
    while off_since(pins) is not None:
        if time.monotonic() > end:
            raise AssertionError("the chair does not drive")
        time.sleep(0.005)
    time.sleep(random.uniform(0.0, 0.04))
    began = time.monotonic_ns()
    fault()
    while (off_ns := off_since(pins)) is None:
        time.sleep(0.0005)
    return max(0.0, off_ns - began)


@contextlib.contextmanager
def chair(folder: Path, text: str = CHAIR, *, pins: Path | None = None, drive: str = "pic_serial") -> Iterator[Rig]:
    """A driving chair whose people press and speak all the time and whose lanes come back at once."""
    processes.BACK_OFF_S = (0.02,)
    plan = load(folder, text + EAGER, drive=drive)
    with running(plan, folder / "run", pins=pins, looks_at_pins=drive == "pic_serial") as rig:
        yield rig


# ---- a lane fails ---------------------------------------------------------------------------------------------------
@kind
def lane_killed(folder: Path) -> Iterator[Sample]:
    with chair(folder) as rig:
        for nth in count():
            lane = ("front", "voice", "panel")[nth % 3]
            pid = rig.pid(lane)
            took_ns = told_to_stop(rig, lambda pid=pid: os.kill(pid, signal.SIGKILL))
            yield sample(lane, took_ns, LIMIT_NS[lane] + STOP_SLACK_NS)


@kind
def lane_stopped(folder: Path) -> Iterator[Sample]:
    with chair(folder) as rig:
        for nth in count():
            lane = ("front", "voice", "panel")[nth % 3]
            pid = rig.pid(lane)
            took_ns = told_to_stop(rig, lambda pid=pid: os.kill(pid, signal.SIGSTOP))
            os.kill(pid, signal.SIGCONT)
            yield sample(lane, took_ns, LIMIT_NS[lane] + STOP_SLACK_NS)


def _turned(folder: Path, how: str) -> Iterator[Sample]:
    """The sensor's process turns into an animal of the zoo, and is ended once the chair was told to stop."""
    with chair(folder) as rig:
        while True:
            pid = rig.pid("front")
            took_ns = told_to_stop(rig, lambda: rig.misbehave("front", how))
            rig.behave("front")
            os.kill(pid, signal.SIGKILL)
            rig.wait(lambda pid=pid: rig.pid("front") != pid, "a new process")
            yield sample("front", took_ns, LIMIT_NS["front"] + PERIOD_NS + STOP_SLACK_NS)


PERIOD_NS = 33 * MS
"""A citizen looks for its cue once a period: so much later may it turn."""


@kind
def socket_closed(folder: Path) -> Iterator[Sample]:
    return _turned(folder, "close_socket")


@kind
def gil_held(folder: Path) -> Iterator[Sample]:
    return _turned(folder, "hold_gil")


@kind
def flood(folder: Path) -> Iterator[Sample]:
    """How old the sensor's newest reading was when it still allowed motion: who floods goes stale or stays in time."""
    with chair(folder) as rig:
        while True:
            rig.wait(rig.driving, "the chair to drive")
            began = rig.misbehave("front", "flood")
            rig.wait(lambda began=began: rig.records[-1].facts.now_ns > began + 600 * MS, "the flood", 10.0)
            rig.behave("front")
            ages = [
                r.wrote_ns - r.facts.ranges["front/range_citizen"][-1].captured_ns
                for r in list(rig.records)
                if r.facts.now_ns > began and r.decision.motion != (0.0, 0.0)
            ]
            late = max(r.woke_ns - r.due_ns for r in list(rig.records) if r.facts.now_ns > began and r.periodic)
            del rig.records[:-1]
            yield {
                **sample("front", max(ages, default=0), LIMIT_NS["front"] + STOP_SLACK_NS),
                "tick_late_ms": round(late / MS, 2),
            }


# ---- what commands fails --------------------------------------------------------------------------------------------
@kind
def guard_stopped(folder: Path) -> Iterator[Sample]:
    with controller(folder), chair(folder, outside(folder), pins=folder / "pins") as rig:
        pid = rig.pid("guard")
        while True:
            rig.wait(rig.driving, "the chair to drive")
            took_ns = off(folder / "pins", lambda: os.kill(pid, signal.SIGSTOP))
            os.kill(pid, signal.SIGCONT)
            yield sample("guard", took_ns, WATCHDOG_NS + OFF_SLACK_NS)


@kind
def guard_killed(folder: Path) -> Iterator[Sample]:
    with controller(folder):
        for nth in count():
            run_dir = folder / f"run-{nth}"
            with running(load(folder, outside(folder) + EAGER), run_dir, pins=folder / "pins") as rig:
                pid = rig.pid("guard")
                took_ns = off(folder / "pins", lambda pid=pid: os.kill(pid, signal.SIGKILL))
            yield sample("guard", took_ns, WATCHDOG_NS + OFF_SLACK_NS)


@kind
def supervisor_stopped(folder: Path) -> Iterator[Sample]:
    with controller(folder), chairward_run(folder, more=EAGER) as run:
        while True:
            took_ns = off(folder / "pins", lambda: os.kill(run.pid, signal.SIGSTOP))
            os.kill(run.pid, signal.SIGCONT)
            yield sample("supervisor", took_ns, WATCHDOG_NS + OFF_SLACK_NS)


@kind
def supervisor_killed(folder: Path) -> Iterator[Sample]:
    with controller(folder):
        while True:
            with chairward_run(folder, more=EAGER) as run:
                took_ns = off(folder / "pins", lambda pid=run.pid: os.kill(pid, signal.SIGKILL))
                yield sample("supervisor", took_ns, WATCHDOG_NS + OFF_SLACK_NS)


# ---- the line to the wheels fails -----------------------------------------------------------------------------------
@kind
def unplugged(folder: Path) -> Iterator[Sample]:
    with controller(folder) as far_end, chair(folder, outside(folder), pins=folder / "pins") as rig:
        while True:
            rig.wait(rig.driving, "the chair to drive")
            took_ns = off(folder / "pins", lambda: far_end.send_signal(signal.SIGUSR1))
            far_end.send_signal(signal.SIGUSR2)
            del rig.records[:-1]
            yield sample("port", took_ns, WATCHDOG_NS + OFF_SLACK_NS)


@kind
def can_silent(folder: Path) -> Iterator[Sample]:
    text = CHAIR.partition("[drive.pic_serial]")[0] + CAN
    with chair(folder, text, drive="can") as rig:
        pid = rig.pid("pic")
        while True:
            took_ns = told_to_stop(rig, lambda: os.kill(pid, signal.SIGSTOP))
            os.kill(pid, signal.SIGCONT)
            yield sample("controller", took_ns, LIMIT_NS["drive"] + STOP_SLACK_NS)


def _silence(engine: Engine, folder: Path) -> Iterator[Sample]:
    """The host dies, or its cable is pulled, at a random moment at full speed: in the firmware's own time."""
    rig = PicRig(engine, folder)
    for nth in count():
        rig.go(Motion(rig.full.drive_mm_s, 0.0), 0.1)
        rig.drive.command(rig.now_ns(), Motion(rig.full.drive_mm_s, 0.0))
        rig.step(random.randint(1, 1000))
        began = rig.now_ns()
        if nth % 2:
            rig.unplug()
        while rig.wheels() != STILL:
            rig.step(500)
        took_ns = rig.now_ns() - began
        if nth % 2:
            rig.plug()
        rig.connect(5.0)
        yield sample("cable" if nth % 2 else "host", took_ns, WATCHDOG_NS + FIRMWARE_SLACK_NS)


@kind
def silence_model(folder: Path) -> Iterator[Sample]:
    return _silence(ModelEngine(), folder)


@kind
def silence_gpsim(folder: Path) -> Iterator[Sample]:
    return _silence(Gpsim(), folder)

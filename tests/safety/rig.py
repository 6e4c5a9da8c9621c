"""A whole chair in real processes for the fault tests: zoo citizens as lanes, the real serial drive, a simulated PIC.

The tests look at the *pins* that the simulated controller publishes, not at what the guard says it did.
"""

from __future__ import annotations

import os
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path

from chairward import profile
from chairward.plan import Plan
from chairward.plugins import discover
from chairward.records import Record
from chairward.shared_state import SharedState
from chairward.supervisor import Supervisor

CHAIR = """
name = "zoo"
kind = "simulator"
[footprint]
front_mm = 450
rear_mm = 450
half_width_mm = 300
[limits]
supervisor_freshness_ms = 200
[lane.front]
source = "range_citizen"
freshness_ms = 200
covers = ["ahead", "left", "right"]
[lane.voice]
source = "voice_citizen"
freshness_ms = 300
settings.voice_citizen = { period_ms = 50 }
[lane.panel]
source = "panel_citizen"
freshness_ms = 300
stop_device = true
may = ["stop", "arm", "reset"]
settings.panel_citizen = { period_ms = 50 }
[drive.pic_serial]
port = "{run}/pic"
[companion.pic]
component = "sim_pic"
"""
OUTSIDE = CHAIR.partition("[companion.pic]")[0]
"""The same chair without a controller of its own: see `outside`."""

PERSON = """
name = "keeper"
chair = "zoo"
drive = "pic_serial"
[words]
front = "front"
stop = "stop"
"""

MS = 1_000_000


def duty(path: Path) -> float:
    """The drive motor's duty at a controller's pins, 0..1; 0 when it brakes or nothing is published."""
    return stamped_duty(path)[1]


def published(path: Path) -> dict[str, float]:
    """A controller's pins as it published them last."""
    pins = SharedState.attach(path)
    try:
        return pins.read()
    finally:
        pins.close()


def off_since(path: Path) -> float | None:
    """Since when the outputs of a `controller` have been off, by its own clock (CLOCK_MONOTONIC, ns); None: they drive.

    Told by the controller, not seen by who looks: on a busy machine a process may not get to look for 100 ms.
    """
    return None if duty(path) else published(path)["off_ns"]


def stamped_duty(path: Path) -> tuple[float, float]:
    """When the controller published its pins last (CLOCK_MONOTONIC, ns), and the duty then."""
    if not path.exists():
        return 0.0, 0.0
    values = published(path)
    braking = values["brake"] or values["drive_in1"] == values["drive_in2"]
    return values["time_ns"], 0.0 if braking else values["drive_duty"]


@contextmanager
def controller(folder: Path) -> Iterator[subprocess.Popen[bytes]]:
    """A simulated PIC that does not end with a run (controller.py): its port is folder/pic, its pins folder/pins."""
    (folder / "pins").unlink(missing_ok=True)
    process = subprocess.Popen([sys.executable, str(Path(__file__).with_name("controller.py")), str(folder)])
    try:
        end = time.monotonic() + 60.0
        while not (folder / "pins").exists():
            assert process.poll() is None, "the simulated controller ended"
            assert time.monotonic() < end, "the simulated controller did not start"
            time.sleep(0.002)
        yield process
    finally:
        process.terminate()
        process.wait(10.0)


@dataclass(slots=True)
class Rig:
    """The running chair. `records` holds everything the guard published."""

    run_dir: Path
    supervisor: Supervisor
    records: list[Record] = field(default_factory=list)
    thread: threading.Thread | None = None
    code: int | None = None
    error: BaseException | None = None
    pins: Path | None = None
    """Where the controller publishes them, if not in the run's folder."""
    looks_at_pins: bool = True

    def wait(self, condition: Callable[[], bool], what: str, seconds: float = 40.0) -> None:
        """Wait for something to become true; fails with `what` and the log of the run."""
        end = time.monotonic() + seconds
        while not condition():
            if self.error is not None:
                raise AssertionError(f"the run failed while waiting for {what}: {self.error}") from self.error
            if time.monotonic() > end:
                raise AssertionError(f"waited {seconds:.0f} s for {what}\n{self.story()}")
            time.sleep(0.002)

    def story(self) -> str:
        """What can be told of the run: events, the last decision, the processes' logs."""
        last = self.records[-1] if self.records else None
        logs = [f"-- {p.name}\n{p.read_text(errors='replace')[-1500:]}" for p in sorted(self.run_dir.glob("*.log"))]
        return "\n".join([f"events: {self.supervisor.events}", f"last: {last and (last.decision, last.facts)}", *logs])

    def driving(self) -> bool:
        """The guard commands motion, and the pins turn the wheels."""
        if not self.records or self.records[-1].decision.motion.drive_mm_s <= 50.0:
            return False
        return self.duty() > 0.0 or not self.looks_at_pins

    def duty(self) -> float:
        """The drive motor's duty at the controller's pins, 0..1; 0 when its brake is on."""
        return duty(self.pins or self.run_dir / "pins")

    def first_still_after(self, when_ns: int) -> Record | None:
        """The first decision at or after `when_ns` that commands no motion."""
        return next(
            (r for r in list(self.records) if r.facts.now_ns >= when_ns and r.decision.motion == (0.0, 0.0)), None
        )

    def moved_on_silence(self, since_ns: int) -> list[Record]:
        """Decisions since then that commanded motion although a required vote was older than its limit: none, ever."""
        limits = self.supervisor.plan.limits
        found = []
        for r in list(self.records):
            if r.facts.now_ns < since_ns or r.decision.motion == (0.0, 0.0):
                continue
            newest = {name: window[-1].captured_ns for name, window in r.facts.ranges.items() if window}
            newest |= {name: said.captured_ns for name, said in r.facts.alive.items()}
            required = {**limits.sensors, **limits.recognizers, **limits.stop_devices}
            if any(r.facts.now_ns - newest.get(name, 0) > need.freshness_ns for name, need in required.items()):
                found.append(r)
        return found

    def misbehave(self, lane: str, how: str) -> int:
        """Let the citizen of `lane` turn; returns when, CLOCK_MONOTONIC."""
        part = self.run_dir / f".turn-{lane}"
        part.write_text(how)
        now = time.monotonic_ns()
        part.rename(self.run_dir / f"turn-{lane}")
        return now

    def behave(self, lane: str) -> None:
        """Let the citizen of `lane` be good again (in its next process, if need be)."""
        (self.run_dir / f"turn-{lane}").unlink(missing_ok=True)

    def pid(self, name: str) -> int:
        """Of "guard", a lane or a companion."""
        if name == "guard":
            assert self.supervisor._guard is not None
            return self.supervisor._guard.pid
        if name in self.supervisor.companions:
            return self.supervisor.companions[name].pid
        return self.supervisor.lanes[name].process.pid

    def reasons(self, since_ns: int, events_before: int = 0) -> str:
        """All that people were told since then, and of the run's events all but the first few."""
        said: list[str] = []
        for r in list(self.records):
            if r.facts.now_ns >= since_ns:
                said += [f"{w.rule} {w.source} {w.detail}" for w in r.decision.reasons]
                said += [r.decision.latch, *r.decision.notes]
                said += [f"{source}: {why}" for source, why in r.facts.lost.items()]
        return "\n".join([*sorted(set(said)), *self.supervisor.events[events_before:]])


def load(folder: Path, chair: str = CHAIR, sets: tuple[str, ...] = (), *, drive: str = "pic_serial") -> Plan:
    """The zoo's plan, through the real loader."""
    (folder / "chairs").mkdir(exist_ok=True)
    (folder / "people").mkdir(exist_ok=True)
    (folder / "chairs" / "zoo.toml").write_text(chair)
    (folder / "people" / "keeper.toml").write_text(PERSON.replace("pic_serial", drive))
    return profile.load("zoo", "keeper", list(sets), discover(), profiles_dir=folder)


def outside(folder: Path) -> str:
    """The chair file of a chair whose controller is `controller(folder)`."""
    return OUTSIDE.replace("{run}/pic", str(folder / "pic"))


@contextmanager
def running(
    plan: Plan, run_dir: Path, *, until_driving: bool = True, pins: Path | None = None, looks_at_pins: bool = True
) -> Iterator[Rig]:
    """Start everything, wait until the chair drives, and end everything."""
    run_dir.mkdir(mode=0o700, exist_ok=True)
    rig = Rig(run_dir, Supervisor(plan, run_dir, lambda record: None), pins=pins, looks_at_pins=looks_at_pins)
    rig.supervisor.on_record = rig.records.append

    def work() -> None:
        try:
            rig.code = rig.supervisor.run()
        except Exception as error:  # noqa: BLE001 - whatever it is, the waiting test fails with it
            rig.error = error

    rig.thread = threading.Thread(target=work, name="supervisor")
    rig.thread.start()
    try:
        if until_driving:
            rig.wait(rig.driving, "the chair to drive")
        yield rig
    finally:
        rig.supervisor.stop("the test is over")
        rig.thread.join(30.0)
        assert not rig.thread.is_alive(), f"the supervisor did not end\n{rig.story()}"


def alive(pid: int) -> bool:
    """Whether that process still exists."""
    try:
        os.kill(pid, 0)
    except ProcessLookupError:
        return False
    return True

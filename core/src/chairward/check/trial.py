"""A chair on trial: the whole run as it always is, with a hand on it and somebody who reads every record.

Nothing of the chair is left out or replaced; the hand is one more lane, and one more stop device that must be alive.
"""

from __future__ import annotations

import os
import shutil
import tempfile
import threading
import time
from collections import deque
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field, replace
from pathlib import Path

import msgspec

from chairward.check.hand import Hand, hand
from chairward.components import STILL, Motion
from chairward.facts import MS, SourceLimits
from chairward.frames import FrameReader
from chairward.messages import Button, Command
from chairward.plan import LanePlan, Part, Plan
from chairward.recording.pictures import png
from chairward.records import Record
from chairward.shared_state import SharedState
from chairward.supervisor import Supervisor

HAND = "check"
"""The lane of the hand; its one component is check_hand."""
SOURCE = "check_hand"
HAND_SOURCE = f"{HAND}/{SOURCE}"
FRESH_NS = 400 * MS
START_S, ARM_S, TELL_S = 240.0, 20.0, 5.0
KEPT = 30_000
MOVING_MM_S = 20.0


class TrialError(Exception):
    """The chair does not do what the next step needs: one sentence."""


def on_trial(plan: Plan) -> Plan:
    """The plan with the hand: it may ask for motion and press buttons, and the chair stops when it lets go."""
    votes = {HAND_SOURCE: SourceLimits(freshness_ns=FRESH_NS)}
    limits = plan.limits
    return replace(
        plan,
        lanes=(
            *plan.lanes,
            LanePlan(
                name=HAND,
                source=Part(component=SOURCE, plugin="core"),
                freshness_ns=FRESH_NS,
                may=frozenset({Button.STOP, Button.ARM, Button.RESET}),
                stop_device=True,
            ),
        ),
        limits=msgspec.structs.replace(
            limits,
            recognizers={**limits.recognizers, **votes},
            stop_devices={**limits.stop_devices, **votes},
        ),
    )


@dataclass(slots=True)
class Trial:
    """The running chair. `records`: the newest that the guard published, oldest first."""

    plan: Plan
    run_dir: Path
    supervisor: Supervisor
    hand: Hand
    records: deque[Record] = field(default_factory=lambda: deque(maxlen=KEPT))
    changed: threading.Condition = field(default_factory=threading.Condition)
    error: BaseException | None = None
    over: bool = False

    def took(self, record: Record) -> None:
        """One more record."""
        with self.changed:
            self.records.append(record)
            self.changed.notify_all()

    @property
    def last(self) -> Record | None:
        """The newest record."""
        return self.records[-1] if self.records else None

    def wait(self, true: Callable[[Record], bool], seconds: float, after_ns: int | None = None) -> Record | None:
        """The first record from now on (or written after a moment) for which it is true; None when it never was."""
        end = time.monotonic() + seconds
        with self.changed:
            last = self.last
            seen = -1 if last is None or after_ns is not None else last.tick
            while True:
                for record in [r for r in self.records if r.tick > seen and r.wrote_ns > (after_ns or 0)]:
                    if true(record):
                        return record
                seen = self.records[-1].tick if self.records else -1
                left = end - time.monotonic()
                if left <= 0 or self.over:
                    return None
                self.changed.wait(min(left, 0.5))

    def must(self, true: Callable[[Record], bool], what: str, seconds: float, after_ns: int | None = None) -> Record:
        """As `wait`. Raises TrialError, with what stands in the way."""
        found = self.wait(true, seconds, after_ns)
        if found is None:
            raise TrialError(f"{what} did not happen within {seconds:g} s: {self.why()}")
        return found

    def why(self) -> str:
        """What holds the chair now."""
        if self.error is not None:
            return str(self.error)
        if self.last is None:
            return "nothing was decided"
        decision = self.last.decision
        held = [" ".join(filter(None, (r.rule, r.source, r.detail))) for r in decision.reasons]
        return "; ".join(dict.fromkeys(filter(None, (decision.latch, *decision.notes, *held)))) or "nothing holds it"

    def awaited(self) -> str:
        """What it waits for before it can start: the devices that are not there, or what else holds it."""
        lost = self.last.facts.lost if self.last is not None and self.error is None else {}
        return "; ".join(f"{lane}: {sentence}" for lane, sentence in lost.items()) or self.why()

    def arm(self) -> None:
        """RESET and ARM until the controller is armed, standing. Raises TrialError."""
        self.hand.hold(None)
        end = time.monotonic() + ARM_S
        while time.monotonic() < end and not self.over:
            last = self.last
            if last is not None and last.after.armed and not last.after.latch and not _remembers(last):
                return
            if last is not None and abs(told(last).drive_mm_s) < 1.0:
                self.hand.press(Button.RESET)
                self.wait(lambda r: not r.after.needs_reset and not _remembers(r), 0.5)
                self.hand.press(Button.ARM)
            self.wait(lambda r: r.after.armed and not r.after.latch, 1.0)
        raise TrialError(f"the chair does not arm within {ARM_S:g} s: {self.why()}")

    def drive(self, command: Command = Command.FRONT, seconds: float = 20.0) -> Record:
        """Arm if need be, hold the command, and wait until it moves that way. Raises TrialError."""
        end = time.monotonic() + seconds
        while True:
            self.arm()
            self.hand.hold(command)
            found = self.wait(lambda r: moves(told(r), command), min(5.0, seconds))
            if found is not None:
                return found
            if time.monotonic() > end:
                raise TrialError(f"'{command}' did not move the chair within {seconds:g} s: {self.why()}")

    def stand(self) -> None:
        """Let go, and wait until it stands."""
        self.hand.hold(None)
        self.wait(lambda r: told(r) == STILL and abs(r.facts.drive.speed_mm_s or 0.0) < MOVING_MM_S, 5.0)

    def pins(self) -> dict[str, float] | None:
        """The pins of a simulated controller; None without one."""
        path = self.run_dir / "pins"
        if not path.exists():
            return None
        state = SharedState.attach(path)
        try:
            return state.read()
        finally:
            state.close()

    def picture(self) -> bytes | None:
        """What the first lane with pictures shows now, as PNG."""
        for fd in self.supervisor.rings.values():
            reader = FrameReader(os.dup(fd))
            panes = reader.newest() or {}
            reader.close()
            for name in ("left", *panes):
                if name in panes:
                    return png(panes[name].image)
        return None


def told(record: Record) -> Motion:
    """What the drive was told."""
    return record.decision.motion if record.told is None else record.told


def moves(motion: Motion, command: Command) -> bool:
    """Is this a motion that the command asks for?"""
    match command:
        case Command.FRONT:
            return motion.drive_mm_s > MOVING_MM_S
        case Command.BACK | Command.REVERSE:
            return motion.drive_mm_s < -MOVING_MM_S
        case Command.LEFT:
            return motion.turn_deg_s > 1.0
        case _:
            return motion.turn_deg_s < -1.0


def _remembers(record: Record) -> bool:
    """Does rule 6 hold the chair for something that has vanished?"""
    return any(near.gone for near in record.after.near.values())


def _complete(record: Record) -> bool:
    """Every required vote is there."""
    return record.tick > 50 and not any(why.rule == "freshness" for why in record.decision.reasons)


def _start(it: Trial, tell: Callable[[str], None]) -> None:
    """Wait until every lane has spoken. Raises TrialError."""
    end = time.monotonic() + START_S
    while it.wait(_complete, TELL_S) is None:
        if it.over or time.monotonic() > end:
            raise TrialError(f"the chair did not start within {START_S:g} s: {it.awaited()}")
        tell(f"waiting for the chair to start: {it.awaited()}")


@contextmanager
def trial(plan: Plan, tell: Callable[[str], None] = lambda _: None) -> Iterator[Trial]:
    """Start the chair, wait until every lane has spoken, and end it all. tell: what it waits for, every few seconds.

    Raises TrialError.
    """
    run_dir = Path(tempfile.mkdtemp(prefix="chairward-check-"))
    with hand(run_dir) as the_hand:
        whole = on_trial(plan)
        it = Trial(whole, run_dir, Supervisor(whole, run_dir, lambda _: None), the_hand)
        it.supervisor.on_record = it.took

        def work() -> None:
            try:
                it.supervisor.run()
            except Exception as error:  # noqa: BLE001 - whatever it is, the waiting check ends with it
                it.error = error
            it.over = True
            with it.changed:
                it.changed.notify_all()

        thread = threading.Thread(target=work, name="supervisor")
        thread.start()
        try:
            _start(it, tell)
            yield it
        finally:
            it.supervisor.stop("the check is over")
            thread.join(60.0)
            shutil.rmtree(run_dir, ignore_errors=True)

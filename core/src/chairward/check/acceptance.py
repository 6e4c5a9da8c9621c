"""The acceptance run of a chair, wheels off the ground: everything that has to be true before somebody sits in it.

Each step makes one thing happen and says what it found, beside what is allowed. A step that cannot be made says why; it
has then failed. The chair is the whole chair, with its own guard, lanes and drive; only the hand is the check's.
"""

from __future__ import annotations

import os
import signal
import time
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field, replace

from chairward.check.judges import Judge
from chairward.check.result import Result, curve, timed
from chairward.check.stimulus import Stimulus
from chairward.check.timing import Timing, measure
from chairward.check.trial import HAND, Trial, TrialError, moves, told
from chairward.components import STILL
from chairward.facts import MS
from chairward.messages import Button, Command, Way
from chairward.records import Record

WAYS = (Command.FRONT, Command.BACK, Command.LEFT, Command.RIGHT)
CLEAR_MM, FAR_MM = 1500.0, 4000.0
WRONG_BY_MM = 150.0
"""A distance that is placed by hand, or stood at by a simulated person, and is seen, may differ by so much."""
LOOK_S = 15.0
SIGN_S = 0.6
FULL_S = 2.0
"""Within so long every chair has its full speed."""
ATTEMPTS = 4
MACHINE_MS = 150.0
"""Of a computer that has other things to do: granted to every step that is timed beside the chair's own limits."""


@dataclass(slots=True)
class Acceptance:
    """The steps of one chair, in order."""

    chair: Trial
    judge: Judge
    stimulus: Stimulus
    distances_mm: Sequence[float] = (500.0, 700.0, 1000.0)
    times: int = 10
    watchdog_ms: int = 200
    timing: Timing | None = None
    _from: int = field(default=0)

    def steps(self) -> list[tuple[str, Callable[[], Result]]]:
        """Name and step. The last ends the run: it kills the guard."""
        lanes = [lane.name for lane in self.chair.plan.lanes if lane.name != HAND]
        found: list[tuple[str, Callable[[], Result]]] = [("not armed", self._not_armed)]
        found += [(f"sign: {way}", lambda way=way: self._sign(way)) for way in WAYS]  # type: ignore[misc]
        found += [(f"cap: {way}", lambda way=way: self._cap(way)) for way in WAYS]  # type: ignore[misc]
        found += [
            (f"obstacle at {mm:g} mm", lambda mm=mm: self._obstacle(mm))  # type: ignore[misc]
            for mm in self.distances_mm
        ]
        devices = self.judge.stop_devices(self.chair)
        found += [(f"stop device: {name}", lambda name=name: self._stop_pressed(name)) for name in devices]  # type: ignore[misc]
        found += [("hand lost", self._hand_lost)]
        found += [(f"unplugged: {name}", lambda name=name: self._unplugged(name)) for name in lanes]  # type: ignore[misc]
        found += [(f"killed: lane {name}", lambda name=name: self._killed(name)) for name in lanes]  # type: ignore[misc]
        return [*found, ("reaction", self._reaction), ("killed: guard", self._guard)]

    def run(self, only: Sequence[str] = ()) -> Iterator[Result]:
        """One result a step; only: those whose names begin so. Raises TrialError where none does."""
        steps = self.steps()
        for wanted in only:
            if not any(name.startswith(wanted) for name, _ in steps):
                raise TrialError(f"no step begins with '{wanted}'; there are: {', '.join(name for name, _ in steps)}")
        for name, step in steps:
            if only and not name.startswith(tuple(only)):
                continue
            last = self.chair.last
            self._from = last.tick if last is not None else 0
            try:
                result = step()
            except TrialError as error:
                result = Result(name, False, str(error))
            turns = name.endswith((Command.LEFT, Command.RIGHT))
            yield replace(result, step=name, curve=curve(self._since(), turns=turns))

    # ---- steps --------------------------------------------------------------------------------------------------

    def _not_armed(self) -> Result:
        """Before ARM nothing moves, whatever is asked."""
        self.chair.hand.hold(Command.FRONT)
        moved = self.chair.wait(lambda r: told(r) != STILL, 1.5)
        self.chair.hand.hold(None)
        return Result("", moved is None, "stands" if moved is None else f"told {told(moved)}", "stands")

    def _sign(self, way: Command) -> Result:
        """Each way is that way."""
        self._drives_on(way, SIGN_S)
        seen = self.judge.turns(self.chair, way)
        found = seen or f"nothing turns; {self.chair.why()}"
        self.chair.stand()
        return Result("", seen == way, found, way)

    def _cap(self, way: Command) -> Result:
        """The way's speed is reached, and never passed."""
        self._drives_on(way, FULL_S)
        self.chair.stand()
        limits, index = self.chair.plan.limits, list(WAYS).index(way)
        cap = min(limits.caps[index], (limits.forward_mm_s, limits.backward_mm_s, *(limits.turn_deg_s,) * 2)[index])
        most = max(self._speed(record, index) for record in self._since())
        reached = most > 0.5 * min(cap, self._unseen(index))
        unit = "mm/s" if index < 2 else "deg/s"
        return Result("", reached and most <= cap + 1e-6, f"{most:.1f} {unit}", f"at most {cap:g} {unit}")

    def _drives_on(self, way: Command, seconds: float) -> None:
        """Drive that way for so long; once more where a short gap of a busy computer has stopped the chair before."""
        for _ in range(ATTEMPTS):
            self.chair.drive(way)
            if self.chair.wait(lambda r: not moves(told(r), way), seconds) is None:
                return

    def _unseen(self, index: int) -> float:
        """What a way that no sensor watches may do at most."""
        watched = {w for need in self.chair.plan.limits.sensors.values() for w in need.covers}
        return float("inf") if tuple(Way)[index] in watched else self.chair.plan.limits.unseen[index]

    @staticmethod
    def _speed(record: Record, index: int) -> float:
        drive, turn = told(record)
        return (drive, -drive, turn, -turn)[index]

    def _obstacle(self, distance_mm: float) -> Result:
        """Seen where it was placed; nearer than stop_mm it closes the way, nearer than avoid_mm it slows the chair."""
        limits = self.chair.plan.limits
        closes = distance_mm <= limits.stop_mm
        stop = Result("", True, "")
        if closes:
            stop = self._appears(distance_mm)
        else:
            self.judge.place(distance_mm)
        try:
            self.chair.stand()
            seen = self.chair.wait(lambda r: _near(r, distance_mm), LOOK_S)
            picture = self.chair.picture()
            if seen is None:
                last = self.chair.last
                nearest = last.decision.nearest_mm if last is not None else None
                found = f"seen at {nearest} mm; {self.chair.why()}"
                return Result("", False, found, f"{distance_mm:g} mm", picture=picture)
            self.chair.arm()
            self.chair.hand.hold(Command.FRONT)
            self.chair.wait(_never, 1.5)
            most = max(told(record).drive_mm_s for record in self._since()[-60:])
            self.chair.stand()
        finally:
            self.judge.clear()
            self._forget()
        nearest = seen.decision.nearest_mm or 0
        least, largest = distance_mm - WRONG_BY_MM, distance_mm + WRONG_BY_MM
        allowed = limits.caps.forward_mm_s if distance_mm > limits.avoid_mm else limits.avoid_mm_s
        allowed = 0.0 if closes else allowed
        right = most <= allowed + 1e-6 and least <= nearest <= largest
        return Result(
            "",
            right and stop.ok,
            f"{stop.found}seen at {nearest} mm, then at most {most:.0f} mm/s",
            f"{stop.allowed}{distance_mm:g} mm ± {WRONG_BY_MM:g}, at most {allowed:g} mm/s",
            picture=picture,
            late=right and stop.late,
        )

    def _appears(self, distance_mm: float) -> Result:
        """At full speed something appears there: when the drive was told to stand, and when it stood, within what the
        proof of distances reckons with. Told as the beginning of what `_obstacle` tells.

        Nobody knows when a person has put it there: then it counts from the newest picture that made the chair stop.
        """
        self.chair.drive()
        self.chair.wait(_never, FULL_S)
        driving = self.chair.drive()  # a gap of a busy computer may have stopped it
        placed_ns = time.monotonic_ns()
        self.judge.place(distance_mm, driving=True)
        stopped = self.chair.must(lambda r: told(r) == STILL, "a stop", 5.0, placed_ns)
        told_ns = stopped.wrote_ns
        if not self.judge.timed:
            placed_ns = max([window[-1].captured_ns for window in stopped.facts.ranges.values()], default=placed_ns)
        stands = self.chair.must(lambda r: abs(r.facts.drive.speed_mm_s or 0.0) < 1.0, "standing", 5.0, told_ns)
        told_ms, stood_ms = ((at_ns - placed_ns) / MS for at_ns in (told_ns, stands.wrote_ns))
        limits = self.chair.plan.limits
        tells_ms = limits.reaction_s * 1000.0
        stands_ms = tells_ms + told(driving).drive_mm_s / limits.decel_mm_s2 * 1000.0
        return timed(
            True,
            told_ms <= tells_ms and stood_ms <= stands_ms,
            f"told to stop after {told_ms:.0f} ms, stood after {stood_ms:.0f} ms, ",
            f"told within {tells_ms:.0f} ms, standing within {stands_ms:.0f} ms, ",
        )

    def _forget(self) -> None:
        """What was near and was taken away is still there for rule 6, until somebody says that it is not."""
        self.chair.wait(lambda r: (r.decision.nearest_mm or FAR_MM) > CLEAR_MM, LOOK_S)
        self.chair.hand.press(Button.RESET)
        self.chair.wait(lambda r: not r.after.near, 2.0)

    def _stop_pressed(self, name: str) -> Result:
        """A stop device stops at once, and only RESET and ARM make the chair move again."""
        self.chair.drive()
        pressed_ns = time.monotonic_ns()
        self.judge.press_stop(self.chair, name)
        pressed = self.chair.must(lambda r: _presses_stop(r, name), f"STOP at '{name}'", 3.0, pressed_ns)
        stopped = self.chair.must(lambda r: told(r) == STILL, "a stop", 3.0, pressed_ns)
        again = self.chair.wait(lambda r: told(r) != STILL, 1.0)
        self.chair.stand()
        took = (stopped.wrote_ns - (pressed_ns if self.judge.timed else pressed.facts.now_ns)) / MS
        found = f"{took:.0f} ms, {'hard stop' if stopped.told_hard else 'no hard stop'}"
        return timed(
            again is None and stopped.told_hard,
            took <= MACHINE_MS,
            found if again is None else f"{found}, then it moved again",
            f"{MACHINE_MS:g} ms, latched",
        )

    def _hand_lost(self) -> Result:
        """Letting go of a held command stops the chair within its time."""
        self.chair.drive()
        let_go_ns = time.monotonic_ns()
        self.chair.hand.hold(None)
        stopped = self.chair.must(lambda r: told(r) == STILL, "a stop", 3.0, let_go_ns)
        took = (stopped.wrote_ns - let_go_ns) / MS
        allowed = self.chair.plan.limits.held_ns / MS + MACHINE_MS
        return timed(True, took <= allowed, f"{took:.0f} ms", f"{allowed:.0f} ms")

    def _unplugged(self, lane: str) -> Result:
        """A device that is gone stops the chair, by name; when it is there again, RESET and ARM let it drive."""
        self.chair.drive()
        gone_ns = time.monotonic_ns()
        self.judge.unplug(self.chair, lane)
        try:
            return self._silenced(lane, gone_ns, by_age=not self.judge.timed)
        finally:
            self.judge.plug(self.chair, lane)
            self.chair.hand.hold(None)
            self.chair.wait(_all_there, 60.0)

    def _killed(self, lane: str) -> Result:
        """A process that is gone stops the chair, by name, and is started again."""
        self.chair.drive()
        process = self.chair.supervisor.lanes[lane].process
        gone_ns = time.monotonic_ns()
        os.killpg(process.pid, signal.SIGKILL)
        try:
            result = self._silenced(lane, gone_ns)
        finally:
            self.chair.hand.hold(None)
        back = self.chair.wait(_all_there, 60.0)
        if back is None:
            return Result("", False, f"{result.found}, and it was not started again", result.allowed)
        return result

    def _silenced(self, lane: str, gone_ns: int, *, by_age: bool = False) -> Result:
        """How long until the drive was told to stand, and whether the culprit was named.

        by_age: a person took it away, nobody knows when: it counts from the last thing that the lane has said.
        """
        stopped = self.chair.must(lambda r: told(r) == STILL, "a stop", 5.0, gone_ns)
        facts = stopped.facts
        newest = {name: window[-1] for name, window in facts.ranges.items()} | {**facts.alive} | {**facts.vetoes}
        said = [report.captured_ns for name, report in newest.items() if name.partition("/")[0] == lane]
        took = (stopped.wrote_ns - (max(said) if by_age and said else gone_ns)) / MS
        plan = next(one for one in self.chair.plan.lanes if one.name == lane)
        allowed = plan.freshness_ns / MS + MACHINE_MS
        named = any(why.source.partition("/")[0] == lane for why in stopped.decision.reasons)
        named = named or lane in stopped.decision.latch
        found = f"{took:.0f} ms, {'named' if named else 'not named: ' + self.chair.why()}"
        return timed(named, took <= allowed, found, f"{allowed:.0f} ms, named")

    def _reaction(self) -> Result:
        """From glass to wire, within what the proof of distances reckons with."""
        try:
            self.timing = measure(self.chair, self.stimulus, self.times)
        finally:
            self.stimulus.close()
        allowed = self.chair.plan.limits.reaction_s * 1000.0
        return timed(True, self.timing.longest_ms <= allowed, str(self.timing), f"{allowed:.0f} ms")

    def _guard(self) -> Result:
        """The controller stops by itself when the guard is gone; this ends the run."""
        guard = self.chair.supervisor.up
        if guard is None:
            return Result("", False, "the guard has never said that it is up")
        self._drives_on(Command.FRONT, FULL_S)
        if self.judge.turns(self.chair, Command.FRONT) != Command.FRONT:
            return Result("", False, "the wheels did not turn before")
        gone = time.monotonic()
        os.kill(guard.pid, signal.SIGKILL)
        while (turning := self.judge.turns(self.chair, Command.FRONT)) and time.monotonic() - gone < 5.0:
            time.sleep(0.002)
        took = (time.monotonic() - gone) * 1000.0
        allowed = self.watchdog_ms + MACHINE_MS
        if not self.judge.timed:
            return Result("", not turning, turning or "the wheels stand", "the wheels stand")
        found = f"no drive at the wheels after {took:.0f} ms"
        return timed(not turning, took <= allowed, found, f"{allowed:.0f} ms")

    def _since(self) -> list[Record]:
        return [record for record in list(self.chair.records) if record.tick >= self._from]


def _near(record: Record, distance_mm: float) -> bool:
    nearest = record.decision.nearest_mm
    return nearest is not None and abs(nearest - distance_mm) <= WRONG_BY_MM


def _presses_stop(record: Record, name: str) -> bool:
    return any(pressed.button is Button.STOP and pressed.source == name for pressed in record.facts.pressed)


def _never(_: Record) -> bool:
    """Only let time pass."""
    return False


def _all_there(record: Record) -> bool:
    return not any(why.rule == "freshness" for why in record.decision.reasons) and not record.facts.lost

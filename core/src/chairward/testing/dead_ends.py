"""Random dead ends, driven: a chair drives in, is stopped, and must be told a way out that really leads out.

The person is simple: says "front" until stopped, then only what the decision names as open: some steps back, a turn,
on.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Sequence
from dataclasses import dataclass, field
from math import cos, hypot, pi, radians, sin
from random import Random

import numpy as np
from msgspec.structs import replace

from chairward.arbiter import decide
from chairward.facts import MS, Decision, Instruction, Limits, S, State, Wish
from chairward.messages import Command, DriveStatus, RangeReading, Way
from chairward.scene import WINDOW
from chairward.testing.dead_end_chair import CHAIRS, TICK_NS, Body, limits_of, reading
from chairward.testing.dead_end_place import REAR_MM, DeadEnd, Segments, box, some_dead_end
from chairward.testing.ride import START_NS, VOICE, healthy

FRAME_TICKS = 2
SENSING_NS = 80 * MS
OUT_AFTER_MM = 500.0
"""Out: no corner is left in the pocket, and the chair has driven forward so far since."""
NAMED_WITHIN_NS = 5 * S
PATIENCE_NS = 180 * S
SPEAKS_EVERY_NS = 700 * MS
PATIENT_FOR = 8
"""Words that came to nothing: after so many the person calls for help."""


@dataclass(slots=True)
class Person:
    """Says only words that the decision has named as open: back the way the chair came, a turn, on.

    Sits in the chair, so knows how far it has come and turned. Where a turn meets something it is turned back and the
    chair is backed on; after some words that came to nothing the person calls for help.
    """

    side: Way = Way.LEFT
    to_back_mm: float = 0.0
    turned: float = 0.0
    """Left is positive, since the chair was stopped."""
    undo: bool = False
    in_vain: int = 0
    last: Command | None = None

    def stopped(self, decision: Decision, came_mm: float) -> None:
        """The chair has stopped by itself, came_mm after it was told to go: a new try, on the recommended side."""
        self.side = Way.RIGHT if self.side is Way.LEFT else Way.LEFT
        if decision.instruction in (Instruction.TURN_LEFT, Instruction.TURN_RIGHT):
            self.side = Way.LEFT if decision.instruction is Instruction.TURN_LEFT else Way.RIGHT
        self.to_back_mm, self.turned, self.undo = came_mm, 0.0, False

    def word(self, decision: Decision, moved_mm: float, turned: float) -> Command | None:
        """The next word, None where no way is open. What the last one came to: moved_mm, turned (left positive)."""
        self.turned += turned
        if self.last is Command.BACK:
            self.to_back_mm -= moved_mm
        blocked = (self.last is Command.BACK and moved_mm < 100.0) or (
            self.last in (Command.LEFT, Command.RIGHT) and abs(turned) < radians(5)
        )
        self.in_vain += blocked
        if blocked:
            self.undo, self.to_back_mm = abs(self.turned) > radians(4), 0.0
        elif self.undo and abs(self.turned) <= radians(8):
            self.undo, self.to_back_mm = False, 900.0
        self.last = None if self.in_vain > PATIENT_FOR else self._choose(decision.open_ways, decision.nearest_mm or 0)
        return self.last

    def _choose(self, ways: Sequence[Way], nearest_mm: int) -> Command | None:
        turn = {Way.LEFT: Command.LEFT, Way.RIGHT: Command.RIGHT}
        if self.undo and (back := Way.RIGHT if self.turned > 0.0 else Way.LEFT) in ways:
            return turn[back]
        if Way.AHEAD in ways and abs(self.turned) >= radians(80) and nearest_mm >= 1_300:
            return Command.FRONT
        if self.to_back_mm > 0.0 and Way.BEHIND in ways:
            return Command.BACK
        other = Way.RIGHT if self.side is Way.LEFT else Way.LEFT
        for way in (self.side, other):
            if way in ways and abs(self.turned) < radians(300):
                return turn[way]
        if Way.BEHIND in ways:
            return Command.BACK
        return Command.FRONT if Way.AHEAD in ways else None


@dataclass(frozen=True, slots=True, kw_only=True)
class Outcome:
    """How it went: the longest time until a way was named after a stop, and whether it was out, or help was called."""

    stops: int
    stopped_by: str
    named_s: float
    out: bool
    helped: bool
    boxed_in: bool
    seconds: float
    words: int
    touched: int


@dataclass(slots=True)
class Escape:
    """One dead end. `run` drives in and out."""

    rng: Random
    chair: str
    place: DeadEnd = field(init=False)
    body: Body = field(init=False)
    limits: Limits = field(init=False)

    def __post_init__(self) -> None:
        self.place = some_dead_end(self.rng)
        self.limits = limits_of(CHAIRS[self.chair])
        x, y, heading = self.place.start
        self.body = Body(x=x, y=y, heading=heading)

    def run(self) -> Outcome:
        """Ride until out, until help is called, or until the person has no more patience (and calls for help)."""
        body, person = self.body, Person()
        state, now_ns = State(latch="", armed=True), START_NS
        windows: dict[str, tuple[RangeReading, ...]] = {}
        on_the_way: deque[tuple[int, str, RangeReading]] = deque()
        walls = self.place.walls
        solid = np.concatenate([walls, self.place.low])
        stops, words, seq, named_s, stopped_by = 0, 0, 0, 0.0, ""
        stood_ns = spoke_ns = now_ns
        ahead_mm, before = 0.0, (body.x, body.y, body.heading)
        command: Command | None = None
        while now_ns - START_NS < PATIENCE_NS:
            now_ns += TICK_NS
            if (now_ns - START_NS) // TICK_NS % FRAME_TICKS == 0:
                seq += 1
                for ranger in CHAIRS[self.chair]:
                    said = reading(ranger, body, self.place, walls, now_ns, seq)
                    on_the_way.append((now_ns + SENSING_NS, ranger.name, said))
            while on_the_way and on_the_way[0][0] <= now_ns:
                _, name, said = on_the_way.popleft()
                windows[name] = (*windows.get(name, ())[1 - WINDOW :], said)
            if not (body.speed or body.turn or state.wish or command) and seq > WINDOW and now_ns // TICK_NS % 4:
                continue  # nothing can happen now: the chair stands and nobody speaks
            if min(len(windows.get(ranger.name, ())) for ranger in CHAIRS[self.chair]) < WINDOW:
                continue  # nobody has looked yet
            heard = () if command is None else (Wish(source=VOICE, seq=words, at_ns=now_ns, command=command),)
            command = None
            drive = DriveStatus(
                at_ns=now_ns,
                linked=True,
                armed=True,
                speed_mm_s=body.speed,
                turn_deg_s=body.turn * 180.0 / pi,
            )
            facts = replace(healthy(self.limits, now_ns), ranges=dict(windows), drive=drive, heard=heard)
            state, decision = decide(state, facts, self.limits)
            body.step(decision.motion, solid, self.limits.decel_mm_s2)
            ahead_mm += max(0.0, body.speed) * TICK_NS / S
            if decision.protective_stop:
                stops += 1
                stopped_by = stopped_by or decision.reasons[0].rule
                person.stopped(decision, ahead_mm)
                stood_ns, ahead_mm = now_ns, 0.0
                if stops == 1 and len(self.place.behind):
                    walls = np.concatenate([walls, self._put_behind()])
                    solid = np.concatenate([walls, self.place.low])
            if stops and ahead_mm >= OUT_AFTER_MM and bool(np.all(body.corners()[:, 0] < 0.0)):
                return self._came(stops, stopped_by, named_s, now_ns, words, out=True)
            if body.speed or body.turn or state.wish or now_ns - max(spoke_ns, stood_ns) < SPEAKS_EVERY_NS:
                continue
            if not stops and Way.AHEAD in decision.open_ways:
                command = Command.FRONT
            else:
                if not stops:  # the way has closed between two words
                    stops, stopped_by, stood_ns = 1, decision.reasons[0].rule, now_ns
                    person.stopped(decision, ahead_mm)
                    ahead_mm = 0.0
                moved = hypot(body.x - before[0], body.y - before[1])
                command = person.word(decision, moved, body.heading - before[2])
            if command is None:
                if now_ns - stood_ns > NAMED_WITHIN_NS:
                    break
                continue
            named_s = max(named_s, (now_ns - stood_ns) / S if stops else 0.0)
            before = (body.x, body.y, body.heading)
            spoke_ns, words = now_ns, words + 1
            stood_ns = now_ns
        helped = self._help(state, now_ns)
        return self._came(stops, stopped_by, named_s, now_ns, words, out=False, helped=helped)

    def _put_behind(self) -> Segments:
        """A box across the way back."""
        gap = REAR_MM + self.rng.uniform(80, 900)
        x, y = self.body.x - gap * cos(self.body.heading) - 60, self.body.y - gap * sin(self.body.heading)
        return np.array(box(x, y, 50, self.place.width_mm / 2))

    def _help(self, state: State, now_ns: int) -> bool:
        """The call for help is heard, whatever the chair is in."""
        wish = Wish(source=VOICE, seq=9_999, at_ns=now_ns, command=Command.HELP)
        return decide(state, replace(healthy(self.limits, now_ns), heard=(wish,)), self.limits)[1].help

    def _came(
        self, stops: int, stopped_by: str, named_s: float, now_ns: int, words: int, *, out: bool, helped: bool = False
    ) -> Outcome:
        return Outcome(
            stops=stops,
            stopped_by=stopped_by,
            named_s=round(named_s, 2),
            out=out,
            helped=helped,
            boxed_in=bool(len(self.place.behind)),
            seconds=round((now_ns - START_NS) / S, 1),
            words=words,
            touched=self.body.touched,
        )

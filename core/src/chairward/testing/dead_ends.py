"""Random dead ends, without pictures: a chair drives in, is stopped, and must be told a way out that really leads out.

A room with a pocket; walls are segments, sensors are rays, the chair follows the decisions with its delays. The person
is simple: says "front" until stopped, then only what the decision names as open: some steps back, a turn, on. Distances
mm, angles rad in here; the pocket lies along +x from its mouth at x = 0.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from math import cos, hypot, inf, pi, radians, sin
from random import Random
from typing import Any

import numpy as np
from numpy.typing import NDArray

from chairward.arbiter import decide
from chairward.components import STILL, Motion
from chairward.envelope import Caps
from chairward.facts import MS, Decision, Instruction, Limits, S, SourceLimits, State, Wish
from chairward.messages import Command, DriveStatus, RangeReading, Way
from chairward.scene import WINDOW
from chairward.testing.ride import AHEAD_AND_SIDES, START_NS, VOICE, chair_limits, healthy

FRONT_MM, REAR_MM, HALF_MM = 450.0, 450.0, 300.0
CORNERS = np.array([(FRONT_MM, HALF_MM), (FRONT_MM, -HALF_MM), (-REAR_MM, -HALF_MM), (-REAR_MM, HALF_MM)])
MARGIN_MM = 50.0
FAR_MM = 5_000
TICK_NS = 40 * MS
"""Between two decisions; a guard takes 20 ms at most."""
FRAME_TICKS = 2
SENSING_NS = 80 * MS
ACTING_TICKS = 2
OUT_AFTER_MM = 500.0
"""Out: no corner is left in the pocket, and the chair has driven forward so far since."""
NAMED_WITHIN_NS = 5 * S
PATIENCE_NS = 180 * S
SPEAKS_EVERY_NS = 700 * MS
PATIENT_FOR = 8
"""Words that came to nothing: after so many the person calls for help."""

Segments = NDArray[np.float64]
"""(n, 4): x1, y1, x2, y2."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Ranger:
    """A sensor: where it sits, which way it looks, how wide, and the ways the chair file declares for it."""

    name: str
    x_mm: float
    y_mm: float
    yaw: float
    half_view: float
    covers: frozenset[Way]


RAYS = np.linspace(-1.0, 1.0, 31)
CAMERA = Ranger(name="front/range", x_mm=FRONT_MM, y_mm=0.0, yaw=0.0, half_view=radians(40), covers=AHEAD_AND_SIDES)
REAR = Ranger(name="rear/sonar", x_mm=-REAR_MM, y_mm=0.0, yaw=pi, half_view=radians(60), covers=frozenset({Way.BEHIND}))
SIDES = tuple(
    Ranger(name=f"{way}/sonar", x_mm=0.0, y_mm=y, yaw=yaw, half_view=radians(75), covers=frozenset({way}))
    for way, y, yaw in ((Way.LEFT, HALF_MM, pi / 2), (Way.RIGHT, -HALF_MM, -pi / 2))
)
CHAIRS: dict[str, tuple[Ranger, ...]] = {"camera": (CAMERA,), "all round": (CAMERA, REAR, *SIDES)}
"""What the simulated chair of the shipped profile has, and a chair with sonars all round."""


def limits_of(rangers: Sequence[Ranger]) -> Limits:
    """The shipped speeds; a way that no sensor watches is slow."""
    toe_deg_s = 150.0 / hypot(FRONT_MM, HALF_MM) / pi * 180.0
    return chair_limits(
        sensors={r.name: SourceLimits(freshness_ns=200 * MS, covers=r.covers) for r in rangers},
        caps=Caps(500.0, 150.0, 20.0, 20.0),
        unseen=Caps(0.0, 150.0, toe_deg_s, toe_deg_s),
    )


# ---- the world ------------------------------------------------------------------------------------------------------
@dataclass(frozen=True, slots=True, kw_only=True)
class DeadEnd:
    """walls: everything solid. low: the walls that the camera loses nearer than lost_mm (they are under its view).

    plain_mm: the camera is blind to whatever is nearer than this (no texture); 0: it sees everything.
    behind: walls that appear behind the chair once it was stopped (somebody has put something there).
    """

    walls: Segments
    low: Segments
    lost_mm: float
    plain_mm: float
    behind: Segments
    length_mm: float
    width_mm: float
    start: tuple[float, float, float]


def box(x: float, y: float, half_x: float, half_y: float) -> list[tuple[float, float, float, float]]:
    """Four walls."""
    a, b, c, d = x - half_x, y - half_y, x + half_x, y + half_y
    return [(a, b, c, b), (c, b, c, d), (c, d, a, d), (a, d, a, b)]


def some_dead_end(rng: Random) -> DeadEnd:
    """A pocket of 0.9 to 2.4 m width and 1.2 to 4.5 m length with things in it, off a room of 5 m."""
    width, length = rng.uniform(900, 2_400), rng.uniform(1_200, 4_500)
    slant = rng.uniform(-400, 400)
    w, room = width / 2, 2_500.0
    walls = [
        (0.0, w, length + slant, w),
        (0.0, -w, length - slant, -w),
        (length + slant, w, length - slant, -w),
        (0.0, w, 0.0, room),
        (0.0, -w, 0.0, -room),
        (-2 * room, room, 0.0, room),
        (-2 * room, -room, 0.0, -room),
        (-2 * room, -room, -2 * room, room),
    ]
    if width > 1_500 and rng.random() < 0.6:  # something beside the way in, inside the pocket
        side = rng.choice((-1, 1))
        walls += box(rng.uniform(500, length - 300), side * (w - 150), 150, 150)
    for _ in range(rng.choice((0, 1, 2))):  # furniture in the room, off the way in
        walls += box(rng.uniform(-4_200, -2_400), rng.choice((-1, 1)) * rng.uniform(1_300, 2_000), 250, 250)
    low: list[tuple[float, float, float, float]] = []
    if rng.random() < 0.25:
        low = box(rng.uniform(0.5, 0.9) * length, 0.0, 100, w * 0.8)
    behind = [(0.0, 0.0, 0.0, 0.0)]  # replaced where the chair stops
    return DeadEnd(
        walls=np.array(walls),
        low=np.array(low).reshape(-1, 4),
        lost_mm=rng.uniform(620, 780),
        plain_mm=rng.choice((0.0, 0.0, 0.0, 700.0, 900.0)),
        behind=np.array(behind if rng.random() < 0.05 else []).reshape(-1, 4),
        length_mm=length,
        width_mm=width,
        start=(-1_400.0, rng.uniform(-0.3, 0.3) * max(0.0, w - HALF_MM - MARGIN_MM), radians(rng.uniform(-4, 4))),
    )


def rays(segments: Segments, x: float, y: float, angles: NDArray[np.float64]) -> NDArray[np.float64]:
    """How far each ray from (x, y) goes until it meets a segment, mm; inf where it meets none."""
    if not len(segments):
        return np.full(len(angles), inf)
    dx, dy = np.cos(angles)[:, None], np.sin(angles)[:, None]
    ax, ay = segments[:, 0] - x, segments[:, 1] - y
    ex, ey = segments[:, 2] - segments[:, 0], segments[:, 3] - segments[:, 1]
    cross = dx * ey - dy * ex
    with np.errstate(divide="ignore", invalid="ignore"):
        along = (ax * ey - ay * ex) / cross
        where = (ax * dy - ay * dx) / cross
    hit = (along > 0.0) & (where >= 0.0) & (where <= 1.0)
    return np.asarray(np.where(hit, along, inf).min(axis=1))


def touches(segments: Segments, x: float, y: float, heading: float) -> bool:
    """Whether the footprint meets a wall: clip each segment against the rectangle, in the chair's frame."""
    c, s = cos(heading), sin(heading)
    ends = segments.reshape(-1, 2) - (x, y)
    local = np.stack([ends[:, 0] * c + ends[:, 1] * s, -ends[:, 0] * s + ends[:, 1] * c], axis=1).reshape(-1, 2, 2)
    start, way = local[:, 0], local[:, 1] - local[:, 0]
    low, high = np.array([-REAR_MM, -HALF_MM]), np.array([FRONT_MM, HALF_MM])
    with np.errstate(divide="ignore", invalid="ignore"):
        t1, t2 = (low - start) / way, (high - start) / way
    inside = (start >= low) & (start <= high)
    enter = np.where(way == 0.0, np.where(inside, -inf, inf), np.minimum(t1, t2)).max(axis=1)
    leave = np.where(way == 0.0, np.where(inside, inf, -inf), np.maximum(t1, t2)).min(axis=1)
    return bool(np.any((enter <= leave) & (leave >= 0.0) & (enter <= 1.0)))


# ---- the chair ------------------------------------------------------------------------------------------------------
@dataclass(slots=True, kw_only=True)
class Body:
    """Where the chair is and how it moves; it follows a command after a few ticks, and stands where it meets a wall."""

    x: float
    y: float
    heading: float
    speed: float = 0.0
    turn: float = 0.0
    touched: int = 0
    _coming: deque[Motion] = field(default_factory=lambda: deque([STILL] * ACTING_TICKS))

    def step(self, motion: Motion, walls: Segments, decel_mm_s2: float) -> None:
        """One tick."""
        self._coming.append(motion)
        wanted, dt = self._coming.popleft(), TICK_NS / S
        most = decel_mm_s2 * dt
        self.speed = max(self.speed - most, min(self.speed + most, wanted.drive_mm_s))
        self.turn = radians(wanted.turn_deg_s)
        if not self.speed and not self.turn:
            return
        heading = self.heading + self.turn * dt
        x, y = self.x + self.speed * cos(heading) * dt, self.y + self.speed * sin(heading) * dt
        if touches(walls, x, y, heading):
            self.touched += 1
            self.speed = self.turn = 0.0
        else:
            self.x, self.y, self.heading = x, y, heading

    def corners(self) -> NDArray[np.float64]:
        """Of the footprint, in the world."""
        c, s = cos(self.heading), sin(self.heading)
        return np.asarray(CORNERS @ np.array([[c, s], [-s, c]]) + (self.x, self.y))


def reading(ranger: Ranger, body: Body, place: DeadEnd, walls: Segments, now_ns: int, seq: int) -> RangeReading:
    """What that sensor says now: the nearest point each way, from the footprint's outline."""
    c, s = cos(body.heading), sin(body.heading)
    x, y = body.x + ranger.x_mm * c - ranger.y_mm * s, body.y + ranger.x_mm * s + ranger.y_mm * c
    angles = ranger.yaw + ranger.half_view * RAYS
    camera = Way.AHEAD in ranger.covers
    far = rays(np.concatenate([walls, place.low]) if not camera else walls, x, y, angles + body.heading)
    if camera:
        low = rays(place.low, x, y, angles + body.heading)
        far = np.minimum(far, np.where(low < place.lost_mm, inf, low))
    px, py = ranger.x_mm + far * np.cos(angles), ranger.y_mm + far * np.sin(angles)
    beyond = np.maximum(np.maximum(px - FRONT_MM, -REAR_MM - px), 0.0)
    beside = np.maximum(np.abs(py) - HALF_MM, 0.0)
    before = np.abs(py) <= HALF_MM + MARGIN_MM
    away = np.hypot(beyond, beside)
    ways: dict[Way, NDArray[np.bool_]] = {
        Way.AHEAD: before & (px > FRONT_MM),
        Way.BEHIND: before & (px < -REAR_MM),
        Way.LEFT: ~before & (py > 0.0),
        Way.RIGHT: ~before & (py < 0.0),
    }
    said = {way: int(min(FAR_MM, np.min(away[ways[way]], initial=FAR_MM))) for way in ranger.covers}
    if camera and said[Way.AHEAD] < place.plain_mm:
        return RangeReading(seq=seq, captured_ns=now_ns, can_see=False, reason="plain wall")
    fields: dict[str, Any] = {f"{way}_mm": mm for way, mm in said.items()}
    return RangeReading(seq=seq, captured_ns=now_ns, can_see=True, **fields)


# ---- the person -----------------------------------------------------------------------------------------------------
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


# ---- in and out -----------------------------------------------------------------------------------------------------
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

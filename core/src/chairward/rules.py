"""The safety rules: small pure functions, each from a scene to votes. A rule can only take away.

A vote that is not there takes nothing, so every rule here is written to be *lifted* by evidence, never granted by it:
what a way may do at most comes from the chair file (rule 10), and each fact can only make that less.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from itertools import chain
from math import inf
from typing import NamedTuple

from chairward.envelope import CLOSED, OPEN, Caps, Envelope, Grip
from chairward.facts import MS, Facts, Limits, State
from chairward.messages import NOTHING_NEAR_MM, RangeReading, Way
from chairward.stopping import largest_speed_mm_s, stopping_distance_mm

FUTURE_LIMIT_NS = 5 * MS
WINDOW = 3
CREEP_MM_S = 60.0
CREEP_ROOM_MM = 100.0
RUNAWAY_ROOM_MM = 150.0
SUPERVISOR = "supervisor"
WAYS = (Way.AHEAD, Way.BEHIND, Way.LEFT, Way.RIGHT)
"""In the order of Caps."""
ALL_WAYS = frozenset(WAYS)
NO_FORWARD, NO_BACKWARD, NO_LEFT, NO_RIGHT = (OPEN._replace(**{field: 0.0}) for field in Caps._fields)

Votes = Iterator[Envelope]


class Seen(NamedTuple):
    """One sensor's last three readings, boiled down: the nearest each way (inf: says nothing) is the whole debounce.

    Stop on any one of three, release on three of three. blind: how many of them could not see.
    closing_mm_s: the fastest of them. left, right_mm: the sides, for steering.
    """

    source: str
    ahead_mm: float
    behind_mm: float
    left_mm: float
    right_mm: float
    closing_mm_s: int
    blind: int
    reason: str


class Scene(NamedTuple):
    """All that a rule may look at."""

    facts: Facts
    state: State
    limits: Limits
    seen: tuple[Seen, ...]


def look(facts: Facts, state: State, limits: Limits) -> Scene:
    """The scene, with each sensor's readings boiled down once."""
    return Scene(facts, state, limits, tuple(boil(name, window) for name, window in facts.ranges.items() if window))


def boil(name: str, window: tuple[RangeReading, ...]) -> Seen:
    """The nearest of the last readings, each way."""
    ahead = behind = left = right = inf
    closing = blind = 0
    reason = ""
    for r in window:
        if r.ahead_mm is not None and r.ahead_mm < ahead:
            ahead = r.ahead_mm
        if r.behind_mm is not None and r.behind_mm < behind:
            behind = r.behind_mm
        if r.left_mm is not None and r.left_mm < left:
            left = r.left_mm
        if r.right_mm is not None and r.right_mm < right:
            right = r.right_mm
        if r.closing_mm_s > closing:
            closing = r.closing_mm_s
        if not r.can_see:
            blind += 1
            reason = r.reason
    return Seen(name, ahead, behind, left, right, closing, blind, reason)


def lane(source: str) -> str:
    """The lane of a source: stages of one lane share a device and fall silent together."""
    return source.partition("/")[0]


# 1 -----------------------------------------------------------------------------------------------------------------
def freshness(scene: Scene) -> Votes:
    """Silence stops (P1): every required vote must be fresh and well, or all ways are closed.

    Required: each sensor (three recent readings, for fewer must not allow more than three), each vetoing plugin, each
    recognizer's and stop device's heartbeat, the controller, the supervisor, and the guard's own clock.
    A short gap lets the wish wait; one longer than latch_after_ns latches. What is not in the chair file has no
    freshness limit, so it can only close. Source: nav2 and twist_mux keep silent when their input dies.
    """
    facts, _, limits, _ = scene
    for name, need in limits.sensors.items():
        window = facts.ranges.get(name, ())
        late = _late(scene, name, window[-1].captured_ns if window else 0, need.freshness_ns)
        if late:
            yield late
        elif len(window) < WINDOW or facts.now_ns - window[0].captured_ns > WINDOW * need.freshness_ns:
            yield Envelope(CLOSED, "freshness", name, "fewer than three recent readings", Grip.WAITS)
    for name, need in limits.vetoers.items():
        veto = facts.vetoes.get(name)
        late = _late(scene, name, veto.captured_ns if veto else 0, need.freshness_ns)
        if late:
            yield late
    for group in (limits.recognizers, limits.stop_devices):
        for name, need in group.items():
            alive = facts.alive.get(name)
            late = _late(scene, name, alive.captured_ns if alive else 0, need.freshness_ns)
            if late:
                yield late
            elif alive and not alive.well:
                yield Envelope(CLOSED, "freshness", name, alive.reason or "is not well")
    for late in (
        _late(scene, "drive", facts.drive.at_ns, limits.drive_freshness_ns),
        _late(scene, SUPERVISOR, facts.supervisor_ns, limits.supervisor_freshness_ns),
    ):
        if late:
            yield late
    if facts.lost:
        required = {SUPERVISOR, *map(lane, _required(limits))}
        for name, sentence in facts.lost.items():
            if lane(name) in required:
                yield Envelope(CLOSED, "freshness", name, sentence, Grip.WAITS)
    for name in (facts.ranges.keys() - limits.sensors.keys()) | (facts.vetoes.keys() - limits.vetoers.keys()):
        yield Envelope(CLOSED, "freshness", name, "is not a sensor of the chair file")
    if facts.gap_ns > limits.gap_limit_ns:
        yield Envelope(CLOSED, "freshness", "guard", f"its clock jumped by {facts.gap_ns // MS} ms", Grip.LATCHES)


def _required(limits: Limits) -> Iterator[str]:
    return chain(limits.sensors, limits.vetoers, limits.recognizers, limits.stop_devices)


def _late(scene: Scene, name: str, at_ns: int, freshness_ns: int) -> Envelope | None:
    """A closing vote when `name` last said something too long ago (or, impossibly, in the future)."""
    age_ns = scene.facts.now_ns - at_ns
    if -FUTURE_LIMIT_NS <= age_ns <= freshness_ns and at_ns:
        return None
    why = f"silent for {age_ns // MS} ms" if at_ns else "has said nothing yet"
    if name in scene.facts.refused:
        why += f"; refused: {scene.facts.refused[name]}"
    gone = age_ns > max(freshness_ns, scene.limits.latch_after_ns) or not at_ns
    return Envelope(CLOSED, "freshness", name, why, Grip.LATCHES if gone else Grip.WAITS)


def veto(scene: Scene) -> Votes:
    """A plugin whose matter is neither range nor intent (tilt, battery, seat) asks for a stop; it spends the wish."""
    for name, said in scene.facts.vetoes.items():
        if said.stop:
            yield Envelope(CLOSED, "veto", name, said.reason)


# 2 -----------------------------------------------------------------------------------------------------------------
def stop_distance(scene: Scene) -> Votes:
    """Nearest <= stop_mm closes the way ahead, and behind; too near for the swinging corners closes a turn.

    Source: thesis section 5 (600 mm), with <= as the stricter reading.
    """
    stop, swing = scene.limits.stop_mm, scene.limits.turn_clear_mm
    for s in scene.seen:
        if s.ahead_mm <= stop:
            yield Envelope(NO_FORWARD, "stop_distance", s.source, f"{s.ahead_mm:.0f} mm ahead")
        if s.behind_mm <= stop:
            yield Envelope(NO_BACKWARD, "stop_distance", s.source, f"{s.behind_mm:.0f} mm behind")
        if min(s.left_mm, s.ahead_mm) <= swing:
            yield Envelope(NO_LEFT, "stop_distance", s.source, f"{min(s.left_mm, s.ahead_mm):.0f} mm left")
        if min(s.right_mm, s.ahead_mm) <= swing:
            yield Envelope(NO_RIGHT, "stop_distance", s.source, f"{min(s.right_mm, s.ahead_mm):.0f} mm right")


# 3 -----------------------------------------------------------------------------------------------------------------
def approach_speed(scene: Scene) -> Votes:
    """Only as fast as the chair can still stop *before stop_mm*, all delays included.

    room = nearest - stop_mm - closing speed * reaction; v such that v t + v^2 / 2a = room (see `stopping`).
    That curve alone never arrives (the speed falls with the room), so while there is room and nothing comes nearer
    the chair may creep at a speed whose own stopping distance is at most CREEP_ROOM_MM: it arrives, and the stop is
    declared, in bounded time. A chair that runs too fast to stop within that margin (reported or commanded, the
    larger) is stopped. Source: thesis section 9 wish "threshold follows the speed"; peers.md lesson 2.
    """
    facts, state, limits, seen = scene
    t, a = limits.reaction_s, limits.decel_mm_s2
    creep = min(CREEP_MM_S, largest_speed_mm_s(CREEP_ROOM_MM, t, a))
    reported = facts.drive.speed_mm_s or 0.0
    for s in seen:
        if s.ahead_mm < NOTHING_NEAR_MM:
            room = s.ahead_mm - limits.stop_mm - s.closing_mm_s * t
            speed = _speed(room, max(reported, state.output.drive_mm_s), creep, t, a)
            yield Envelope(OPEN._replace(forward_mm_s=speed), "approach_speed", s.source, f"{s.ahead_mm:.0f} mm ahead")
        if s.behind_mm < NOTHING_NEAR_MM:
            room = s.behind_mm - limits.stop_mm
            speed = _speed(room, -min(reported, state.output.drive_mm_s), creep, t, a)
            yield Envelope(
                OPEN._replace(backward_mm_s=speed), "approach_speed", s.source, f"{s.behind_mm:.0f} mm behind"
            )


def _speed(room_mm: float, present_mm_s: float, creep_mm_s: float, reaction_s: float, decel_mm_s2: float) -> float:
    if room_mm <= 0.0:
        return 0.0
    if present_mm_s > 0.0 and stopping_distance_mm(present_mm_s, reaction_s, decel_mm_s2) > room_mm + RUNAWAY_ROOM_MM:
        return 0.0
    return max(creep_mm_s, largest_speed_mm_s(room_mm, reaction_s, decel_mm_s2))


# 4 -----------------------------------------------------------------------------------------------------------------
def avoid(scene: Scene) -> Votes:
    """stop_mm < nearest <= avoid_mm: slowly, so that the person (or `steer`) can go round it. Thesis section 5."""
    limits = scene.limits
    for s in scene.seen:
        if limits.stop_mm < s.ahead_mm <= limits.avoid_mm:
            cap = OPEN._replace(forward_mm_s=limits.avoid_mm_s)
            yield Envelope(cap, "avoid", s.source, f"{s.ahead_mm:.0f} mm ahead")


def freer_side(scene: Scene) -> float:
    """+1 left, -1 right: the side that all sensors in the avoid zone sense clear and freer; 0 where they do not agree.

    Clear means farther than avoid_mm, by the very reading that raised `avoid`; a side not sensed is never clear.
    """
    limits = scene.limits
    sides = set()
    for s in scene.seen:
        if limits.stop_mm < s.ahead_mm <= limits.avoid_mm:
            left, right = (0.0 if d == inf else d for d in (s.left_mm, s.right_mm))
            clear = max(left, right) > limits.avoid_mm and left != right
            sides.add((1.0 if left > right else -1.0) if clear else 0.0)
    return sides.pop() if len(sides) == 1 else 0.0


# 5 -----------------------------------------------------------------------------------------------------------------
def blind(scene: Scene) -> Votes:
    """A sensor that cannot see opens nothing: the ways it covers count as uncovered (rule 10) until it sees again.

    Ahead the chair may crawl, if its file says so, as long as a sensor of another lane watches that way and sees.
    One or two blind pictures of three let the wish wait, three spend it. Plain walls *are* blind to stereo.
    """
    limits = scene.limits
    for s in scene.seen:
        if s.blind and s.source in limits.sensors:
            covers = limits.sensors[s.source].covers
            caps = _only(limits.unseen, covers)
            if Way.AHEAD in covers and any(_watches_ahead(scene, other, s.source) for other in scene.seen):
                caps = caps._replace(forward_mm_s=max(caps.forward_mm_s, limits.crawl_mm_s))
            grip = Grip.SPENDS if s.blind >= WINDOW else Grip.WAITS
            yield Envelope(caps, "blind", s.source, s.reason or "cannot see", grip)


def _watches_ahead(scene: Scene, other: Seen, blind_one: str) -> bool:
    need = scene.limits.sensors.get(other.source)
    return bool(need and Way.AHEAD in need.covers and not other.blind and lane(other.source) != lane(blind_one))


def _only(caps: Caps, ways: frozenset[Way]) -> Caps:
    """The caps of these ways; the others open."""
    return Caps(*(cap if way in ways else inf for way, cap in zip(WAYS, caps, strict=True)))


# 6 -----------------------------------------------------------------------------------------------------------------
def near_loss(scene: Scene) -> Votes:
    """What was near and vanished without receding is still there (under the camera's view): no way ahead.

    Lifted by backing off, by turning away, or by RESET at a standstill. The memory is kept by `remember`.
    """
    for name, near in scene.state.near.items():
        if near.gone:
            yield Envelope(
                NO_FORWARD, "near_loss", name, f"what was {near.distance_mm} mm ahead has vanished from view"
            )


# 7 -----------------------------------------------------------------------------------------------------------------
def lease(scene: Scene) -> Votes:
    """No live wish, no motion: every word is a lease, every held switch must keep repeating. Peers.md lesson 1."""
    if scene.state.wish is None:
        yield Envelope(CLOSED, "lease", "", "no wish is live: say a new word")


# 8 -----------------------------------------------------------------------------------------------------------------
def latch(scene: Scene) -> Votes:
    """After a fault or a pressed STOP nothing moves until RESET (faults only), then ARM, standing. ISO 13850."""
    if scene.state.latch:
        yield Envelope(CLOSED, "latch", "", scene.state.latch)


# 9 -----------------------------------------------------------------------------------------------------------------
def drive_health(scene: Scene) -> Votes:
    """The controller is linked, without fault, accepts motion, is not charging, and nobody stops it by its own input.

    Lost link, fault and a controller that disarmed by itself latch. Source: ISO 7176-14 7.2, 7.3, 8.9.
    """
    drive = scene.facts.drive
    if not drive.linked:
        yield Envelope(CLOSED, "drive_health", "drive", drive.fault or "the controller is not connected", Grip.LATCHES)
    elif drive.fault:
        yield Envelope(CLOSED, "drive_health", "drive", drive.fault, Grip.LATCHES)
    elif not drive.armed:
        grip = Grip.LATCHES if scene.state.armed else Grip.SPENDS
        why = "the controller no longer accepts motion" if scene.state.armed else "the controller is not armed yet"
        yield Envelope(CLOSED, "drive_health", "drive", why, grip)
    if drive.stopped_by_user:
        yield Envelope(CLOSED, "drive_health", "drive", "stopped at the controller or by its own joystick")
    if drive.charging:
        yield Envelope(CLOSED, "drive_health", "drive", "a charger is connected")


# 10 ----------------------------------------------------------------------------------------------------------------
def direction(scene: Scene) -> Votes:
    """What each way may do at most: the chair's caps, and less where the chair file declares no sensor to watch.

    Only declared coverage counts, never a live reading, so a sensor that appears opens nothing.
    """
    limits = scene.limits
    yield Envelope(limits.caps, "direction", "", "the chair's limit")
    covered = frozenset[Way]().union(*(need.covers for need in limits.sensors.values()))
    if len(covered) < len(WAYS):
        yield Envelope(_only(limits.unseen, ALL_WAYS - covered), "direction", "", "no sensor watches that way")


RULES: tuple[Callable[[Scene], Votes], ...] = (
    latch,
    drive_health,
    freshness,
    veto,
    stop_distance,
    near_loss,
    blind,
    approach_speed,
    avoid,
    direction,
    lease,
)
"""In the order in which their reasons are told to people."""

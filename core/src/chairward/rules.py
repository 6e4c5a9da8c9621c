"""The safety rules: small pure functions, each from a scene to votes. A rule can only take away.

What a way may do at most is in the chair file (rule 10); every fact can only make that less. So no rule grants
anything: it votes while it sees a reason, and a reason that is gone is a vote that is gone. Closing votes say how hard
they grip the wish: WAITS (a short gap), SPENDS (a protective stop), LATCHES (a fault).
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterator
from functools import lru_cache
from itertools import chain
from math import inf, isfinite, isinf

from chairward.envelope import CLOSED, OPEN, Caps, Envelope, Grip
from chairward.facts import MS, Limits
from chairward.messages import Way
from chairward.scene import WAYS, WINDOW, Scene, Seen, lane, reported
from chairward.stopping import approach_speed_mm_s, largest_speed_mm_s, stopping_distance_mm

FUTURE_LIMIT_NS = 5 * MS
CREEP_MM_S = 60.0
CREEP_ROOM_MM = 100.0
SUPERVISOR = "supervisor"
NO_FORWARD, NO_BACKWARD, NO_LEFT, NO_RIGHT = (OPEN._replace(**{way: 0.0}) for way in Caps._fields)
NO_TURN = Caps(left_deg_s=0.0, right_deg_s=0.0)

Votes = Iterator[Envelope]


# 1 -----------------------------------------------------------------------------------------------------------------
def freshness(scene: Scene) -> Votes:
    """Silence stops (P1): every required vote is fresh and well, or all ways are closed.

    Required: each sensor (three recent readings, for fewer must not allow more than three do), each vetoing plugin,
    each recognizer's and stop device's heartbeat, the controller, the supervisor, the guard's own clock. A short gap
    lets the wish wait; one longer than latch_after_ns latches. A source that the chair file does not know has no
    limit by which its silence could be told, so it only closes. Source: peers.md lessons 3 and 4.
    """
    facts, _, limits, _ = scene
    for name, need in limits.sensors.items():
        window = facts.ranges.get(name, ())
        if late := _late(scene, name, window[-1].captured_ns if window else 0, need.freshness_ns):
            yield late
        elif len(window) < WINDOW or facts.now_ns - window[0].captured_ns > WINDOW * need.freshness_ns:
            yield Envelope(CLOSED, "freshness", name, "fewer than three recent readings", Grip.WAITS)
    for name, need in limits.vetoers.items():
        veto_ = facts.vetoes.get(name)
        if late := _late(scene, name, veto_.captured_ns if veto_ else 0, need.freshness_ns):
            yield late
    for name, need in chain(limits.recognizers.items(), limits.stop_devices.items()):
        alive = facts.alive.get(name)
        if late := _late(scene, name, alive.captured_ns if alive else 0, need.freshness_ns):
            yield late
        elif alive and not alive.well:
            yield Envelope(CLOSED, "freshness", name, alive.reason or "is not well")
    if late := _late(scene, "drive", facts.drive.at_ns, limits.drive_freshness_ns):
        yield late
    if late := _late(scene, SUPERVISOR, facts.supervisor_ns, limits.supervisor_freshness_ns):
        yield late._replace(grip=Grip.LATCHES)  # nobody watches the other processes any more: a fault at once
    if facts.lost:
        required = {SUPERVISOR, *map(lane, _required(limits))}
        for name, sentence in facts.lost.items():
            if lane(name) in required:
                yield Envelope(CLOSED, "freshness", name, sentence, Grip.WAITS)
    for name in (*(facts.ranges.keys() - limits.sensors), *(facts.vetoes.keys() - limits.vetoers)):
        yield Envelope(CLOSED, "freshness", name, "is not a sensor of the chair file")
    if facts.gap_ns > limits.gap_limit_ns:
        yield Envelope(CLOSED, "freshness", "guard", f"its clock jumped by {facts.gap_ns // MS} ms", Grip.LATCHES)


def _required(limits: Limits) -> Iterator[str]:
    return chain(limits.sensors, limits.vetoers, limits.recognizers, limits.stop_devices)


def _late(scene: Scene, name: str, at_ns: int, freshness_ns: int) -> Envelope | None:
    """A closing vote when `name` last said something too long ago, or (impossibly) in the future."""
    age_ns = scene.facts.now_ns - at_ns
    if -FUTURE_LIMIT_NS <= age_ns <= freshness_ns and at_ns:
        return None
    why = f"silent for {age_ns // MS} ms" if at_ns else "has said nothing yet"
    if name in scene.facts.refused:
        why += f"; refused: {scene.facts.refused[name]}"
    long = age_ns > max(freshness_ns, scene.limits.latch_after_ns)
    return Envelope(CLOSED, "freshness", name, why, Grip.LATCHES if long else Grip.WAITS)


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
        if s.left_mm <= swing:
            yield Envelope(NO_LEFT, "stop_distance", s.source, f"{s.left_mm:.0f} mm left")
        if s.right_mm <= swing:
            yield Envelope(NO_RIGHT, "stop_distance", s.source, f"{s.right_mm:.0f} mm right")
        if s.ahead_mm <= swing:
            yield Envelope(NO_TURN, "stop_distance", s.source, f"{s.ahead_mm:.0f} mm ahead of the toes")


# 3 -----------------------------------------------------------------------------------------------------------------
def approach_speed(scene: Scene) -> Votes:
    """Only as fast as the chair can still stop *before stop_mm*, all delays and the other's approach included.

    The curve (`stopping.approach_speed_mm_s`) never arrives, for the speed falls with the room; so towards what stands
    the chair may creep, while there is room, at a speed whose own stopping distance is within CREEP_ROOM_MM: the stop
    is reached, and declared, in bounded time. A chair that reports to be too fast to stop in the room even by braking
    at once has to stop. Source: thesis wish "threshold follows the speed"; peers.md lesson 2; DESIGN rule 3.
    """
    facts, _, limits, seen = scene
    speed = reported(facts.drive).drive_mm_s
    brakes_in_mm = stopping_distance_mm(speed, 0.0, limits.decel_mm_s2)
    enough_ahead = max(brakes_in_mm, _enough_mm(limits.caps.forward_mm_s, limits))
    enough_behind = max(brakes_in_mm, _enough_mm(limits.caps.backward_mm_s, limits))
    for s in seen:
        room = s.ahead_mm - limits.stop_mm
        if room < enough_ahead or s.closing_mm_s:
            cap = _approach_mm_s(room, speed, s.closing_mm_s, limits)
            yield Envelope(Caps(cap, inf, inf, inf), "approach_speed", s.source, f"{s.ahead_mm:.0f} mm ahead")
        room = s.behind_mm - limits.stop_mm
        if room < enough_behind:
            cap = _approach_mm_s(room, -speed, 0.0, limits)
            yield Envelope(Caps(inf, cap, inf, inf), "approach_speed", s.source, f"{s.behind_mm:.0f} mm behind")


def _enough_mm(cap_mm_s: float, limits: Limits) -> float:
    """The room from which a thing that stands cannot slow the chair below its own cap."""
    t, a = limits.reaction_s, limits.decel_mm_s2
    return stopping_distance_mm(cap_mm_s, t, a) + a * t * t / 2.0


def _approach_mm_s(room_mm: float, speed_mm_s: float, closing_mm_s: float, limits: Limits) -> float:
    """The speed allowed towards something room_mm beyond stop_mm, for a chair that reports speed_mm_s towards it."""
    t, a = limits.reaction_s, limits.decel_mm_s2
    if room_mm <= 0.0 or (speed_mm_s > CREEP_MM_S and stopping_distance_mm(speed_mm_s, 0.0, a) > room_mm):
        return 0.0
    cap = approach_speed_mm_s(room_mm, closing_mm_s, t, a)
    return cap if closing_mm_s else max(cap, min(CREEP_MM_S, largest_speed_mm_s(CREEP_ROOM_MM, t, a)))


# 4 -----------------------------------------------------------------------------------------------------------------
def avoid(scene: Scene) -> Votes:
    """stop_mm < nearest <= avoid_mm: slowly, so that the person (or `steer`) can go round it. Thesis section 5."""
    limits = scene.limits
    for s in scene.seen:
        if limits.stop_mm < s.ahead_mm <= limits.avoid_mm:
            caps = Caps(limits.avoid_mm_s, inf, inf, inf)
            yield Envelope(caps, "avoid", s.source, f"{s.ahead_mm:.0f} mm ahead")


def freer_side(scene: Scene) -> float:
    """+1 left, -1 right: the side that all sensors in the avoid zone sense clear and freer; 0 where they do not agree.

    Clear means farther than avoid_mm, by the very reading that raised `avoid`; a side not sensed is never clear.
    """
    limits = scene.limits
    sides = set()
    for s in scene.seen:
        if limits.stop_mm < s.ahead_mm <= limits.avoid_mm:
            left, right = (0.0 if isinf(d) else d for d in (s.left_mm, s.right_mm))
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
    sees = not other.blind and isfinite(other.ahead_mm)
    return bool(need and Way.AHEAD in need.covers and sees and lane(other.source) != lane(blind_one))


@lru_cache
def _only(caps: Caps, ways: Collection[Way]) -> Caps:
    """The caps of these ways; the others open. Every decision asks, and mostly the same: hence the cache."""
    return Caps(*[cap if way in ways else inf for way, cap in zip(WAYS, caps, strict=True)])


# 6 -----------------------------------------------------------------------------------------------------------------
def near_loss(scene: Scene) -> Votes:
    """What was near and vanished without receding is still there (under the camera's view): no way ahead.

    Lifted by backing off, by turning away, or by RESET at a standstill; `memory` keeps count.
    """
    for name, near in scene.state.near.items():
        if near.gone:
            yield Envelope(
                NO_FORWARD, "near_loss", name, f"what was {near.distance_mm} mm ahead has vanished from view"
            )


# 7 -----------------------------------------------------------------------------------------------------------------
def lease(scene: Scene) -> Votes:
    """No live wish, no motion: every word is a lease, every held switch must keep repeating. Peers.md lesson 1.

    Not among RULES: what nobody asks for needs no veto, it is only a reason to tell. `wishes` lets the leases run out.
    """
    if scene.state.wish is None:
        yield Envelope(CLOSED, "lease", "", "no wish is live: say a new word")


# 8 -----------------------------------------------------------------------------------------------------------------
def latch(scene: Scene) -> Votes:
    """After a fault or a pressed STOP nothing moves until RESET (faults only), then ARM, standing. ISO 13850."""
    if scene.state.latch:
        yield Envelope(CLOSED, "latch", "", scene.state.latch)


# 9 -----------------------------------------------------------------------------------------------------------------
def drive_health(scene: Scene) -> Votes:
    """The controller is linked, faultless, accepts motion, does not charge, and nobody stops it by its own input.

    A link, health or acceptance that is lost *after* the controller had accepted motion latches; before that there is
    nothing to lose, and ARM may be what clears a controller's fault. Source: ISO 7176-14 7.2, 7.3, 8.3, 8.9.
    """
    drive = scene.facts.drive
    grip = Grip.LATCHES if scene.state.armed else Grip.SPENDS
    if not drive.linked:
        yield Envelope(CLOSED, "drive_health", "drive", drive.fault or "the controller is not connected", grip)
    elif drive.fault:
        yield Envelope(CLOSED, "drive_health", "drive", drive.fault, grip)
    elif not drive.armed:
        accepts = "no longer accepts motion" if scene.state.armed else "does not accept motion yet"
        yield Envelope(CLOSED, "drive_health", "drive", f"the controller {accepts}", grip)
    if drive.stopped_by_user:
        yield Envelope(CLOSED, "drive_health", "drive", "stopped at the controller or by its own joystick")
    if drive.charging:
        yield Envelope(CLOSED, "drive_health", "drive", "a charger is connected")


# 10 ----------------------------------------------------------------------------------------------------------------
def direction(scene: Scene) -> Votes:
    """What each way may do at most: the chair's caps, and less where the chair file declares no sensor to watch.

    Only declared coverage can open a way, never a live reading, so a sensor that appears opens nothing. And coverage
    that is declared but not lived up to is none: a way counts as watched only while a sensor that declares it says a
    distance there (a healthy reading that leaves a way out says nothing about it).
    """
    limits = scene.limits
    yield Envelope(limits.caps, "direction", "", "the chair's own limit")
    unwatched: Collection[Way] = WAYS
    for s in scene.seen:
        if need := limits.sensors.get(s.source):
            unwatched = [way for way in unwatched if way not in need.covers or isinf(s.mm(way))]
    if unwatched:
        yield Envelope(_only(limits.unseen, tuple(unwatched)), "direction", "", "no sensor watches that way")


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
)
"""All that can take motion away, in the order in which their reasons are told to people (`lease` comes last)."""

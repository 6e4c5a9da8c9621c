"""The safety rules: small pure functions, each from a scene to votes. A rule can only take away.

A vote that is not there takes nothing, so every rule here is written to be *lifted* by evidence, never granted by it:
what a way may do at most comes from the chair file (rule 10), and each fact can only make that less.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from math import inf
from typing import NamedTuple

from chairward.envelope import CLOSED, OPEN, Caps, Envelope, Grip
from chairward.facts import MS, NOT_ARMED, Facts, Limits, SourceLimits, State
from chairward.messages import RangeReading, Way
from chairward.stopping import largest_speed_mm_s

FUTURE_LIMIT_NS = 5 * MS
WINDOW = 3
CREEP_MM_S = 60.0
CREEP_ROOM_MM = 100.0
BACKED_OFF_MM = 200.0
TURNED_AWAY_DEG = 0.5
SUPERVISOR = "supervisor"

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
        required = {SUPERVISOR, *(lane(name) for group in _groups(limits) for name in group)}
        for name, sentence in facts.lost.items():
            if lane(name) in required:
                yield Envelope(CLOSED, "freshness", name, sentence, Grip.WAITS)
    for name in (facts.ranges.keys() - limits.sensors.keys()) | (facts.vetoes.keys() - limits.vetoers.keys()):
        yield Envelope(CLOSED, "freshness", name, "is not a sensor of the chair file")
    if facts.gap_ns > limits.gap_limit_ns:
        yield Envelope(CLOSED, "freshness", "guard", f"its clock jumped by {facts.gap_ns // MS} ms", Grip.LATCHES)


def _groups(limits: Limits) -> tuple[object, ...]:
    return (limits.sensors, limits.vetoers, limits.recognizers, limits.stop_devices)

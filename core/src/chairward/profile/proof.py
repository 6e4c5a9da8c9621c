"""The proof of distances: can the chair always stop in what its sensors see, and before it comes too near?

Reaction is the sum of what may pass before the brakes act: a reading as old as its limit, sensing, a tick, the wire and
the controller's own watchdog. Deceleration is what is left of the measured one on the steepest slope allowed.

1. From the first sight of an obstacle the chair must be able to stand before stop_mm, also when somebody comes towards
   it while it reacts and brakes.
2. Rules 2 and 3 slow it down while it comes nearer. `closest_mm` drives at a wall under these very rules with every
   delay and error at its limit, and lets the guard die at the worst instant: it must never come nearer than 450 mm.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Callable
from functools import lru_cache
from math import ceil, floor

import msgspec
from msgspec.structs import replace

from chairward import rules
from chairward.envelope import OPEN, meet
from chairward.facts import Facts, Limits, State
from chairward.profile.errors import ProfileError
from chairward.profile.models import PROTECTED_MM, LimitsTable, StoppingTable
from chairward.scene import Scene, boil
from chairward.stopping import decel_on_slope_mm_s2, largest_speed_mm_s, stopping_distance_mm

STEP_S = 0.005
Where = Callable[[str], str]
"""A key of the limits or stopping table -> how errors name its place ("people/asha.toml: limits.forward_mm_s")."""


class Proof(msgspec.Struct, frozen=True):
    """The figures of a proof that holds."""

    reaction_s: float
    decel_mm_s2: float
    needed_mm: float
    room_mm: float
    nearest_mm: float

    def __str__(self) -> str:
        return (
            f"stops in {self.needed_mm:.0f} of {self.room_mm:.0f} mm (reaction {self.reaction_s * 1000:.0f} ms, "
            f"{self.decel_mm_s2:.0f} mm/s²), never nearer than {self.nearest_mm:.0f} mm"
        )


def reaction_s(freshness_ms: int, stopping: StoppingTable) -> float:
    """From light on the sensor to torque at the wheel when everything is as late as it may be.

    Up to the wire that is what the limits allow, or what was measured, if that was longer.
    """
    to_wire_ms = max(freshness_ms + stopping.sensing_ms + stopping.tick_ms, stopping.reaction_ms)
    return (to_wire_ms + stopping.wire_ms + stopping.watchdog_ms) / 1000.0


def needed_mm(speed_mm_s: float, reaction: float, decel_mm_s2: float, closing_mm_s: float) -> float:
    """The way of the chair until it stands, and of somebody who comes towards it meanwhile."""
    return stopping_distance_mm(speed_mm_s, reaction, decel_mm_s2) + closing_mm_s * (
        reaction + speed_mm_s / decel_mm_s2
    )


def largest_mm_s(room_mm: float, reaction: float, decel_mm_s2: float, closing_mm_s: float) -> int:
    """The largest whole speed whose `needed_mm` fits into the room; 0: none does."""
    return floor(
        largest_speed_mm_s(room_mm - closing_mm_s * reaction, reaction + closing_mm_s / decel_mm_s2, decel_mm_s2)
    )


@lru_cache
def closest_mm(
    limits: LimitsTable, stopping: StoppingTable, reaction: float, decel_mm_s2: float, *, crawl: bool = True
) -> float:
    """How near the chair comes to a wall at worst.

    It starts at full speed before the rules have a say. Each reading is as late as all delays together (but for the
    watchdog) and as much too long as its error; the rules turn it into a speed; the drive brakes down to it, or goes so
    fast at once. At every instant the guard may die: the last speed is kept for the watchdog's time, then the brakes
    act. A crawl past a blind sensor (rule 5) ends in the same way, at stop_mm.
    """
    watchdog = stopping.watchdog_ms / 1000.0
    speed = float(limits.forward_mm_s)
    under = Limits(
        stop_mm=limits.stop_mm, reaction_s=reaction, decel_mm_s2=decel_mm_s2, caps=OPEN._replace(forward_mm_s=speed)
    )
    distance = limits.stop_mm + stopping.sensor_error_mm + 2.0 * stopping_distance_mm(speed, reaction, decel_mm_s2)
    late = deque([distance] * ceil((reaction - watchdog) / STEP_S))
    nearest = distance
    if crawl:
        way = stopping_distance_mm(limits.crawl_mm_s, reaction, decel_mm_s2)
        nearest = min(nearest, limits.stop_mm - stopping.sensor_error_mm - way)
    while True:
        late.append(distance)
        seen = late.popleft()
        allowed = min(allowed_mm_s(seen + stopping.sensor_error_mm, speed, under), limits.forward_mm_s)
        speed = max(speed - decel_mm_s2 * STEP_S, allowed)
        distance -= speed * STEP_S
        nearest = min(nearest, distance - stopping_distance_mm(speed, watchdog, decel_mm_s2))
        if seen == distance:  # it stands, and has stood for as long as a reading is late
            return nearest


def allowed_mm_s(reading_mm: float, speed_mm_s: float, limits: Limits) -> float:
    """What rules 2 and 3 allow forward when a sensor reads so much ahead of a chair that drives so fast."""
    nothing = Facts(now_ns=0)
    facts = replace(nothing, drive=replace(nothing.drive, speed_mm_s=speed_mm_s))
    eyes = boil("eyes", ())._replace(ahead_mm=round(reading_mm))
    view = Scene(facts, State(), limits, (eyes,))
    return meet((*rules.stop_distance(view), *rules.approach_speed(view))).forward_mm_s


def prove(
    limits: LimitsTable, stopping: StoppingTable, freshness_ms: int, where: Where, *, sees_behind: bool = False
) -> Proof:
    """The proof, or ProfileError with the largest speed (or other value) that fits.

    freshness_ms: the longest limit of any sensor of distances. sees_behind: one of them watches the way back; without
    one, rule 10 keeps that way slow, and there is no distance to prove.
    """
    reaction = reaction_s(freshness_ms, stopping)
    decel = decel_on_slope_mm_s2(stopping.decel_mm_s2, stopping.slope_percent)
    if decel <= 0.0:
        raise ProfileError(
            f"{where('slope_percent')} = {stopping.slope_percent:g}: with decel_mm_s2 = {stopping.decel_mm_s2} the "
            "chair cannot stop on such a slope: lower slope_percent or measure a larger decel_mm_s2"
        )
    room = float(stopping.sensor_range_mm - limits.stop_mm)
    speeds = {"forward_mm_s": limits.forward_mm_s, "arc_mm_s": min(limits.arc_mm_s, limits.forward_mm_s)}
    if sees_behind:
        speeds["backward_mm_s"] = limits.backward_mm_s
    for key, speed in speeds.items():
        needed = needed_mm(speed, reaction, decel, stopping.closing_mm_s)
        if needed > room:
            fits = largest_mm_s(room, reaction, decel, stopping.closing_mm_s)
            advice = f"at most {fits} fits" if fits else "no speed fits: a sensor that sees farther is needed"
            raise ProfileError(
                f"{where(key)} = {speed}: the chair needs {ceil(needed)} mm to stop (reaction {reaction * 1000:.0f} "
                f"ms, {decel:.0f} mm/s² on the slope, somebody coming at {stopping.closing_mm_s} mm/s), but from first "
                f"sight at {stopping.sensor_range_mm} mm to stop_mm = {limits.stop_mm} it has {room:.0f} mm: {advice}"
            )
    nearest = closest_mm(limits, stopping, reaction, decel)
    if nearest < PROTECTED_MM:
        crawls = closest_mm(limits, stopping, reaction, decel, crawl=False) >= PROTECTED_MM
        key, also = ("crawl_mm_s", " or lower crawl_mm_s") if crawls else ("stop_mm", "")
        enough = ceil(limits.stop_mm + PROTECTED_MM - nearest)
        raise ProfileError(
            f"{where(key)} = {getattr(limits, key)}: driving at a wall the chair could come as near as "
            f"{floor(nearest)} mm (reaction {reaction * 1000:.0f} ms, {decel:.0f} mm/s², readings wrong by "
            f"{stopping.sensor_error_mm} mm), allowed is {PROTECTED_MM}: raise stop_mm to {enough}{also}"
        )
    total = needed_mm(limits.forward_mm_s, reaction, decel, stopping.closing_mm_s)
    return Proof(reaction, decel, total, room, nearest)

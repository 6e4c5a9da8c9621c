"""The proof of distances: can the chair always stop in what its sensors see, and before it comes too near?

Reaction is the sum of what may pass before the brakes act: a reading as old as its limit, sensing, a tick, the wire and
the controller's own watchdog. Deceleration is what is left of the measured one on the steepest slope allowed. While the
chair reacts and brakes, somebody may come towards it. From the first sight of an obstacle the chair must stand before
stop_mm (rule 3 then holds it there at every distance in between); and stop_mm less what a wrong reading and the
creep behind a blind sensor cost must not fall below 450 mm.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from math import ceil, floor

from chairward.profile.errors import ProfileError
from chairward.profile.models import PROTECTED_MM, LimitsTable, StoppingTable
from chairward.stopping import decel_on_slope_mm_s2, largest_speed_mm_s, stopping_distance_mm

Where = Callable[[str], str]
"""A key of the limits or stopping table -> how errors name its place ("people/asha.toml: limits.forward_mm_s")."""


@dataclass(frozen=True, slots=True)
class Proof:
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
    """From light on the sensor to torque at the wheel when everything is as late as it may be."""
    return (freshness_ms + stopping.sensing_ms + stopping.tick_ms + stopping.wire_ms + stopping.watchdog_ms) / 1000.0


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


def prove(limits: LimitsTable, stopping: StoppingTable, freshness_ms: int, where: Where) -> Proof:
    """The proof, or ProfileError with the largest speed (or other value) that fits.

    freshness_ms: the longest limit of any sensor of distances.
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
    for key, speed in speeds.items():
        needed = needed_mm(speed, reaction, decel, stopping.closing_mm_s)
        if needed > room:
            fits = largest_mm_s(room, reaction, decel, stopping.closing_mm_s)
            advice = f"at most {fits} fits" if fits > 0 else "no speed fits: a sensor that sees farther is needed"
            raise ProfileError(
                f"{where(key)} = {speed}: the chair needs {ceil(needed)} mm to stop (reaction {reaction * 1000:.0f} "
                f"ms, {decel:.0f} mm/s² on the slope, somebody coming at {stopping.closing_mm_s} mm/s), but from first "
                f"sight at {stopping.sensor_range_mm} mm to stop_mm = {limits.stop_mm} it has {room:.0f} mm: {advice}"
            )
    creep = stopping_distance_mm(limits.crawl_mm_s, reaction, decel)
    nearest = limits.stop_mm - stopping.sensor_error_mm - creep
    if nearest < PROTECTED_MM:
        spare = limits.stop_mm - stopping.sensor_error_mm - PROTECTED_MM
        fits = floor(largest_speed_mm_s(spare, reaction, decel))
        raise ProfileError(
            f"{where('crawl_mm_s')} = {limits.crawl_mm_s}: the chair could come as near as {floor(nearest)} mm "
            f"(stop_mm = {limits.stop_mm} less {stopping.sensor_error_mm} mm sensor error and {ceil(creep)} mm to stop "
            f"from a crawl), allowed is {PROTECTED_MM}: at most {fits} fits, or raise stop_mm"
        )
    total = needed_mm(limits.forward_mm_s, reaction, decel, stopping.closing_mm_s)
    return Proof(reaction, decel, total, room, nearest)

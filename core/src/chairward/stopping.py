"""Stopping distances: one formula, used by the approach-speed rule and by the proof of a profile.

d = v * t + v^2 / (2 a): reaction at constant speed, then constant deceleration (any mechanics textbook; JRRD 2011).
"""

from __future__ import annotations

from math import sqrt

G_MM_S2 = 9_806.65


def stopping_distance_mm(speed_mm_s: float, reaction_s: float, decel_mm_s2: float) -> float:
    """How far the chair goes from the moment a thing can be seen until it stands."""
    return speed_mm_s * reaction_s + speed_mm_s**2 / (2.0 * decel_mm_s2)


def largest_speed_mm_s(room_mm: float, reaction_s: float, decel_mm_s2: float) -> float:
    """The largest speed from which `room_mm` is enough to stop; 0 where there is no room."""
    if room_mm <= 0.0:
        return 0.0
    return decel_mm_s2 * (sqrt(reaction_s**2 + 2.0 * room_mm / decel_mm_s2) - reaction_s)


def approach_speed_mm_s(room_mm: float, closing_mm_s: float, reaction_s: float, decel_mm_s2: float) -> float:
    """The speed to command, again and again, so that the chair stands before the room is used up.

    closing_mm_s: speed c at which the other side comes nearer by itself. One command alone would have to keep
    v t + v^2 / 2a + c (t + v / a) <= room. But a chair that slows down all the way to a wall was *faster* while the
    present reading was on its way: in the time t it goes farther than v t, by at most a t^2 / 2.
    """
    room_mm -= closing_mm_s * reaction_s + decel_mm_s2 * reaction_s**2 / 2.0
    return largest_speed_mm_s(room_mm, reaction_s + closing_mm_s / decel_mm_s2, decel_mm_s2)


def decel_on_slope_mm_s2(decel_mm_s2: float, slope_percent: float) -> float:
    """What is left of a deceleration measured on the level, going down a slope; may be <= 0: then it cannot stop."""
    return decel_mm_s2 - G_MM_S2 * slope_percent / 100.0

"""From mm/s and deg/s to a controller's own deflection, and the ramps of a drive that makes them itself. Pure."""

from __future__ import annotations

from math import isfinite

from chairward.components import DriveError, Motion
from chairward_drive_can.settings import CanSettings

ROUNDING = 1e-6
SOFT_SHARE, SOFT_RATE = 0.1, 0.5
"""Below a tenth of full deflection speed rises at half the rate, as in the PIC's firmware: a start without a jerk."""


def checked(motion: Motion, settings: CanSettings) -> Motion:
    """The motion, if this chair can do it at all. Raises DriveError for NaN and for more than full deflection.

    Refused rather than cut: a motion with one part cut is another path, and only the guard may choose a path.
    """
    drive, turn = motion
    if not (isfinite(drive) and isfinite(turn)):
        raise DriveError(f"drive.can: a motion of {drive} mm/s, {turn} deg/s is not a number; standing still instead")
    most = settings.full_forward_mm_s if drive >= 0 else settings.full_backward_mm_s
    if abs(drive) > most * (1 + ROUNDING):
        way = "forward" if drive >= 0 else "backward"
        raise DriveError(
            f"drive.can: {abs(drive):.0f} mm/s {way} was asked, but full deflection is {most:.0f} mm/s "
            f"(full_{way}_mm_s); lower the chair's limits or measure again with 'chairward check drive'"
        )
    if abs(turn) > settings.full_turn_deg_s * (1 + ROUNDING):
        raise DriveError(
            f"drive.can: turning at {abs(turn):.0f} deg/s was asked, but full deflection is "
            f"{settings.full_turn_deg_s:.0f} deg/s (full_turn_deg_s); lower the chair's limits or measure again"
        )
    return motion


def signed(motion: Motion, settings: CanSettings) -> Motion:
    """The motion in the controller's own directions."""
    return Motion(motion.drive_mm_s * settings.drive_sign, motion.turn_deg_s * settings.turn_sign)


def deflection(value: float, full: float, deadband: float, steps: int) -> int:
    """Whole steps of deflection for `value` of `full`; rounded towards standing, so never faster than asked.

    A controller that stays still up to `deadband` (fraction of full deflection) gets that much more on top.
    """
    share = min(1.0, abs(value) / full)
    count = int((deadband + (1.0 - deadband) * share) * steps + ROUNDING) if share > 0.0 else 0
    if count <= deadband * steps:
        return 0
    return count if value > 0 else -count


def ramp(now: float, wanted: float, rise: float, fall: float, dt_s: float) -> float:
    """One step from `now` towards `wanted`; rise and fall per second, 0 = at once. It never jumps through zero."""
    if now * wanted < 0.0:
        wanted = 0.0
    rate = rise if abs(wanted) > abs(now) else fall
    step = rate * dt_s if rate > 0.0 else abs(wanted - now)
    return wanted if abs(wanted - now) <= step else now + step * (1 if wanted > now else -1)


def ramped(now: Motion, wanted: Motion, settings: CanSettings, dt_s: float) -> Motion:
    """Both axes, each on its own ramp; a start is softer than what follows."""
    ahead = settings.full_forward_mm_s if wanted.drive_mm_s >= 0 else settings.full_backward_mm_s
    drive_rise = softened(settings.accel_mm_s2, now.drive_mm_s, ahead)
    turn_rise = softened(settings.turn_accel_deg_s2, now.turn_deg_s, settings.full_turn_deg_s)
    return Motion(
        ramp(now.drive_mm_s, wanted.drive_mm_s, drive_rise, settings.decel_mm_s2, dt_s),
        ramp(now.turn_deg_s, wanted.turn_deg_s, turn_rise, settings.turn_decel_deg_s2, dt_s),
    )


def softened(rise: float, now: float, full: float) -> float:
    """The rate at which speed may rise from `now`: this limits the jerk of a start."""
    return rise * SOFT_RATE if abs(now) < SOFT_SHARE * full else rise

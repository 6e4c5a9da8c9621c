"""What a step of an acceptance run came to."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from chairward.check.trial import told
from chairward.facts import S
from chairward.records import Record


@dataclass(frozen=True, slots=True)
class Curve:
    """What the drive was told during a step, and what it reported (None: nothing). s: seconds since the step began."""

    unit: str
    s: Sequence[float]
    told: Sequence[float]
    reported: Sequence[float | None]


@dataclass(frozen=True, slots=True)
class Result:
    """One step: what was found, what is allowed. picture: what the camera saw, PNG.

    late: all that is wrong is that it took longer than is allowed.
    """

    step: str
    ok: bool
    found: str
    allowed: str = ""
    curve: Curve | None = None
    picture: bytes | None = None
    late: bool = False


def timed(right: bool, in_time: bool, found: str, allowed: str) -> Result:
    """A step that has to be right, and in time."""
    return Result("", right and in_time, found, allowed, late=right and not in_time)


def curve(records: Sequence[Record], *, turns: bool) -> Curve:
    """Of a step's records: forward, or turning to the left."""
    seconds = [(r.facts.now_ns - records[0].facts.now_ns) / S for r in records]
    if turns:
        turning = [r.facts.drive.turn_deg_s for r in records]
        return Curve("deg/s", seconds, [told(r).turn_deg_s for r in records], turning)
    return Curve("mm/s", seconds, [told(r).drive_mm_s for r in records], [r.facts.drive.speed_mm_s for r in records])

"""What the rules look at: facts, state and limits, with each sensor's last three readings boiled down once."""

from __future__ import annotations

from math import inf
from typing import NamedTuple

from chairward.components import Motion
from chairward.facts import Facts, Limits, State
from chairward.messages import DriveStatus, RangeReading, Way

WINDOW = 3
"""Readings of a sensor that count: stop on any one of them, release on all of them."""
WAYS = (Way.AHEAD, Way.BEHIND, Way.LEFT, Way.RIGHT)
"""In the order of Caps."""


class Seen(NamedTuple):
    """One sensor's last readings: the nearest each way, mm (inf: nothing was said), which is the whole debounce.

    closing_mm_s: the fastest of them. blind: how many of them could not see, and the reason of the last.
    """

    source: str
    ahead_mm: float
    behind_mm: float
    left_mm: float
    right_mm: float
    closing_mm_s: int
    blind: int
    reason: str

    def mm(self, way: Way) -> float:
        """The nearest that way."""
        return (self.ahead_mm, self.behind_mm, self.left_mm, self.right_mm)[WAYS.index(way)]


class Scene(NamedTuple):
    """All that a rule may look at."""

    facts: Facts
    state: State
    limits: Limits
    seen: tuple[Seen, ...]


def look(facts: Facts, state: State, limits: Limits) -> Scene:
    """The scene of these facts."""
    return Scene(facts, state, limits, tuple([boil(name, window) for name, window in facts.ranges.items() if window]))


def boil(source: str, window: tuple[RangeReading, ...]) -> Seen:
    """The nearest each way of some readings, oldest first."""
    ahead = behind = left = right = inf
    closing = blind = 0
    reason = ""
    for reading in window:
        if (mm := reading.ahead_mm) is not None and mm < ahead:
            ahead = mm
        if (mm := reading.behind_mm) is not None and mm < behind:
            behind = mm
        if (mm := reading.left_mm) is not None and mm < left:
            left = mm
        if (mm := reading.right_mm) is not None and mm < right:
            right = mm
        if reading.closing_mm_s > closing:
            closing = reading.closing_mm_s
        if not reading.can_see:
            blind += 1
            reason = reading.reason
    return Seen(source, ahead, behind, left, right, closing, blind, reason)


def reported(drive: DriveStatus) -> Motion:
    """What the controller says the chair does; standing still where it does not tell."""
    return Motion(drive.speed_mm_s or 0.0, drive.turn_deg_s or 0.0)


def lane(source: str) -> str:
    """The lane of "lane/stage": stages of one lane share a device, so they fall silent and go blind together."""
    return source.partition("/")[0]

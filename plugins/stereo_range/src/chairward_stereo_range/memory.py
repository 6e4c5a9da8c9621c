"""What a single pair cannot tell: closing speed, edges seen twice, and low things that have gone under the view.

A low thing (a box, a cable's bulge, the edge of a step) leaves the picture at its bottom while the chair drives on. It
is still there: it is carried towards the chair by the floor odometry until the chair has passed it, or until the chair
has backed off or turned so far that its place is seen again or no longer ahead. Where the floor falls
silent, it goes on at the pace at which it came, up to the chair: a box does not wait where it was seen last. What the
floor never confirmed to come nearer stays where it was: caution, not a guess.
"""

from __future__ import annotations

from collections import deque
from dataclasses import dataclass

import numpy as np

from chairward_stereo_range.drops import carried_mm

LOW_MM = 350.0
"""Higher things cannot go under the view; they leave it sideways."""
LOW_SHARE = 0.8
"""Of a low thing's sightings so many are low: of a door frame now and then only a low part is matched."""
UNDER_MM = 80.0
"""A low thing nearer than the view's lower end and this much stands partly out of view already."""
BACKED_MM = 250.0
TURNED_MM = 640.0
"""The floor ahead has gone sideways by the chair's width: the chair faces another way."""
BLIND_PICTURES = 120
"""So long the pace at which a thing came stands in for a floor that does not tell: by then the chair stands, and the
guard remembers why (its rule 6)."""
TOLD_SHARE = 0.5
"""In so many of the pictures of its approach the floor must have told, or the thing stays where it was."""
SEEN_TIMES = 4
CAME_MM = 100.0
"""A thing is remembered only after this many frames and this much approach: noise of the floor does not approach."""
CLOSING_S = 0.6
MIN_CLOSING_MM_S = 150.0
"""Less than this is within the error of the fit and of the odometry."""


@dataclass(frozen=True, slots=True)
class Seen:
    """One frame's nearest thing: distance from the footprint, mm (None: nothing), and the height of its top."""

    time_s: float
    ahead_mm: float | None
    top_mm: float


@dataclass(frozen=True, slots=True)
class Remembered:
    """What to report: ahead_mm None means nothing; from_memory: it is not seen now."""

    ahead_mm: float | None
    closing_mm_s: float
    from_memory: bool


class Memory:
    """Call `step` once for every frame, in order.

    gone_below_mm: distance from the footprint nearer than which a low thing is out of view. length_mm: the chair's.
    """

    def __init__(self, gone_below_mm: float, length_mm: float) -> None:
        self._edge, self._length = gone_below_mm, length_mm
        self._track: deque[Seen] = deque(maxlen=30)
        self._held_mm: float | None = None
        self._pace_mm, self._is_edge, self._untold = 0.0, False, 0
        self._sideways_mm = 0.0
        self._driven: deque[tuple[float, float]] = deque(maxlen=30)

    def step(self, seen: Seen, driven_mm: float | None, sideways_mm: float = 0.0) -> Remembered:
        """seen: this frame. driven_mm, sideways_mm: how the floor ahead moved since the last frame, None unknown."""
        if self._held_mm is not None:
            self._held_mm -= self._carried(self._held_mm, driven_mm)
            self._sideways_mm += sideways_mm
            self._untold = self._untold + 1 if driven_mm is None else 0
            passed = self._held_mm < -self._length
            in_view_again = self._held_mm > self._edge + BACKED_MM
            turned_away = abs(self._sideways_mm) > TURNED_MM
            too_long = self._untold > BLIND_PICTURES and self._pace_mm > 0.0 and not self._is_edge
            if passed or in_view_again or turned_away or too_long or self._backing_from(seen, driven_mm):
                self._held_mm = None
        self._driven.append((seen.time_s, driven_mm if driven_mm is not None else np.nan))
        last = self._track[-1] if self._track else None
        if last is None or self._jumped(last, seen):
            self._track.clear()
        self._track.append(seen)
        if seen.ahead_mm is not None and self._going_under(seen):
            if self._held_mm is None:
                self._is_edge, self._untold, self._sideways_mm = seen.top_mm <= 0.0, 0, 0.0
                told = self._told(self._track[0], seen)
                confirmed = np.isfinite(told).sum() >= TOLD_SHARE * len(told)
                self._pace_mm = self._pace(seen) if self._is_edge or confirmed else 0.0
            self._held_mm = seen.ahead_mm if self._held_mm is None else min(seen.ahead_mm, self._held_mm)
        if self._held_mm is not None and (seen.ahead_mm is None or self._held_mm < seen.ahead_mm):
            return Remembered(max(self._held_mm, 0.0), 0.0, True)
        return Remembered(seen.ahead_mm, self._closing(), False)

    def _backing_from(self, seen: Seen, driven_mm: float | None) -> bool:
        """The chair backs off and the thing is seen where it should be: no need to remember it."""
        if self._held_mm is None or seen.ahead_mm is None or driven_mm is None:
            return False
        return driven_mm < -2.0 and abs(seen.ahead_mm - self._held_mm) < UNDER_MM

    def _carried(self, held_mm: float, driven_mm: float | None) -> float:
        """How far the held thing came nearer: where the floor does not tell, at its pace and up to the chair."""
        if driven_mm is None:
            return max(min(self._pace_mm, held_mm), 0.0)
        return carried_mm(driven_mm, self._pace_mm) if self._is_edge else driven_mm

    def _pace(self, seen: Seen) -> float:
        """mm a frame lately, on the fast side: what the floor told, or by how much the thing itself came nearer.

        The floor tells too little where the odometry's patch already holds some of the lower one.
        """
        known = [mm for _, mm in self._driven if not np.isnan(mm)]
        first = self._track[0]
        came = 0.0 if first.ahead_mm is None or seen.ahead_mm is None else first.ahead_mm - seen.ahead_mm
        return max(float(np.quantile(known, 0.8)) if known else 0.0, came / max(1, len(self._track) - 1))

    def _going_under(self, seen: Seen) -> bool:
        """A low thing at the lower end of the view that has come nearer just as far as the chair drove."""
        first = self._track[0]
        if seen.ahead_mm is None or first.ahead_mm is None:
            return False
        if seen.ahead_mm > self._edge + UNDER_MM or seen.top_mm > LOW_MM or len(self._track) < SEEN_TIMES:
            return False
        if sum(s.top_mm <= LOW_MM for s in self._track) < LOW_SHARE * len(self._track):
            return False
        came = first.ahead_mm - seen.ahead_mm
        driven = self._told(first, seen)
        known = driven and not np.isnan(driven).any()
        return came >= CAME_MM and (not known or abs(came - sum(driven)) <= 40.0 + 0.4 * came)

    def _told(self, first: Seen, last: Seen) -> list[float]:
        """What the floor told in each picture between two sightings, mm; NaN: nothing."""
        return [mm for t, mm in self._driven if first.time_s < t <= last.time_s]

    @staticmethod
    def _jumped(last: Seen, seen: Seen) -> bool:
        if last.ahead_mm is None or seen.ahead_mm is None:
            return True
        return abs(seen.ahead_mm - last.ahead_mm) > max(100.0, 0.12 * last.ahead_mm)

    def _closing(self) -> float:
        """Speed at which the thing comes closer beyond the chair's own motion, 0 when small or unknown."""
        if len(self._track) < 4:
            return 0.0
        end = self._track[-1].time_s
        window = [s for s in self._track if end - s.time_s <= CLOSING_S]
        if len(window) < 4 or window[-1].time_s - window[0].time_s < 0.2:
            return 0.0
        times = np.array([s.time_s for s in window])
        distances = np.array([s.ahead_mm for s in window], float)
        approach = -float(np.polyfit(times - times[0], distances, 1)[0])
        own = [mm for t, mm in self._driven if t > window[0].time_s]
        if not own or np.isnan(own).any():
            return 0.0
        beyond = approach - sum(own) / float(times[-1] - times[0])
        return beyond if beyond >= MIN_CLOSING_MM_S else 0.0

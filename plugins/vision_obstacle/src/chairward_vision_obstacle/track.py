"""From sightings to a distance that may stop a chair: confirmed over several pictures, and not forgotten when the thing
slips under the camera's view. No clock and no pictures in here; one step per picture.

The picture ends about a metre ahead of the camera, so a cable or a low box is always out of sight before it is near.
What was confirmed and then left at the *lower* edge is carried on by how the floor moves past (see birdseye) until the
chair has passed it, backed off so far that it ought to be in view again, or turned away from it. For longer than
FORGET_S nothing is carried: by then the chair stands, and remembering why is the guard's matter (its rule 6).
"""

from __future__ import annotations

from collections import deque
from dataclasses import dataclass, replace

from chairward_vision_obstacle.birdseye import Shift
from chairward_vision_obstacle.regions import Sighting

WINDOW = 5
"""Pictures looked back on; `confirm` of them must have seen the thing where it is expected."""
SAME = 0.15
"""Sightings whose distances differ by less than this fraction are of one thing."""
EDGE = 1.25
"""Remembered things farther than so many times the nearest visible floor ought to be in view, and are not there."""
COAST_S = 0.2
"""A confirmed thing missing from a picture or two is taken to be there still."""
GAP_S = 0.4
"""A thing not seen for so long although in view was no thing, or has gone."""
FORGET_S = 8.0
SPEED_LIFE_S = 0.5
"""For so long the last speed that the floor told stands in for shifts that cannot be told."""
APPROACH = 6
"""Sightings from which the speed is reckoned where the floor is plain."""


@dataclass(frozen=True, slots=True)
class Tracked:
    """The nearest confirmed thing, mm from the footprint. remembered: it is under the camera's view.

    tall: it cannot get there, for it reaches above the camera: out of sight, it has gone aside.
    """

    ahead_mm: float
    seen_ns: int
    label: str
    remembered: bool = False
    tall: bool = False


class Track:
    """Follows the nearest thing ahead. nearest_mm: distance of the nearest floor that the picture shows."""

    def __init__(self, nearest_mm: float, half_width_mm: float, confirm: int) -> None:
        self._nearest_mm, self._half_width_mm, self._confirm = nearest_mm, half_width_mm, confirm
        self._seen: deque[Sighting | None] = deque(maxlen=WINDOW)
        self._carried: Tracked | None = None
        self._sideways_mm = 0.0
        self._speed_mm_s = 0.0
        self._told_ns = -(10**18)
        self._approach: deque[tuple[int, float]] = deque(maxlen=APPROACH)
        self._last_ns: int | None = None

    def step(self, now_ns: int, sighting: Sighting | None, shift: Shift | None) -> Tracked | None:
        """What is ahead in the picture captured at now_ns; shift: how the floor moved since the picture before."""
        self._move(now_ns, shift)
        carried = self._carried
        if sighting is not None and sighting.cut and carried is not None:
            # The picture's edge cuts its near edge off: it is as near as was to be expected.
            sighting = sighting._replace(ahead_mm=min(sighting.ahead_mm, carried.ahead_mm))
        self._seen.append(sighting)
        current = self._confirmed(now_ns)
        under = carried is not None and carried.remembered
        if current is not None and (carried is None or not under or current.ahead_mm <= carried.ahead_mm):
            self._carried, self._sideways_mm = current, 0.0
            return current
        if carried is None or self._is_over(carried, now_ns):
            self._carried = None
            return current
        if not carried.remembered and not carried.tall and carried.ahead_mm <= self._nearest_mm:
            self._carried = carried = replace(carried, remembered=True)
        if carried.remembered or (current is None and now_ns - carried.seen_ns <= COAST_S * 1e9):
            return carried
        return current

    def _move(self, now_ns: int, shift: Shift | None) -> None:
        """Let everything known come nearer by what the chair drove.

        Where the floor does not tell (plain, no detail), the speed is the one last told by the floor, or else by the
        distances at which the thing itself was seen.
        """
        gap_s = 0.0 if self._last_ns is None else max(0.0, (now_ns - self._last_ns) / 1e9)
        self._last_ns = now_ns
        if shift is not None and gap_s > 0:
            self._speed_mm_s, self._told_ns = shift.forward_mm / gap_s, now_ns
        elif now_ns - self._told_ns > SPEED_LIFE_S * 1e9:
            self._speed_mm_s = self._approach_mm_s()
        moved_mm = shift.forward_mm if shift is not None else self._speed_mm_s * gap_s
        self._sideways_mm += 0.0 if shift is None else shift.left_mm
        self._seen = deque(
            (s if s is None else s._replace(ahead_mm=s.ahead_mm - moved_mm) for s in self._seen), maxlen=WINDOW
        )
        if self._carried is not None:
            self._carried = replace(self._carried, ahead_mm=max(0.0, self._carried.ahead_mm - moved_mm))

    def _confirmed(self, now_ns: int) -> Tracked | None:
        """The newest sighting, when enough of the window agree with it."""
        newest = self._seen[-1]
        if newest is None:
            return None
        agree = sum(s is not None and abs(s.ahead_mm - newest.ahead_mm) <= SAME * newest.ahead_mm for s in self._seen)
        if agree < self._confirm:
            return None
        self._approach.append((now_ns, newest.ahead_mm))
        return Tracked(newest.ahead_mm, now_ns, newest.label, tall=newest.tall)

    def _approach_mm_s(self) -> float:
        """How fast the thing came nearer over its last sightings; 0 where too few, or too far apart, to tell."""
        if len(self._approach) < APPROACH:
            return 0.0
        (first_ns, first_mm), (last_ns, last_mm) = self._approach[0], self._approach[-1]
        gap_s = (last_ns - first_ns) / 1e9
        return max(0.0, (first_mm - last_mm) / gap_s) if 0.0 < gap_s <= 1.0 else 0.0

    def _is_over(self, carried: Tracked, now_ns: int) -> bool:
        """Whether what is carried is behind, beside, in plain view and not there, or too long ago."""
        age_s = (now_ns - carried.seen_ns) / 1e9
        if carried.remembered:
            return (
                age_s > FORGET_S
                or carried.ahead_mm > EDGE * self._nearest_mm
                or abs(self._sideways_mm) > self._half_width_mm
            )
        return age_s > GAP_S

"""A thing that goes out of the pictures sideways or over their top, while the chair drives at it, is still in its way.

Near the chair both pictures together show less than the footprint sweeps: 600 mm before a pair of f 300 px, B 50 mm and
320 columns they show 270 mm to the left. The corner of a box that stands 20 mm in the way is lost there, and what is
measured instead is the box's side, farther on; of a table whose top goes out above, the rear legs remain. So the
nearest thing is followed by the floor odometry, and where it has to be out of view it is carried on: until the chair
has passed it, it is beside the way, or its place is seen again.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from chairward.stages import Floats
from chairward_stereo_range.geometry import View

SAME_MM = 25.0
"""Seen so much farther than it was carried, it is perhaps not the same thing: twice the error near the chair."""
ANOTHER_MM = 100.0
"""Seen so much nearer or farther than it was carried, and in view, it is another thing; less is an error's."""
UNSURE_MM = 60.0
"""Within so much of the view's side a thing's edge may be matched or not."""
FOLLOWED, CAME_MM = 4, 100.0
"""Carried only after so many pictures and so much driving at it: noise does not approach."""
FARTHEST_MM = 1200.0
STEADY = 0.3
"""Share of the newest picture in the place of a thing's edge and in the pace."""
BLIND_PICTURES = 120
"""So long a pace stands in for the floor: by then the chair stands, and the guard remembers why (its rule 6)."""


@dataclass(frozen=True, slots=True)
class Edge:
    """The nearest thing, mm: forward from the footprint; where its inner edge is, to the left of the chair's middle.

    low_mm: height of the lowest part of it that is seen.
    """

    ahead_mm: float
    left_mm: float
    low_mm: float = 0.0


class Leaving:
    """Call `step` once for every frame, in order.

    half_width_mm: of the way. top_row: first row that is measured. nearest_mm: nearest depth that is searched.
    floor_mm: where the odometry looks, forward from the axle.
    """

    def __init__(self, view: View, half_width_mm: float, top_row: int, nearest_mm: float, floor_mm: float) -> None:
        row, middle = view.geometry.height_px // 2, view.geometry.width_px // 2
        self._left, self._right = (float(view.left[row, col] / view.forward[row, col]) for col in (0, -1))
        self._up = float(view.up[top_row, middle] / view.forward[top_row, middle])
        self._y_mm, self._z_mm, self._baseline_mm = view.pose.y_mm, view.pose.z_mm, view.geometry.baseline_mm
        self._front_mm, self._offset_mm = view.footprint.front_mm, view.ahead_offset_mm()
        self._length_mm = view.footprint.front_mm + view.footprint.rear_mm
        self._half_width_mm, self._nearest_mm, self._floor_mm = half_width_mm, nearest_mm, floor_mm
        self._at: Edge | None = None
        self._followed, self._came_mm, self._pace_mm, self._untold = 0, 0.0, 0.0, 0

    def step(self, seen: Edge | None, driven_mm: float | None, sideways_mm: float) -> float | None:
        """What to report instead of what is seen, mm from the footprint (not negative); None: what is seen is right.

        driven_mm, sideways_mm: how the floor came nearer and went to the right since the last frame; None unknown.
        """
        was = None if self._at is None else self._moved(self._at, driven_mm, sideways_mm)
        if was is None or (seen is not None and seen.ahead_mm < was.ahead_mm - ANOTHER_MM):
            self._follow(seen)
            return None
        if seen is not None and seen.ahead_mm <= was.ahead_mm + SAME_MM:
            self._went_on(was, seen, driven_mm)
            return None
        if not self._is_out_of_view(was):
            if seen is not None and seen.ahead_mm <= was.ahead_mm + ANOTHER_MM:
                self._at = seen
            else:
                self._follow(seen)
            return None
        self._at = was
        self._untold = self._untold + 1 if driven_mm is None else 0
        return max(was.ahead_mm, 0.0)

    def _follow(self, seen: Edge | None) -> None:
        self._at = seen if seen is not None and seen.ahead_mm <= FARTHEST_MM else None
        self._followed, self._came_mm, self._pace_mm, self._untold = 0, 0.0, 0.0, 0

    def _went_on(self, was: Edge, seen: Edge, driven_mm: float | None) -> None:
        came = was.ahead_mm + self._pace_mm - seen.ahead_mm if driven_mm is None else driven_mm
        self._pace_mm += STEADY * (max(came, 0.0) - self._pace_mm)
        self._followed, self._came_mm, self._untold = self._followed + 1, self._came_mm + came, 0
        same_side = was.left_mm * seen.left_mm > 0
        left = was.left_mm + STEADY * (seen.left_mm - was.left_mm) if same_side else seen.left_mm
        self._at = Edge(min(was.ahead_mm, seen.ahead_mm), left, seen.low_mm)

    def _moved(self, at: Edge, driven_mm: float | None, sideways_mm: float) -> Edge:
        """Where the thing is after the chair has driven and turned about its axle."""
        turned = sideways_mm / self._floor_mm
        forward = self._pace_mm if driven_mm is None else driven_mm
        return replace(
            at,
            ahead_mm=at.ahead_mm - forward + at.left_mm * turned,
            left_mm=at.left_mm - (self._front_mm + at.ahead_mm) * turned,
        )

    def _is_out_of_view(self, at: Edge) -> bool:
        """Is it still ahead, in the chair's way, and where the pictures do not both show it?"""
        if self._followed < FOLLOWED or self._came_mm < CAME_MM or self._untold > BLIND_PICTURES:
            return False
        if at.ahead_mm < -self._length_mm or abs(at.left_mm) > self._half_width_mm:
            return False
        lens = max(at.ahead_mm - self._offset_mm, 0.0)
        left = self._y_mm + lens * self._left - self._baseline_mm - UNSURE_MM
        right = self._y_mm + lens * self._right + UNSURE_MM
        over = at.low_mm > self._z_mm + lens * self._up - UNSURE_MM
        return lens < self._nearest_mm or over or not right <= at.left_mm <= left


def inner_edge_mm(left_mm: Floats) -> float:
    """Of a thing's pixels' places across the way (mm, left positive): the one nearest the middle, but for a tenth."""
    tenth = left_mm.size // 10
    return float(left_mm[np.argpartition(np.abs(left_mm), tenth)[tenth]])

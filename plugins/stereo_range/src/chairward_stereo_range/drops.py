"""Drop-offs: a step down, a stair, a missing floor. The floor ends, and what is seen beyond lies below it.

Row by row from the chair outwards, over the width that the chair will sweep: where a good part of the row is measured
to lie below the floor's plane, over several rows in turn, the floor ends. Small patches do not count: a glossy floor
mirrors the room, and the mirror image lies below the floor, too.

A drop is followed over pictures by EdgeTrack.
"""

from __future__ import annotations

import numpy as np

from chairward.stages import Floats
from chairward_stereo_range.geometry import View
from chairward_stereo_range.region import Bools

SHARE = 0.5
"""Of a row's path that must lie below the floor."""
ROWS = 4
"""Rows (of the half-size grid, at 240) in turn that must show it."""
FLOOR_ROWS = 2
"""Rows of floor before the edge: without a floor to leave there is no edge, only a wrong mount."""
PLAIN_SHARE = 0.1
"""Of a row's path that is measured at most where the floor is too plain to be."""
PLANE_RUNS = 3
"""Where the floor near by is plain, so many times ROWS must show one lower floor: a glossy floor's mirror image of a
wall stands upright, that of a ceiling lies deeper than LEAST_PART."""
PART_SPREAD, LEAST_PART = 1.15, 0.3
FARTHEST_MM = 2500.0
SAME_MM, SAME_SHARE = 100.0, 0.12
"""An edge seen so near where it was carried is the same."""
FOLLOWED, CAME_MM = 3, 100.0
"""Carried only after so many pictures and so much driving at it: noise does not approach."""
LOST_S = 0.7
"""So long an edge is carried that is not seen."""
STEADY = 0.3
"""Share of the newest picture in the pace."""


class DropWatch:
    """The path over the floor on a view's grid; see the module."""

    def __init__(self, view: View, grid: tuple[slice, slice], half_width_mm: float, scale: float) -> None:
        up, left, forward = (np.asarray(a[grid], np.float64) for a in (view.up, view.left, view.forward))
        with np.errstate(divide="ignore", invalid="ignore"):
            depth = np.where(up < -1e-6, view.pose.z_mm / -up, np.inf)
            lateral = view.pose.y_mm + depth * left
            ahead = depth * forward
        self._path = np.isfinite(depth) & (np.abs(lateral) <= half_width_mm) & (ahead < FARTHEST_MM)
        self._count = np.maximum(self._path.sum(axis=1), 1)
        self._used = self._path.sum(axis=1) >= 10 * scale
        with np.errstate(invalid="ignore"):
            self._ahead_mm = np.where(self._used, np.where(self._path, ahead, 0.0).sum(axis=1) / self._count, np.inf)
        self._rows = max(2, round(ROWS * scale))

    def edge_mm(self, floor: Bools, below: Bools, disparity: Floats, floor_line: Floats) -> tuple[float, int] | None:
        """(forward distance from the lens, grid row) of the floor's end, or None.

        floor, below: masks on the grid; disparity (NaN unknown) and the floor's there, px.
        """
        is_below = (((below & self._path).sum(axis=1) >= SHARE * self._count) & self._used)[::-1]
        if not is_below.any():
            return None
        is_floor = (((floor & self._path).sum(axis=1) >= 0.3 * self._count) & self._used)[::-1]
        is_plain = (((np.isfinite(disparity) & self._path).sum(axis=1) <= PLAIN_SHARE * self._count) & self._used)[::-1]
        last = is_below.size - 1
        run = floor_rows = plain_rows = 0
        for i in range(is_below.size):
            if is_below[i]:
                run += 1
                row = last - (i - run + 1)
                left = floor_rows >= FLOOR_ROWS and run >= self._rows
                plain = plain_rows >= self._rows and run == PLANE_RUNS * self._rows
                if left or (plain and self._is_plane(slice(last - i, row + 1), disparity, floor_line)):
                    return float(self._ahead_mm[row]), row
            else:
                run = 0
                floor_rows += int(is_floor[i])
                plain_rows += int(is_plain[i])
        return None

    def _is_plane(self, rows: slice, disparity: Floats, floor_line: Floats) -> bool:
        """Do these rows show a lower floor? Its disparity is everywhere the same part of the floor's."""
        seen = self._path[rows] & np.isfinite(disparity[rows])
        part = np.where(seen, disparity[rows] / np.maximum(floor_line[rows], 1e-3), np.nan)
        of_row = np.nanmedian(part, axis=1)
        return bool(of_row.min() >= LEAST_PART and of_row.max() <= PART_SPREAD * of_row.min())


def carried_mm(driven_mm: float | None, pace_mm: float) -> float:
    """How far the floor's end came nearer. Beyond it the odometry sees a lower floor, which passes more slowly, or
    both at once and cannot tell: a chair is taken to go on there at the pace at which it came."""
    return pace_mm if driven_mm is None or 0.3 * pace_mm < driven_mm < pace_mm else driven_mm


class EdgeTrack:
    """The floor's end over several pictures: believed when seen again where the chair's own motion has brought it.

    It is lost now and then, above all near the lower end of the view, where too few rows of floor are left before it:
    once followed it is carried on. Call `step` once for every picture.
    """

    def __init__(self) -> None:
        self._at_mm: float | None = None
        self._seen, self._came_mm, self._pace_mm, self._seen_s = 0, 0.0, 0.0, 0.0

    def step(self, time_s: float, edge_mm: float | None, driven_mm: float | None) -> float | None:
        """Where the floor ends, mm; None: nowhere that is sure. driven_mm: since the last picture, None unknown."""
        came = carried_mm(driven_mm, self._pace_mm)
        was = None if self._at_mm is None else self._at_mm - came
        if was is not None and edge_mm is not None and abs(edge_mm - was) <= max(SAME_MM, SAME_SHARE * was):
            self._pace_mm += STEADY * (max(was + came - edge_mm, 0.0) - self._pace_mm)
            self._at_mm, self._seen, self._came_mm, self._seen_s = edge_mm, self._seen + 1, self._came_mm + came, time_s
        elif was is not None and time_s - self._seen_s <= LOST_S and (edge_mm is None or edge_mm > was):
            self._at_mm, self._came_mm = was, self._came_mm + came
        else:
            self._at_mm, self._seen, self._came_mm, self._pace_mm, self._seen_s = edge_mm, 1, 0.0, 0.0, time_s
        followed = self._seen >= FOLLOWED and self._came_mm >= CAME_MM
        return self._at_mm if followed or (self._seen >= 2 and self._seen_s == time_s) else None

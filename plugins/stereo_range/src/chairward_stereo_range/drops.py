"""Drop-offs: a step down, a stair, a missing floor. The floor ends, and what is seen beyond lies below it.

Row by row from the chair outwards, over the width that the chair will sweep: where a good part of the row is measured
to lie below the floor's plane, over several rows in turn, the floor ends. Small patches do not count: a glossy floor
mirrors the room, and the mirror image lies below the floor, too.
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from chairward_stereo_range.geometry import View

SHARE = 0.5
"""Of a row's path that must lie below the floor."""
ROWS = 4
"""Rows (of the half-size grid, at 240) in turn that must show it."""
FLOOR_ROWS = 2
"""Rows of floor before the edge: without a floor to leave there is no edge, only a wrong mount."""
FARTHEST_MM = 2500.0


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

    def edge_mm(self, floor: npt.NDArray[np.bool_], below: npt.NDArray[np.bool_]) -> tuple[float, int] | None:
        """(forward distance from the lens, grid row) of the floor's end, or None. floor, below: masks on the grid."""
        is_below = (((below & self._path).sum(axis=1) >= SHARE * self._count) & self._used)[::-1]
        is_floor = (((floor & self._path).sum(axis=1) >= 0.3 * self._count) & self._used)[::-1]
        run = floor_rows = 0
        for i in range(is_below.size):
            if is_below[i]:
                run += 1
                if run >= self._rows and floor_rows >= FLOOR_ROWS:
                    row = is_below.size - 1 - (i - run + 1)
                    return float(self._ahead_mm[row]), row
            else:
                run = 0
                floor_rows += int(is_floor[i])
        return None

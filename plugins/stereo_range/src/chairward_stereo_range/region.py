"""What counts as "ahead".

`corridor`: the points that the footprint will sweep going straight on, up to the chair's height; a door frame beside it
does not count, however near. `trapezoid`: the thesis' fixed pixels (section 4), in which the truth of test sets is
given, too.
"""

from __future__ import annotations

from typing import Literal

import numpy as np
import numpy.typing as npt

from chairward.stages import Floats
from chairward_stereo_range.geometry import THESIS_HEIGHT, View, thesis_trapezoid

Bools = npt.NDArray[np.bool_]
RegionKind = Literal["corridor", "trapezoid"]
Box = tuple[slice, slice]
WHOLE: Box = (slice(None), slice(None))
LOOK_AT_MM = (900.0, 1500.0)
"""The part of the corridor whose picture must be seen well, to say that the sensor can see."""
ABOVE_LENS_MM = 250.0
"""... up to this much over the lens: blank ceilings and far walls do not matter."""
MARGIN_ROWS = 8


class Region:
    """The region on one view, on the picture and on the half-size grid of rows top..bottom.

    mask: h x w, the picture of the region, over which coverage is counted and which people are shown.
    """

    def __init__(self, view: View, kind: RegionKind, half_width_mm: float, height_mm: float) -> None:
        g = view.geometry
        self.view, self.kind = view, kind
        self.half_width_mm, self.height_mm = half_width_mm, height_mm
        self.trapezoid = thesis_trapezoid(g.width_px, g.height_px)
        if kind == "trapezoid":
            self.mask = self.trapezoid
            rows = np.nonzero(self.mask.any(axis=1))[0]
            pad = int(MARGIN_ROWS * g.height_px / THESIS_HEIGHT)
            self.top = max(0, int(rows[0]) - pad) // 2 * 2
            self.bottom = min(g.height_px, int(rows[-1]) + 1 + pad) // 2 * 2
        else:
            self.mask = self._corridor_picture()
            self.top, self.bottom = 0, g.height_px // 2 * 2
        self.grid: Box = (slice(self.top, self.bottom, 2), slice(0, g.width_px // 2 * 2, 2))
        self.grid_mask: Bools = np.ascontiguousarray(self.mask[self.grid])
        self._left: Floats = np.ascontiguousarray(view.left[self.grid])
        self._up: Floats = np.ascontiguousarray(view.up[self.grid])

    def _corridor_picture(self) -> Bools:
        v = self.view
        seen = np.zeros(v.forward.shape, bool)
        for depth in np.linspace(*LOOK_AT_MM, 6):
            height = v.pose.z_mm + depth * v.up
            seen |= (
                (np.abs(v.pose.y_mm + depth * v.left) <= self.half_width_mm)
                & (height < v.pose.z_mm + ABOVE_LENS_MM)
                & ((height > -0.05 * depth) | (not v.floor_known))
            )
        return seen

    def contains(self, depth: Floats | float, box: Box = WHOLE) -> Bools:
        """Which grid pixels of `box`, seen at `depth` (mm), lie in the region."""
        if self.kind == "trapezoid":
            return self.grid_mask[box]
        beside = np.abs(self.view.pose.y_mm + depth * self._left[box]) > self.half_width_mm
        return np.asarray(~beside & self.passable(depth, box))

    def passable(self, depth: Floats | float, box: Box = WHOLE) -> Bools:
        """Which grid pixels, seen at `depth`, lie neither over the chair nor far below the floor."""
        height = self.view.pose.z_mm + depth * self._up[box]
        below = (height < -0.1 * depth) if self.view.floor_known else np.zeros(height.shape, bool)
        return np.asarray(~below & (height < self.height_mm))

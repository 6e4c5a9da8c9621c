"""From a rectified pair to facts: disparity, floor, the nearest thing each way, and whether it could be seen at all."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Literal

import numpy as np
import numpy.typing as npt

from chairward.messages import NOTHING_NEAR_MM
from chairward.stages import Floats, Image
from chairward_stereo_range import thesis
from chairward_stereo_range.floor import FloorFit, fit_floor, split
from chairward_stereo_range.geometry import THESIS_HEIGHT, View, disparity_range, thesis_trapezoid
from chairward_stereo_range.matching import Matcher, Method, make_matcher
from chairward_stereo_range.nearest import Nearest, nearest
from chairward_stereo_range.texture import noise_sigma, textured

Bools = npt.NDArray[np.bool_]
RegionKind = Literal["corridor", "trapezoid"]


@dataclass(frozen=True, slots=True)
class Options:
    """How to measure; see the settings of the stage for what each means."""

    method: Method = "sgbm_3way"
    region: RegionKind = "corridor"
    nearest_mm: float = 240.0
    farthest_mm: float = 3500.0
    clearance_mm: float = 60.0
    height_mm: float = 1400.0
    side_margin_mm: float = 20.0
    margin_px: float = 0.9
    min_coverage: float = 0.12


@dataclass(frozen=True, slots=True)
class Spot:
    """The nearest thing one way: depth_mm along the optical axis, ahead_mm from the footprint; row, col of its middle."""

    depth_mm: float
    ahead_mm: float
    row: int
    col: int
    pixels: int


@dataclass(frozen=True, slots=True)
class Measurement:
    """What one pair says. disparity: h x w px, NaN unknown; floor, obstacle, region: h x w bool.

    ahead, left, right: None when nothing is near that way. coverage: part of the region that was matched, 0..1.
    """

    disparity: Floats
    floor: Bools
    obstacle: Bools
    region: Bools
    ahead: Spot | None
    left: Spot | None
    right: Spot | None
    coverage: float
    can_see: bool
    reason: str = ""
    floor_fit: FloorFit = field(default_factory=FloorFit)
    sigma: float = 0.0


class RangeFinder:
    """Measures pairs of one view. Keeps nothing between frames."""

    def __init__(self, view: View, options: Options) -> None:
        g = view.geometry
        self.view, self.options = view, options
        self.scale = g.height_px / THESIS_HEIGHT
        self.trapezoid = thesis_trapezoid(g.width_px, g.height_px)
        self.region = self.trapezoid if options.region == "trapezoid" else self._corridor()
        rows = np.nonzero(self.region.any(axis=1))[0]
        pad = int(8 * self.scale)
        self.top, self.bottom = max(0, int(rows[0]) - pad), min(g.height_px, int(rows[-1]) + 1 + pad)
        self.first, self.count = disparity_range(g, options.nearest_mm)
        self.matcher: Matcher | None = None
        if options.method not in thesis.LIMITS:
            self.matcher = make_matcher(options.method, self.first, self.count)

    @property
    def horizon_row(self) -> float:
        """First row below which floor can be seen at all; the picture's height when the mount is unknown."""
        below = np.nonzero((self.view.up < 0).all(axis=1))[0]
        return float(below[0]) if self.view.floor_known and below.size else float(self.view.geometry.height_px)

    def _corridor(self) -> Bools:
        """Where the picture can show a point of the corridor between the nearest and 1.5 m, or the floor there."""
        v, o = self.view, self.options
        half = v.footprint.half_width_mm + o.side_margin_mm
        seen = np.zeros(v.forward.shape, bool)
        for depth in np.geomspace(o.nearest_mm, 1500.0, 12):
            seen |= (np.abs(v.pose.y_mm + depth * v.left) <= half) & self._high_enough(np.float32(depth))
        return seen

    def _high_enough(self, depth: np.float32 | Floats) -> Bools:
        v = self.view
        height = v.pose.z_mm + depth * v.up
        return np.asarray((height > -0.1 * depth if v.floor_known else True) & (height < self.options.height_mm))

    def measure(self, left: Image, right: Image, mask: Bools | None = None) -> Measurement:
        """left, right: h x w x 3 BGR of the view's size. mask: appearance's obstacles, for the thesis methods only."""
        import cv2

        rows = slice(self.top, self.bottom)
        grey_left = cv2.cvtColor(np.ascontiguousarray(left[rows]), cv2.COLOR_BGR2GRAY)
        grey_right = cv2.cvtColor(np.ascontiguousarray(right[rows]), cv2.COLOR_BGR2GRAY)
        if self.matcher is None:
            return self._thesis(grey_left, grey_right, mask)
        found = self.matcher(grey_left, grey_right)
        sigma = noise_sigma(grey_left)
        found[~textured(grey_left, sigma)] = np.nan
        found = without_specks(found, int(40 * self.scale**2), 1.5)
        disparity = np.full(left.shape[:2], np.nan, np.float32)
        disparity[rows] = found
        return self._judge(disparity, sigma)

    def _judge(self, disparity: Floats, sigma: float) -> Measurement:
        v, o = self.view, self.options
        known = np.isfinite(disparity)
        fit = FloorFit()
        if v.floor_known:
            fit = fit_floor(disparity, v.d_floor, self.scale)
            floor, above, _below = split(
                disparity, fit.apply(v.d_floor), v.pose.z_mm, o.clearance_mm, o.margin_px * self.scale
            )
        else:
            floor, above = np.zeros_like(known), known
        depth = v.depth_mm(np.nan_to_num(disparity, nan=0.0))
        above &= depth < o.farthest_mm
        if o.region == "corridor":
            lateral = v.pose.y_mm + depth * v.left
            inside = (np.abs(lateral) <= v.footprint.half_width_mm + o.side_margin_mm) & self._high_enough(depth)
        else:
            inside = self.region
        third = v.geometry.width_px // 3
        ahead = self._spot(disparity, above & inside)
        left = self._spot(disparity, above, slice(0, third))
        right = self._spot(disparity, above, slice(v.geometry.width_px - third, None))
        coverage = float((known & self.region).sum()) / max(1, int(self.region.sum()))
        can_see = coverage >= o.min_coverage
        reason = "" if can_see else "too little texture to measure (a plain wall?)"
        return Measurement(
            disparity, floor, above, self.region, ahead, left, right, coverage, can_see, reason, fit, sigma
        )

    def _spot(self, disparity: Floats, candidates: Bools, columns: slice | None = None) -> Spot | None:
        v = self.view
        start = 0
        if columns is not None:
            start = columns.indices(disparity.shape[1])[0]
            disparity, candidates = disparity[:, columns], candidates[:, columns]
        rows, cols = np.nonzero(candidates)
        values = disparity[rows, cols] + np.float32(v.geometry.doffs_px)
        found: Nearest | None = nearest(values, v.geometry.baseline_mm, self.scale)
        if found is None:
            return None
        depth = v.fb / found.disparity_px
        row, col = int(np.median(rows[found.chosen])), int(np.median(cols[found.chosen])) + start
        ahead = float(np.quantile(v.forward[rows[found.chosen], cols[found.chosen] + start], 0.15)) * depth
        return Spot(depth, ahead + v.ahead_offset_mm(), row, col, found.pixels)

    def _thesis(self, grey_left: Image, grey_right: Image, mask: Bools | None) -> Measurement:
        """The thesis' way: NCC gated by appearance, whole pixels, no idea of blindness."""
        v = self.view
        gate = self.trapezoid if mask is None else self.trapezoid & mask
        limit = round(thesis.LIMITS[self.options.method] * self.scale)
        found = thesis.ncc_disparity(grey_left, grey_right, gate[self.top : self.bottom], limit)
        found = thesis.smoothed(found)
        disparity = np.full(v.forward.shape, np.nan, np.float32)
        disparity[self.top : self.bottom] = np.where(found > 0, found, np.nan)
        d = thesis.nearest_disparity(found, round(thesis.MIN_PIXELS * self.scale**2))
        z = thesis.distance_mm(d, v.geometry.focal_px, v.geometry.baseline_mm, v.geometry.doffs_px)
        spot = None
        if d > 0:
            rows, cols = np.nonzero(disparity == d)
            spot = Spot(z, z + v.ahead_offset_mm(), int(np.median(rows)), int(np.median(cols)), rows.size)
        nothing = np.zeros(disparity.shape, bool)
        return Measurement(disparity, nothing, np.isfinite(disparity), self.trapezoid, spot, None, None, 1.0, True)


def without_specks(disparity: Floats, max_pixels: int, jump_px: float) -> Floats:
    """The disparity map without islands of up to max_pixels pixels (islands: neighbours differ by at most jump_px)."""
    import cv2

    fixed = np.where(np.isfinite(disparity), disparity * 16.0, -32768.0).astype(np.int16)
    cv2.filterSpeckles(fixed, -32768, max_pixels, int(jump_px * 16))
    return np.where(fixed > -32768, disparity, np.nan).astype(np.float32)


def reported_mm(spot: Spot | None) -> int:
    """The distance of a message: whole mm from the footprint, never negative; 5000 where nothing is near."""
    return NOTHING_NEAR_MM if spot is None else int(min(max(spot.ahead_mm, 0.0), NOTHING_NEAR_MM))

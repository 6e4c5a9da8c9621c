"""From a rectified pair to facts: disparity, floor, the nearest thing each way, and whether it could be seen at all.

Decisions are made on a grid of half the picture's size (every second row and column), where pixels are plenty enough.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np

from chairward.messages import NOTHING_NEAR_MM
from chairward.stages import Floats, Image
from chairward_stereo_range import thesis
from chairward_stereo_range.drops import DropWatch
from chairward_stereo_range.floor import FloorFit, fit_floor, split
from chairward_stereo_range.geometry import THESIS_HEIGHT, View, disparity_range
from chairward_stereo_range.honesty import hidden_distance_mm, out_of_match, repeats
from chairward_stereo_range.leaving import inner_edge_mm
from chairward_stereo_range.matching import Method, make_matcher, where_known
from chairward_stereo_range.nearest import NEAR_SIDE, QUANTILE, nearest, order_statistic
from chairward_stereo_range.opencv import opencv
from chairward_stereo_range.pyramid import Match, Pyramid, half_size, islands, mean_of_four
from chairward_stereo_range.region import Bools, Region, RegionKind
from chairward_stereo_range.texture import noise_sigma, textured

UNCONFIRMED, UNCONFIRMABLE = 0.6, 0.3
"""What a proposed pixel counts that full size did not confirm, or was not asked to (outside FINE_ROWS)."""
SIDE_COVERAGE = 0.15
SPECKS = 12
"""Smaller islands (grid pixels at 240 rows) above the floor are noise of the floor itself."""
AROUND_PX = 8
"""A thing's size is counted so far (grid pixels at 240 rows) beyond the region: a part of it may stand in the way."""
HIDDEN_MARGIN = 1.15
MatchStrips = Callable[[Image, Image], Match]
FINE_ROWS = (112, 218)
"""Rows (at 240) in which the pyramid refines: the thesis' region and a margin."""


@dataclass(frozen=True, slots=True)
class Options:
    """How to measure; see the settings of the stage for what each means."""

    method: Method = "pyramid"
    region: RegionKind = "corridor"
    nearest_mm: float = 240.0
    farthest_mm: float = 3500.0
    clearance_mm: float = 60.0
    height_mm: float = 1400.0
    side_margin_mm: float = 20.0
    margin_px: float = 0.9
    min_coverage: float = 0.12
    stop_mm: float = 600.0


@dataclass(frozen=True, slots=True)
class Spot:
    """The nearest thing one way: depth_mm along the optical axis, ahead_mm from the footprint; its row and column.
    top_mm: the height of its near side's top above the floor (infinite when the mount is unknown).
    left_mm: where its inner edge is, left of the chair's middle; low_mm: height of the lowest part seen.
    """

    depth_mm: float
    ahead_mm: float
    row: int
    col: int
    pixels: int
    top_mm: float = float("inf")
    left_mm: float = 0.0
    low_mm: float = 0.0


@dataclass(frozen=True, slots=True)
class Measurement:
    """What one pair says. disparity: h x w px, NaN unknown; floor, obstacle, region: h x w bool.

    ahead, left, right: None when nothing is near that way; sides_seen: whether left and right were seen at all.
    coverage: part of the region that was matched, 0..1. drop: the edge where the floor ends.
    hidden_mm: how near (depth) something could stand in what was not matched; infinite when nothing suggests it.
    doubt: it cannot see only because something *could* be nearer than what is measured.
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
    sides_seen: tuple[bool, ...] = (True, True)
    reason: str = ""
    drop: Spot | None = None
    hidden_mm: float = float("inf")
    doubt: bool = False
    floor_fit: FloorFit = field(default_factory=FloorFit)
    sigma: float = 0.0


class RangeFinder:
    """Measures pairs of one view. Keeps nothing between frames. match: what makes disparities of its two strips."""

    def __init__(self, view: View, options: Options) -> None:
        g = view.geometry
        self.view, self.options = view, options
        self.scale = g.height_px / THESIS_HEIGHT
        half = view.footprint.half_width_mm + options.side_margin_mm
        self.region = Region(view, options.region, half, options.height_mm)
        self.top, self.bottom = self.region.top, self.region.bottom
        self.first, self.count = disparity_range(g, options.nearest_mm)
        grid = self.region.grid
        self._d_floor = np.ascontiguousarray(view.d_floor[grid])
        self._forward = np.ascontiguousarray(view.forward[grid])
        self._drops = DropWatch(view, grid, half, self.scale) if view.floor_known else None
        first, end = (int(row * self.scale) for row in FINE_ROWS)
        self._fine = (max(self.top, first) - self.top, min(self.bottom, end) - self.top)
        self._trust = np.full(self._forward.shape, UNCONFIRMABLE, np.float32)
        self._trust[self._fine[0] // 2 : self._fine[1] // 2] = UNCONFIRMED
        self.match: MatchStrips = Pyramid(self.first, self.count, self.scale, self._fine)
        self._dense = options.method == "pyramid"  # the others leave gaps by nature, which say nothing
        if not self._dense and options.method not in thesis.LIMITS:
            self.match, self._matcher = self._peer, make_matcher(options.method, self.first, self.count)

    @property
    def is_thesis(self) -> bool:
        """One of the baselines, which know neither blindness nor memory."""
        return self.options.method in thesis.LIMITS

    @property
    def horizon_row(self) -> float:
        """First row below which floor can be seen at all; the picture's height when the mount is unknown."""
        below = np.nonzero((self.view.up < 0).all(axis=1))[0]
        return float(below[0]) if self.view.floor_known and below.size else float(self.view.geometry.height_px)

    def measure(self, left: Image, right: Image, mask: Bools | None = None) -> Measurement:
        """left, right: h x w x 3 BGR of the view's size. mask: appearance's obstacles, for the thesis methods only."""
        cv2 = opencv()
        rows, cols = slice(self.top, self.bottom), slice(0, left.shape[1] // 2 * 2)
        grey_left = cv2.cvtColor(np.ascontiguousarray(left[rows, cols]), cv2.COLOR_BGR2GRAY)
        grey_right = cv2.cvtColor(np.ascontiguousarray(right[rows, cols]), cv2.COLOR_BGR2GRAY)
        return (
            self._thesis(grey_left, grey_right, mask)
            if self.is_thesis
            else self._judge(self.match(grey_left, grey_right))
        )

    def _peer(self, left: Image, right: Image) -> Match:
        """Another matcher alone, with the texture gate and speckle filter that all of them profit from."""
        found = self._matcher(left, right)
        sigma = noise_sigma(left)
        trusted = np.isfinite(found) & textured(left, sigma)
        found = where_known(found, islands(found, trusted, int(40 * self.scale**2), 1.5))
        small, fused = half_size(left), mean_of_four(found)
        texture = textured(small, noise_sigma(small))
        return Match(fused, texture, np.isfinite(fused), found, sigma, small, half_size(right))

    def _judge(self, match: Match) -> Measurement:
        v, o = self.view, self.options
        d = match.fused
        known = np.isfinite(d)
        fit = FloorFit()
        if v.floor_known:
            fit = fit_floor(d, self._d_floor, self.scale)
            floor_line = fit.apply(self._d_floor)
            floor, above, below = split(d, floor_line, v.pose.z_mm, o.clearance_mm, o.margin_px * self.scale)
        else:
            floor_line = self._d_floor
            floor, above, below = np.zeros_like(known), known, np.zeros_like(known)
        full = np.where(known, d + np.float32(v.geometry.doffs_px), np.float32(1e-3))
        depth = (v.fb / np.maximum(full, 1e-3)).astype(np.float32)
        above = islands(d, above & (depth < o.farthest_mm), round(SPECKS * self.scale**2), 2.0)
        inside = above & self.region.contains(depth)
        ahead = self._spot(full, inside, match.sharp, around=above & _around(inside, self.scale))
        region = self.region.grid_mask
        drop = self._drops.edge_mm(floor, below, d, floor_line) if self._drops is not None else None
        third = d.shape[1] // 3
        low_enough = above & self.region.passable(depth)
        left = self._spot(full, low_enough, match.sharp, slice(0, third))
        right = self._spot(full, low_enough, match.sharp, slice(d.shape[1] - third, d.shape[1]))
        enough = SIDE_COVERAGE * third * d.shape[0]
        sides_seen = tuple(
            bool(np.count_nonzero(k) >= enough) for k in (known[:, :third], known[:, d.shape[1] - third :])
        )
        coverage = float(np.count_nonzero(known & region)) / max(1, int(np.count_nonzero(region)))
        hidden = hidden_distance_mm(match, full, above, self.region, v, self.scale)
        reason, unstopped = "", ahead is None or ahead.depth_mm > o.stop_mm
        if coverage < o.min_coverage:
            reason = "too little texture to measure (a plain wall?)"
        elif unstopped and hidden <= HIDDEN_MARGIN * o.stop_mm:
            reason = f"a plain surface could be as near as {hidden:.0f} mm"
        elif unstopped and self._dense and out_of_match(match, region, floor_line, self.scale):
            reason = "something with texture cannot be matched: it could be very near"
        elif repeats(match, region & ~floor, region, self.count, self.scale):
            reason = "a repeating pattern could be nearer than it seems"
        return Measurement(
            disparity=self._whole(match.precise),
            floor=self._whole_mask(floor),
            obstacle=self._whole_mask(above),
            region=self.region.mask,
            ahead=ahead,
            left=left,
            right=right,
            coverage=coverage,
            can_see=not reason,
            sides_seen=sides_seen,
            reason=reason,
            drop=None if drop is None else self._drop_spot(*drop),
            hidden_mm=hidden,
            doubt=bool(reason) and coverage >= o.min_coverage,
            floor_fit=fit,
            sigma=match.sigma,
        )

    def _whole(self, strip: Floats) -> Floats:
        out = np.full(self.view.forward.shape, np.nan, np.float32)
        out[self.top : self.bottom, : strip.shape[1]] = strip
        return out

    def _whole_mask(self, grid: Bools) -> Bools:
        cv2 = opencv()
        out = np.zeros(self.view.forward.shape, np.uint8)
        size = (2 * grid.shape[1], 2 * grid.shape[0])
        out[self.top : self.bottom, : size[0]] = cv2.resize(grid.view(np.uint8), size, interpolation=cv2.INTER_NEAREST)
        return out.view(np.bool_)

    def _spot(
        self, full: Floats, candidates: Bools, sharp: Bools, side: slice | None = None, around: Bools | None = None
    ) -> Spot | None:
        """The nearest thing; roughly, when only looked for in the columns of one side. around: see nearest()."""
        v = self.view
        g, quantile, cols = v.geometry, QUANTILE if v.floor_known else NEAR_SIDE, side or slice(None)
        found = nearest(
            full[:, cols], candidates[:, cols], sharp[:, cols], self._forward[:, cols], self._trust[:, cols],
            g.baseline_mm, self.scale, side is not None, quantile, around,
        )  # fmt: skip
        if found is None:
            return None
        rows, columns = found.rows * 2 + self.top, (found.cols + (cols.start or 0)) * 2
        ahead = v.fb * found.distance + v.ahead_offset_mm()
        height = v.pose.z_mm + v.fb * found.depth * v.up[rows, columns]
        top, low = (float(height.max()), float(height.min())) if v.floor_known else (float("inf"), 0.0)
        inner = inner_edge_mm(v.pose.y_mm + v.fb * found.depth * v.left[rows, columns])
        at = int(order_statistic(rows, 0.5)), int(order_statistic(columns, 0.5))
        return Spot(v.fb * found.depth, ahead, *at, found.pixels, top, inner, low)

    def _drop_spot(self, distance_mm: float, grid_row: int) -> Spot:
        """The floor's end as a thing: its depth is that of the floor there."""
        v = self.view
        row, col = self.top + 2 * grid_row, v.geometry.width_px // 2
        return Spot(distance_mm / float(v.forward[row, col]), distance_mm + v.ahead_offset_mm(), row, col, 0, 0.0)

    def _thesis(self, grey_left: Image, grey_right: Image, mask: Bools | None) -> Measurement:
        """The thesis' way: NCC gated by appearance, whole pixels, no idea of blindness."""
        v = self.view
        gate = (self.region.trapezoid if mask is None else self.region.trapezoid & mask)[
            self.top : self.bottom, : grey_left.shape[1]
        ]
        limit = round(thesis.LIMITS[self.options.method] * self.scale)
        found = thesis.smoothed(thesis.ncc_disparity(grey_left, grey_right, gate, limit))
        disparity = self._whole(np.where(found > 0, found, np.nan).astype(np.float32))
        d = thesis.nearest_disparity(found, round(thesis.MIN_PIXELS * self.scale**2))
        z = thesis.distance_mm(d, v.geometry.focal_px, v.geometry.baseline_mm, v.geometry.doffs_px)
        spot = None
        if d > 0:
            rows, cols = np.nonzero(disparity == d)
            spot = Spot(z, z + v.ahead_offset_mm(), int(np.median(rows)), int(np.median(cols)), rows.size)
        return Measurement(
            disparity=disparity,
            floor=np.zeros(disparity.shape, bool),
            obstacle=np.isfinite(disparity),
            region=self.region.trapezoid,
            ahead=spot,
            left=None,
            right=None,
            coverage=1.0,
            can_see=True,
        )


def _around(inside: Bools, scale: float) -> Bools:
    """What lies within AROUND_PX of the pixels inside."""
    square = np.ones((2 * round(AROUND_PX * scale) + 1,) * 2, np.uint8)
    return np.asarray(opencv().dilate(inside.astype(np.uint8), square), bool)


def reported_mm(spot: Spot | None) -> int:
    """The distance of a message: whole mm from the footprint, never negative; 5000 where nothing is near."""
    return NOTHING_NEAR_MM if spot is None else int(min(max(spot.ahead_mm, 0.0), NOTHING_NEAR_MM))

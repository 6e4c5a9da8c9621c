"""The nearest thing among candidate pixels: found on a histogram, measured on its smoothed near side."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import numpy.typing as npt

from chairward.stages import Floats
from chairward_stereo_range.opencv import opencv
from chairward_stereo_range.pyramid import islands

BIN_PX = 0.5
WINDOW = 5
MIN_AREA_MM2 = 1200.0
"""A thing counts from about 35 x 35 mm on, whatever its distance ..."""
MIN_PIXELS = 30
"""... and from this many pixels on (full-size pixels at 240 rows)."""
QUANTILE = 0.64
"""Of the smoothed inverse distances of the chosen thing: a little to its near side."""
FLAT_PX = 0.5
"""A thing whose middle two thirds differ by less (at 240 rows) has no near side: its median counts, free of bias."""
NEAR_SIDE = 0.95
"""The same where the mount, and so what is upright, is not known: the near side of whatever slants away."""
NEAR_RAY = 0.97
"""Quantile of `forward` over the thing: where its least depth along the optical axis lies, if it stands upright."""
SMOOTH = 5
RELIEF, SLANTED_RELIEF = 1.08, 1.15
"""A thing's near side is at most this much nearer than its peak: what is nearer still, yet too small, is an error."""


@dataclass(frozen=True, slots=True)
class Nearest:
    """The nearest thing. distance: forward from the lens, depth: least along the optical axis, both in units of f B.

    pixels: its size in full-size pixels; rows, cols: its near pixels on the grid.
    """

    distance: float
    depth: float
    pixels: int
    rows: npt.NDArray[np.intp]
    cols: npt.NDArray[np.intp]


def nearest(
    disparity: Floats,
    candidates: npt.NDArray[np.bool_],
    sharp: npt.NDArray[np.bool_],
    forward: Floats,
    trust: Floats,
    baseline_mm: float,
    scale: float,
    rough: bool = False,
    quantile: float = QUANTILE,
    around: npt.NDArray[np.bool_] | None = None,
) -> Nearest | None:
    """The nearest group of candidates that is large enough to be a thing; None when there is none.

    disparity: half-size grid, full-size px with doffs added (Z = f B / d). sharp: pixels measured at full size, which
    are preferred where there are enough; trust: what the others count, 0..1. forward: rays (geometry.py), by which an
    upright thing has one distance though a tilted camera sees it at many depths. scale: rows / 240. From near to far,
    the first window of 2.5 px that holds as many pixels as a 35 x 35 mm patch would; from its peak on, what is little
    nearer belongs to it.
    rough: without the smoothing, where a centimetre or two do not matter. quantile: see QUANTILE and NEAR_SIDE.
    around: the candidates and what surrounds them, whose size counts: only a part of a thing may stand in the way.
    """
    values = disparity[candidates]
    least = MIN_PIXELS * scale * scale / 4
    if values.size < least:
        return None
    width = BIN_PX * scale
    weights = np.where(sharp, np.float32(1.0), trust)
    around = candidates if around is None else around
    bins = max(8, int(values.max() / width) + 1)
    held = _histogram(values / width, weights[candidates], bins)
    size = held if around is candidates else _histogram(disparity[around] / width, weights[around], bins)
    centre = (np.arange(bins) + 0.5) * width
    enough = np.nonzero((held >= least) & (size >= MIN_AREA_MM2 / 4 * (centre / baseline_mm) ** 2))[0]
    if enough.size == 0:
        return None
    i = int(enough[-1])
    while i > 0 and held[i - 1] > held[i]:
        i -= 1
    slack = 1.5 * scale
    relief = SLANTED_RELIEF if quantile >= NEAR_SIDE else RELIEF
    member = candidates & (disparity >= centre[i] - slack) & (disparity <= relief * centre[i] + slack)
    if rough:
        return _measured(disparity, member, forward, quantile)
    need = max(least, MIN_AREA_MM2 / 4 * (centre[i] / baseline_mm) ** 2)
    thing = around & (disparity >= centre[i] - slack) & (disparity <= relief * centre[i] + slack)
    box = _box(thing | member)
    disparity, member, sharp, forward = disparity[box], member[box], sharp[box], forward[box]
    whole = islands(disparity, thing[box], int(need), scale)
    if (whole & member).any():
        member = member & whole
    if int((member & sharp).sum()) >= min(need, int(member.sum())) / 2:
        member = member & sharp
    smooth = _smoothed(disparity, member)
    if int(np.isfinite(smooth).sum()) < least / 2:
        smooth = disparity
    found = _measured(smooth, np.isfinite(smooth) & member, forward, quantile, FLAT_PX * scale)
    return replace(found, rows=found.rows + box[0].start, cols=found.cols + box[1].start)


def _box(member: npt.NDArray[np.bool_]) -> tuple[slice, slice]:
    """The rows and columns that hold the members, and the smoothing's margin."""
    ends = []
    for axis in (1, 0):
        at = np.flatnonzero(member.any(axis=axis))
        ends.append(slice(max(0, int(at[0]) - SMOOTH // 2), int(at[-1]) + 1 + SMOOTH // 2))
    return ends[0], ends[1]


def _histogram(values: Floats, weights: Floats, bins: int) -> npt.NDArray[np.float64]:
    """Weights held by windows of WINDOW bins about each bin; what is beyond the bins counts in the last windows."""
    counts = np.bincount(np.minimum(values.astype(np.int32), bins + WINDOW), weights=weights, minlength=bins)
    return np.convolve(counts, np.ones(WINDOW), "same")[:bins]


def _measured(
    disparity: Floats, member: npt.NDArray[np.bool_], forward: Floats, quantile: float, flat_px: float = 0.0
) -> Nearest:
    rows, cols = np.nonzero(member)
    ray = forward[rows, cols]
    inverse = disparity[rows, cols] / ray
    flat = (
        flat_px > 0
        and quantile < NEAR_SIDE
        and order_statistic(inverse, 0.84) - order_statistic(inverse, 0.16) <= flat_px
    )
    chosen = order_statistic(inverse, 0.5 if flat else quantile)
    depth = 1.0 / (chosen * order_statistic(ray, NEAR_RAY))
    at = np.nonzero(inverse >= chosen)[0]
    return Nearest(1.0 / chosen, depth, 4 * rows.size, rows[at], cols[at])


def order_statistic(values: npt.NDArray[Any], q: float) -> float:
    """The value below which the part q lies: ten times faster than numpy's interpolated quantile."""
    at = int(q * (values.size - 1))
    return float(np.partition(values, at)[at])


def _smoothed(disparity: Floats, member: npt.NDArray[np.bool_]) -> Floats:
    """Mean over 5x5 members; NaN outside and where fewer than half are members (rims are the noisiest)."""
    cv2 = opencv()
    weight = member.astype(np.float32)
    total = cv2.blur(np.where(member, disparity, 0.0).astype(np.float32), (SMOOTH, SMOOTH))
    share = cv2.blur(weight, (SMOOTH, SMOOTH))
    return np.where(member & (share >= 0.5), total / np.maximum(share, 1e-6), np.nan).astype(np.float32)

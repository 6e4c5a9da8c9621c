"""What of the disparity map is floor, what stands on it, and what lies below it.

The floor's disparity is linear in the picture (see geometry.py). Mount and calibration are never exact, so offset and
slope about the nominal floor are fitted anew in every frame, robustly and within narrow bounds: a wall or a ramp can
never become the floor.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from chairward.stages import Floats

OFFSET_LIMIT = 0.8
"""px at 240 rows: how far the fitted floor may lie from the nominal one in the middle of the data."""
SLOPE_LIMIT = 0.08
MIN_PIXELS = 400
"""Fewer floor-like pixels than this (at 240 rows): the nominal floor is used."""
ENOUGH = 2500
"""Pixels that the fit looks at: more change it by less than a hundredth of a pixel."""


@dataclass(frozen=True, slots=True)
class FloorFit:
    """d_floor = nominal + offset + slope * (nominal - middle), px; pixels: how many agreed with it."""

    offset: float = 0.0
    slope: float = 0.0
    middle: float = 0.0
    pixels: int = 0

    def apply(self, nominal: Floats) -> Floats:
        """The floor's disparity where nominally it is `nominal`."""
        return np.asarray(nominal + (self.offset + self.slope * (nominal - self.middle)), np.float32)


def fit_floor(disparity: Floats, nominal: Floats, scale: float) -> FloorFit:
    """Iteratively re-weighted least squares (Cauchy weights) of offset and slope over floor-like pixels.

    disparity: px, NaN unknown; nominal: same shape. scale: rows / 240.
    """
    with np.errstate(invalid="ignore"):
        near = (np.abs(disparity - nominal) < 0.12 * nominal + 1.0 * scale) & (nominal > 0)
    at = np.flatnonzero(near)
    if at.size < MIN_PIXELS * scale * scale:
        return FloorFit(pixels=int(at.size))
    used = at[:: max(1, at.size // ENOUGH)]
    x = nominal.ravel()[used].astype(np.float64)
    residual = disparity.ravel()[used].astype(np.float64) - x
    middle = float(x.mean())
    x = x - middle
    spread = float((x * x).mean()) + 1e-6
    offset = slope = 0.0
    width = 0.25 * scale
    for _ in range(4):
        weight = 1.0 / (1.0 + ((residual - offset - slope * x) / width) ** 2)
        leaning = weight * x
        first = float(leaning.sum())
        offset = (float(weight @ residual) - slope * first) / float(weight.sum())
        slope = (float(leaning @ residual) - offset * first) / (float(leaning @ x) + 1e-6 * spread)
    return FloorFit(
        offset=float(np.clip(offset, -OFFSET_LIMIT * scale, OFFSET_LIMIT * scale)),
        slope=float(np.clip(slope, -SLOPE_LIMIT, SLOPE_LIMIT)),
        middle=middle,
        pixels=int(at.size),
    )


def split(
    disparity: Floats, floor: Floats, z_mm: float, clearance_mm: float, margin_px: float
) -> tuple[npt.NDArray[np.bool_], npt.NDArray[np.bool_], npt.NDArray[np.bool_]]:
    """(floor, above, below) masks of a disparity map (NaN: in none of them).

    A point clearance_mm above the floor, seen under the same angle, has z / (z - clearance) times the floor's
    disparity. margin_px covers matching errors on both sides.
    """
    with np.errstate(invalid="ignore"):
        high = np.maximum(floor, 0.0) * np.float32(z_mm / max(z_mm - clearance_mm, 1.0)) + np.float32(margin_px)
        above = disparity > high
        below = disparity < np.maximum(floor, 0.0) * np.float32(z_mm / (z_mm + clearance_mm)) - np.float32(margin_px)
        below &= floor > 0
        known = np.isfinite(disparity)
    return known & ~above & ~below & (floor > 0), above, below

"""The nearest thing among many pixels: one decision, made on a histogram of their disparities."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from chairward.stages import Floats

BIN_PX = 0.5
WINDOW = 5
MIN_AREA_MM2 = 1200.0
"""A thing counts from about 35 x 35 mm on, whatever its distance."""
MIN_PIXELS = 30
"""... and from this many pixels on (at 240 rows)."""
QUANTILE = 0.85
"""Of the disparities of the chosen thing: its near side, not its middle (the truth is its nearest surface)."""


@dataclass(frozen=True, slots=True)
class Nearest:
    """The nearest thing: disparity (px, doffs included), how many pixels hold it, and which of the candidates."""

    disparity_px: float
    pixels: int
    chosen: npt.NDArray[np.bool_]


def nearest(disparity: Floats, baseline_mm: float, scale: float, quantile: float = QUANTILE) -> Nearest | None:
    """The largest disparity that enough candidates agree on; None when none is held by enough.

    disparity: 1-d, px with doffs added (so that Z = f B / d); scale: rows / 240. From near to far, the first window of
    2.5 px that holds the pixels a 35 x 35 mm patch would have there; then up to its peak.
    """
    least = MIN_PIXELS * scale * scale
    if disparity.size < least:
        return None
    width = BIN_PX * scale
    counts = np.bincount((disparity / width).astype(np.int32), minlength=8)
    held = np.convolve(counts, np.ones(WINDOW, np.int64), "same")
    centre = (np.arange(counts.size) + 0.5) * width
    enough = np.nonzero(held >= np.maximum(least, MIN_AREA_MM2 * (centre / baseline_mm) ** 2))[0]
    if enough.size == 0:
        return None
    i = int(enough[-1])
    while i > 0 and held[i - 1] > held[i]:
        i -= 1
    chosen = np.abs(disparity - centre[i]) <= 1.5 * scale
    values = disparity[chosen]
    return Nearest(float(np.quantile(values, quantile)), int(values.size), chosen)

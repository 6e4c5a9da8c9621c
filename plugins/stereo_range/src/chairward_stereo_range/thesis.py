"""The thesis' own stereo, kept as a baseline (thesis section 4): NCC without mean subtraction, gated by appearance.

The right picture is the template: a right pixel (y, x) is compared with the left at (y, x + d), d = 0..limit, and ties
take the smaller d. The mask was made on the left picture but is applied at the right picture's coordinates.
`thesis_code` searches 0..25 as the program does, `thesis_text` 0..30 as the text allows.
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from chairward.messages import NOTHING_NEAR_MM
from chairward.stages import Image
from chairward_stereo_range.opencv import opencv

HALF_WINDOW = 4
LIMITS = {"thesis_code": 25, "thesis_text": 30}
MIN_PIXELS = 3 * 25


def ncc_disparity(
    left: Image, right: Image, mask: npt.NDArray[np.bool_], limit: int, half: int = HALF_WINDOW
) -> npt.NDArray[np.uint8]:
    """Whole-pixel disparities 0..limit where mask is set (right picture's coordinates), elsewhere 0.

    left, right: h x w grey uint8. Windows that leave either picture are not considered.
    """
    cv2 = opencv()
    h, w = left.shape
    out = np.zeros((h, w), np.uint8)
    rows = np.nonzero(mask.any(axis=1))[0]
    if rows.size == 0:
        return out
    top, bottom = max(0, int(rows[0]) - half), min(h, int(rows[-1]) + half + 1)
    a, b = left[top:bottom].astype(np.float64), right[top:bottom].astype(np.float64)
    side = (2 * half + 1, 2 * half + 1)

    def box(x: npt.NDArray[np.float64]) -> npt.NDArray[np.float64]:
        return np.asarray(cv2.boxFilter(x, cv2.CV_64F, side, normalize=False, borderType=cv2.BORDER_CONSTANT))

    aa, bb = box(a * a), box(b * b)
    best = np.full(a.shape, -1.0)
    found = np.zeros(a.shape, np.uint8)
    for d in range(min(limit, w - 1) + 1):
        n = w - d
        score = box(a[:, d:] * b[:, :n]) / np.sqrt(aa[:, d:] * bb[:, :n] + 1e-12)
        score[:, max(0, n - half) :] = -2.0
        better = score > best[:, :n] + 1e-12
        best[:, :n][better] = score[better]
        found[:, :n][better] = d
    out[top:bottom] = found
    out[:, :half] = 0
    out[:, w - half :] = 0
    out[:half] = 0
    out[h - half :] = 0
    out[~mask] = 0
    return out


def smoothed(disparity: npt.NDArray[np.uint8]) -> npt.NDArray[np.uint8]:
    """The thesis' 5x5 median of the disparity map."""
    cv2 = opencv()
    return np.asarray(cv2.medianBlur(disparity, 5), np.uint8)


def nearest_disparity(disparity: npt.NDArray[np.uint8], min_pixels: int = MIN_PIXELS) -> int:
    """The largest disparity held by more than min_pixels pixels; 0 when there is none."""
    counts = np.bincount(disparity.ravel(), minlength=256)
    counts[0] = 0
    held = np.nonzero(counts > min_pixels)[0]
    return int(held[-1]) if held.size else 0


def distance_mm(d: int, focal_px: float, baseline_mm: float, doffs_px: float = 0.0) -> float:
    """Z = f B / d; 5000 mm ("no obstacle") for d = 0."""
    return focal_px * baseline_mm / (d + doffs_px) if d > 0 else float(NOTHING_NEAR_MM)

"""Is there enough texture to match? Measured against the picture's own noise: grain is not texture."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from chairward.stages import Image
from chairward_stereo_range.opencv import opencv

WINDOW = 9
MIN_STD = 2.2
NOISE_FACTOR = 1.6


def noise_sigma(grey: Image) -> float:
    """Standard deviation of the noise, grey levels (Immerkaer 1996, with the median instead of the mean)."""
    cv2 = opencv()
    kernel = np.array([[1, -2, 1], [-2, 4, -2], [1, -2, 1]], np.float32)
    residual = cv2.filter2D(grey[::2], cv2.CV_16S, kernel)
    return float(np.median(np.abs(residual[:, ::2]))) / (0.6745 * 6.0)


def textured(grey: Image, sigma: float) -> npt.NDArray[np.bool_]:
    """Where the standard deviation of 9x9 windows is above both a floor and the noise."""
    cv2 = opencv()
    side = (WINDOW, WINDOW)
    mean = cv2.boxFilter(grey, cv2.CV_32F, side)
    power = cv2.sqrBoxFilter(grey, cv2.CV_32F, side)
    limit = max(MIN_STD, NOISE_FACTOR * sigma)
    return np.asarray(power - mean * mean > limit * limit)


BAND_ROWS = 6
"""Rows (of the half-size picture) averaged before looking for a period: stripes stand, bricks and planks nearly so."""
PERIOD_WINDOW = 25
ALIKE, UNLIKE = 0.35, 0.8
"""Mean difference from the shifted self, relative to the mean difference from the local mean."""


def periodic(small: Image, most_px: int, sigma: float) -> npt.NDArray[np.bool_]:
    """Where the picture repeats along its rows within the disparities searched, so that a match proves little.

    small: the half-size left strip. most_px: largest shift tried. A place repeats when shifted by some distance it is
    like itself again, having been unlike itself at a smaller one.
    """
    h, w = small.shape
    bands = h // BAND_ROWS
    if bands == 0:
        return np.zeros((h, w), bool)
    cv2 = opencv()
    profile = small[: bands * BAND_ROWS].reshape(bands, BAND_ROWS, w).mean(axis=1, dtype=np.float32)
    side = (PERIOD_WINDOW, 1)
    contrast = cv2.blur(np.abs(profile - cv2.blur(profile, side)), side)
    ahead = np.full((bands, w + most_px), 1e6, np.float32)
    ahead[:, :w] = profile
    moved = np.lib.stride_tricks.sliding_window_view(ahead, w, axis=1)[:, 2 : most_px + 1]
    difference = cv2.blur(np.abs(moved - profile[:, None]).reshape(-1, w), side).reshape(moved.shape)
    unlike = (difference > UNLIKE * contrast[:, None]) & (difference < 1e3)
    since = np.where(unlike.any(axis=1), unlike.argmax(axis=1), most_px)
    alike = (difference < ALIKE * contrast[:, None]) & (np.arange(moved.shape[1])[:, None] > since[:, None])
    found = alike.any(axis=1) & (contrast > max(1.5, sigma))
    out = np.zeros((h, w), bool)
    out[: bands * BAND_ROWS] = np.repeat(found, BAND_ROWS, axis=0)
    return out

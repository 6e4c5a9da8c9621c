"""Is there enough texture to match? Measured against the picture's own noise: grain is not texture."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from chairward.stages import Image

WINDOW = 9
MIN_STD = 2.2
NOISE_FACTOR = 1.6


def noise_sigma(grey: Image) -> float:
    """Standard deviation of the noise, grey levels (Immerkaer 1996, with the median instead of the mean)."""
    import cv2

    kernel = np.array([[1, -2, 1], [-2, 4, -2], [1, -2, 1]], np.float32)
    residual = cv2.filter2D(grey[::2], cv2.CV_16S, kernel)
    return float(np.median(np.abs(residual[:, ::2]))) / (0.6745 * 6.0)


def textured(grey: Image, sigma: float) -> npt.NDArray[np.bool_]:
    """Where the standard deviation of 9x9 windows is above both a floor and the noise."""
    import cv2

    side = (WINDOW, WINDOW)
    mean = cv2.boxFilter(grey, cv2.CV_32F, side)
    power = cv2.sqrBoxFilter(grey, cv2.CV_32F, side)
    limit = max(MIN_STD, NOISE_FACTOR * sigma)
    return np.asarray(power - mean * mean > limit * limit)

"""Thin things lying on the floor (cables, edges), too flat for stereo: seen from above, where they are equally thin.

What is thinner than THIN_MM and stands out, darker or brighter, far more than anything the floor's own pattern
does, and goes on for LONG_MM. On a floor with joints, planks or a fine pattern nothing stands out: nothing is said.
"""

from __future__ import annotations

import cv2
import numpy as np
import numpy.typing as npt

from chairward_vision_obstacle.birdseye import CELL_MM

Grey = npt.NDArray[np.uint8]
Bools = npt.NDArray[np.bool_]

THIN_MM = 60.0
LONG_MM = 250.0
ACROSS_MM = 150.0
"""So far must it reach across the way: legs, poles and their reflections run along it."""
MIN_CONTRAST = 8.0
"""Grey levels: a thin thing shows at least so many."""
OUTSTANDING = 3.0
"""So many times the floor's own 90th percentile of thin contrast must a thin thing show."""
MAX_SHARE = 0.12
"""Thin things that cover more of the floor than this are its pattern."""


def thin_things(grey: Grey, floor: Bools) -> Bools:
    """Where a thin thing lies. grey: floor from above; floor: cells that are in view and not measured as raised."""
    size = int(THIN_MM / CELL_MM) | 1
    kernel = cv2.getStructuringElement(cv2.MORPH_ELLIPSE, (size, size))
    smooth = cv2.GaussianBlur(grey, (3, 3), 0)
    found = np.zeros(grey.shape, np.bool_)
    for operation in (cv2.MORPH_BLACKHAT, cv2.MORPH_TOPHAT):
        contrast = np.asarray(cv2.morphologyEx(smooth, operation, kernel), np.uint8)
        on_floor = contrast[floor]
        if on_floor.size < 200:
            continue
        limit = max(MIN_CONTRAST, OUTSTANDING * level(on_floor, 0.9))
        strong = (contrast >= limit) & floor
        if strong.sum() <= MAX_SHARE * on_floor.size:
            found |= strong
    return _long_ones(found)


def level(grey: Grey, share: float) -> int:
    """The grey level that `share` of the pixels do not exceed."""
    counts = np.cumsum(np.bincount(grey.ravel(), minlength=256))
    return int(np.searchsorted(counts, share * counts[-1]))


def _long_ones(found: Bools) -> Bools:
    """Only the connected parts that are long and thin."""
    count, labels, stats, _ = cv2.connectedComponentsWithStats(found.astype(np.uint8), connectivity=8)
    keep = np.zeros(count, np.bool_)
    for label in range(1, count):
        length_mm = float(np.hypot(stats[label, cv2.CC_STAT_WIDTH], stats[label, cv2.CC_STAT_HEIGHT])) * CELL_MM
        thickness_mm = float(stats[label, cv2.CC_STAT_AREA]) * CELL_MM * CELL_MM / length_mm
        across_mm = float(stats[label, cv2.CC_STAT_WIDTH]) * CELL_MM
        keep[label] = length_mm >= LONG_MM and across_mm >= ACROSS_MM and thickness_mm <= THIN_MM
    return np.asarray(keep[labels], np.bool_)

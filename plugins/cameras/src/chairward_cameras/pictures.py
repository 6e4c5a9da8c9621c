"""Reading picture files and measuring the truth of rendered ones."""

from __future__ import annotations

from functools import cache
from pathlib import Path
from typing import cast

import cv2
import numpy as np
import numpy.typing as npt

from chairward.components import DeviceLost
from chairward.stages import Image, StereoGeometry
from chairward_cameras.shots import Optics, Shot

TRUTH_PIXELS = 75
"""The truth is the depth of the 75th nearest pixel that is not floor, as in the manifests' nearest_in_roi_mm."""


def read(path: Path, flags: int = cv2.IMREAD_COLOR) -> npt.NDArray[np.uint8]:
    """The picture, BGR unless flags say otherwise. Raises DeviceLost with the file's name."""
    image = cv2.imread(str(path), flags)
    if image is None:
        raise DeviceLost(f"{path}: this picture cannot be read (missing, cut short, or no picture): replace the file")
    return cast("npt.NDArray[np.uint8]", image)


def pair(shot: Shot, width_px: int | None) -> tuple[Image, Image, StereoGeometry | None]:
    """Both pictures, resized when a width is given, and their geometry. Raises DeviceLost."""
    left, right = read(shot.left), read(shot.right)
    if left.shape != right.shape:
        raise DeviceLost(
            f"{shot.right}: the right picture is {right.shape[1]}x{right.shape[0]}, but the left one "
            f"({shot.left.name}) is {left.shape[1]}x{left.shape[0]}: both must have one size"
        )
    stored = left.shape[1]
    if width_px is not None and width_px != stored:
        size = (width_px, round(left.shape[0] * width_px / stored))
        how = cv2.INTER_AREA if width_px < stored else cv2.INTER_LINEAR
        left = cast("Image", cv2.resize(left, size, interpolation=how))
        right = cast("Image", cv2.resize(right, size, interpolation=how))
    if shot.optics is None:
        return left, right, None
    return left, right, geometry(shot.optics, left.shape[1], left.shape[0], left.shape[1] / stored)


def geometry(optics: Optics, width_px: int, height_px: int, scale: float = 1.0) -> StereoGeometry:
    """Optics of stored pictures, scaled to `width_px`; the axis goes through the middle of the picture."""
    return StereoGeometry(
        focal_px=optics.focal_px * scale,
        baseline_mm=optics.baseline_mm,
        cx_px=(width_px - 1) / 2,
        cy_px=(height_px - 1) / 2,
        width_px=width_px,
        height_px=height_px,
        doffs_px=optics.doffs_px * scale,
    )


def truth_mm(shot: Shot) -> float | None:
    """Depth from the camera of the nearest thing in the navigation region, as far as anyone knows it."""
    if shot.truth_mm is not None or shot.depth is None or shot.ids is None:
        return shot.truth_mm
    depth = read(shot.depth, cv2.IMREAD_UNCHANGED)
    ids = read(shot.ids, cv2.IMREAD_UNCHANGED)
    things = navigation_region(depth.shape[1], depth.shape[0]) & (ids > 1) & (depth < np.iinfo(np.uint16).max)
    found = np.sort(depth[things])
    return float(found[TRUTH_PIXELS - 1]) if found.size >= TRUTH_PIXELS else None


@cache
def navigation_region(width_px: int, height_px: int) -> npt.NDArray[np.bool_]:
    """The trapezoid in which manifests state their truth (thesis section 4), scaled to the picture's height."""
    region = np.zeros((height_px, width_px), np.bool_)
    scale = height_px / 240
    for row in range(int(120 * scale), int(210 * scale)):
        widening = row - 120 * scale
        region[row, max(0, int(100 * scale - widening)) : min(width_px, int(200 * scale + widening))] = True
    return region

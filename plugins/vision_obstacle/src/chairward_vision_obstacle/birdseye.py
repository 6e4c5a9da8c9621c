"""The floor just ahead as seen from above: there a cable is equally wide everywhere, and driving is a plain shift."""

from __future__ import annotations

from typing import NamedTuple

import cv2
import numpy as np
import numpy.typing as npt

from chairward.components import Pose
from chairward.stages import Image, StereoGeometry

CELL_MM = 10.0
LENGTH_MM = 600.0
SURE = 0.4
"""Phase correlation's response under which a shift is not believed (textured floors: 0.5 to 0.9)."""
ENOUGH_FLOOR = 0.6
"""With less of the grid measured free of raised things the floor's motion is not asked for."""
TEXTURE = 1.0
"""Grey levels of detail (15 to 50 mm) under which there is only noise to correlate."""

Floats32 = npt.NDArray[np.float32]


class Shift(NamedTuple):
    """How the floor has moved since the last picture, mm: the chair drove forward_mm, and left_mm to the left."""

    forward_mm: float
    left_mm: float


class BirdsEye:
    """Warps pictures of one geometry to a grid of CELL_MM cells: row 0 is the far edge, column 0 the left one.

    near_mm: forward distance from the lens at which the grid begins (its last row); half_width_mm to each side.
    """

    def __init__(self, geometry: StereoGeometry, pose: Pose, near_mm: float, half_width_mm: float) -> None:
        self.rows, self.columns = round(LENGTH_MM / CELL_MM), 2 * round(half_width_mm / CELL_MM)
        self.near_mm = near_mm
        corners_mm = [
            (near_mm + LENGTH_MM, half_width_mm),
            (near_mm + LENGTH_MM, -half_width_mm),
            (near_mm, -half_width_mm),
            (near_mm, half_width_mm),
        ]
        grid = [(0, 0), (self.columns, 0), (self.columns, self.rows), (0, self.rows)]
        pixels = [_pixel(geometry, pose, *corner) for corner in corners_mm]
        self._to_grid = cv2.getPerspectiveTransform(np.array(pixels, np.float32), np.array(grid, np.float32))
        self._window = cv2.createHanningWindow((self.columns, self.rows), cv2.CV_32F)
        self._last: Floats32 | None = None

    def look(self, image: Image) -> npt.NDArray[np.uint8]:
        """The floor from above, grid rows x columns x 3 BGR. image: of the geometry's size."""
        return np.asarray(cv2.warpPerspective(image, self._to_grid, (self.columns, self.rows)), np.uint8)

    def look_mask(self, mask: npt.NDArray[np.bool_]) -> npt.NDArray[np.bool_]:
        """A mask of the geometry's size from above; outside the picture nothing is set."""
        return np.asarray(self.look(mask.astype(np.uint8)) > 0, np.bool_)

    def back(self, cells: npt.NDArray[np.bool_], height: int, width: int) -> npt.NDArray[np.bool_]:
        """Grid cells as a mask of a picture of that size."""
        flags = cv2.INTER_NEAREST | cv2.WARP_INVERSE_MAP
        return np.asarray(cv2.warpPerspective(cells.astype(np.uint8), self._to_grid, (width, height), flags=flags) > 0)

    def valid(self, height: int, width: int) -> npt.NDArray[np.bool_]:
        """Which grid cells lie inside a picture of that size."""
        inside = np.full((height, width), 255, np.uint8)
        return np.asarray(cv2.warpPerspective(inside, self._to_grid, (self.columns, self.rows)) > 254, np.bool_)

    def shift(self, above: npt.NDArray[np.uint8], floor: npt.NDArray[np.bool_]) -> Shift | None:
        """The floor's motion since the last call, None when it cannot be told (first picture, a plain floor).

        floor: cells that belong to the floor.
        """
        grey = cv2.cvtColor(above, cv2.COLOR_BGR2GRAY).astype(np.float32)
        share = float(floor.mean())
        if share < 1.0 and share > 0.0:
            grey[~floor] = grey[floor].mean()  # what stands up seems to move faster than the floor
        last, self._last = self._last, np.asarray(grey, np.float32)
        detail = cv2.GaussianBlur(grey, (0, 0), 1.5) - cv2.GaussianBlur(grey, (0, 0), 5)
        if last is None or share < ENOUGH_FLOOR or float(detail.std()) < TEXTURE:
            return None
        (right, down), response = cv2.phaseCorrelate(last, self._last, self._window)
        if response < SURE:
            return None
        return Shift(forward_mm=down * CELL_MM, left_mm=right * CELL_MM)


def _pixel(geometry: StereoGeometry, pose: Pose, forward_mm: float, left_mm: float) -> tuple[float, float]:
    """Column, row where the floor point forward_mm ahead of the lens and left_mm of the chair's middle is seen."""
    roll, pitch, yaw = np.radians([pose.roll_deg, pose.pitch_deg, pose.yaw_deg])
    left_mm -= pose.y_mm
    ahead = np.cos(yaw) * forward_mm + np.sin(yaw) * left_mm
    right = np.sin(yaw) * forward_mm - np.cos(yaw) * left_mm
    depth = np.cos(pitch) * ahead + np.sin(pitch) * pose.z_mm
    down = np.cos(pitch) * pose.z_mm - np.sin(pitch) * ahead
    x, y = right / depth, down / depth
    x, y = np.cos(roll) * x + np.sin(roll) * y, -np.sin(roll) * x + np.cos(roll) * y
    return float(x * geometry.focal_px + geometry.cx_px), float(y * geometry.focal_px + geometry.cy_px)

"""Where the picture's pixels lie on the floor, seen from the chair. One picture size, one mount: computed once.

Chair frame: x forward, y left, z up, mm. A pixel with depth Z is the point pose + Z * ray; it lies on the floor where
pose.z + Z * ray_up = 0. Distances are forward from the footprint's front edge.
"""

from __future__ import annotations

from dataclasses import dataclass
from math import cos, radians, sin

import numpy as np
import numpy.typing as npt

from chairward.components import Footprint, Pose
from chairward.stages import Floats, StereoGeometry

Bools = npt.NDArray[np.bool_]

FAR_MM = 4000.0
"""Floor farther than this is neither learned from nor judged."""


@dataclass(frozen=True, slots=True)
class Ground:
    """forward_mm, left_mm: of each pixel's floor point, h x w float32, inf where the pixel sees no floor.

    seen: floor within FAR_MM could be seen there. corridor: and the chair's footprint will sweep it.
    forward_ray: forward component of each pixel's ray per mm of depth; offset_mm is added to turn a distance from the
    lens into one from the footprint. nearest_mm: distance of the floor at the corridor's lowest visible row.
    bottom: row below which nothing of the corridor is seen (exclusive).
    """

    forward_mm: Floats
    left_mm: Floats
    seen: Bools
    corridor: Bools
    forward_ray: Floats
    left_ray: Floats
    offset_mm: float
    horizon_row: int
    nearest_mm: float
    bottom: int

    @property
    def shape(self) -> tuple[int, int]:
        """Rows, columns."""
        rows, columns = self.forward_mm.shape
        return rows, columns


def make_ground(
    geometry: StereoGeometry, pose: Pose, footprint: Footprint, size: tuple[int, int], margin_mm: float
) -> Ground:
    """The floor as a picture of size (width, height) sees it; geometry may belong to another size.

    margin_mm: added to the footprint on each side. Raises ValueError when the camera is not above the floor.
    """
    if pose.z_mm <= 0:
        raise ValueError("the camera's height is not known: set the lane's pose.z_mm in the chair file")
    width, height = size
    scale_x, scale_y = geometry.width_px / width, geometry.height_px / height
    x = ((np.arange(width, dtype=np.float32) + 0.5) * scale_x - 0.5 - geometry.cx_px) / geometry.focal_px
    y = ((np.arange(height, dtype=np.float32) + 0.5) * scale_y - 0.5 - geometry.cy_px) / geometry.focal_px
    right, down = np.meshgrid(x, y)
    roll, pitch, yaw = radians(pose.roll_deg), radians(pose.pitch_deg), radians(pose.yaw_deg)
    right, down = cos(roll) * right - sin(roll) * down, sin(roll) * right + cos(roll) * down
    level, up = cos(pitch) - down * sin(pitch), -sin(pitch) - down * cos(pitch)
    forward_ray, left_ray = cos(yaw) * level + sin(yaw) * right, sin(yaw) * level - cos(yaw) * right
    offset = pose.x_mm - footprint.front_mm
    with np.errstate(divide="ignore", invalid="ignore"):
        depth = np.where(up < 0, pose.z_mm / -up, np.inf)
        forward = np.where(up < 0, depth * forward_ray + offset, np.inf).astype(np.float32)
        left = np.where(up < 0, depth * left_ray + pose.y_mm, np.inf).astype(np.float32)
    seen = (up < 0) & (forward < FAR_MM)
    corridor = seen & (np.abs(left) <= footprint.half_width_mm + margin_mm)
    rows = np.nonzero(corridor.any(axis=1))[0]
    below = np.nonzero((up < 0).all(axis=1))[0]
    bottom = int(rows[-1]) + 1 if rows.size else height
    nearest = float(np.median(forward[bottom - 1][corridor[bottom - 1]])) if rows.size else float("inf")
    return Ground(
        forward,
        left,
        seen,
        corridor,
        forward_ray.astype(np.float32),
        left_ray.astype(np.float32),
        offset,
        int(below[0]) if below.size else height,
        nearest,
        bottom,
    )

"""Where each pixel of the rectified left picture looks, seen from the chair.

Chair frame: x forward, y left, z up, millimetres, origin on the floor below the middle of the drive axle.
A pixel with depth Z (along the optical axis) is the point  pose + Z * ray,  ray being its direction per unit of depth.
From it follow, in one place: the distance from the footprint, the corridor that the footprint sweeps, and the floor.

Floor law: a floor point has  z_mm + Z * ray_up = 0  and  Z = f B / (d + doffs), so its disparity is linear in the
picture:  d_floor = f B (-ray_up) / z_mm - doffs.
"""

from __future__ import annotations

from dataclasses import dataclass
from math import cos, inf, radians, sin

import numpy as np
import numpy.typing as npt

from chairward.components import Footprint, Pose
from chairward.stages import Floats, StereoGeometry

THESIS_WIDTH, THESIS_HEIGHT = 320, 240
"""The picture size in which the thesis gives rows and columns."""


def scaled(geometry: StereoGeometry, width_px: int, height_px: int) -> StereoGeometry:
    """The same cameras seen in pictures of another size; the aspect is kept by the caller (one scale, by width)."""
    k = width_px / geometry.width_px
    return StereoGeometry(
        focal_px=geometry.focal_px * k,
        baseline_mm=geometry.baseline_mm,
        cx_px=(geometry.cx_px + 0.5) * k - 0.5,
        cy_px=(geometry.cy_px + 0.5) * height_px / geometry.height_px - 0.5,
        width_px=width_px,
        height_px=height_px,
        doffs_px=geometry.doffs_px * k,
    )


def working_size(width_px: int, height_px: int, target_height_px: int) -> tuple[int, int]:
    """Width and height of the working picture: the target's height, the source's aspect, an even width."""
    if height_px == target_height_px:
        return width_px, height_px
    return max(2, round(width_px * target_height_px / height_px / 2) * 2), target_height_px


def disparity_range(geometry: StereoGeometry, nearest_mm: float, farthest_mm: float = inf) -> tuple[int, int]:
    """(smallest, count) of whole disparities to search: from farthest_mm to nearest_mm; count is a multiple of 16.

    With doffs, infinity lies at -doffs. A baseline so wide that nearest_mm cannot be in both pictures is searched to
    two fifths of the picture's width only.
    """
    fb = geometry.focal_px * geometry.baseline_mm
    low = int(np.floor(fb / farthest_mm - geometry.doffs_px))
    high = min(fb / nearest_mm - geometry.doffs_px, low + 0.4 * geometry.width_px)
    return low, max(16, int(np.ceil((high - low) / 16)) * 16)


def thesis_trapezoid(width_px: int, height_px: int) -> npt.NDArray[np.bool_]:
    """The thesis' navigation region (section 4): rows 120..210, columns 100-k..200+k, scaled to the picture."""
    mask = np.zeros((height_px, width_px), bool)
    s = height_px / THESIS_HEIGHT
    middle = (width_px - THESIS_WIDTH * s) / 2
    for row in range(int(120 * s), int(210 * s)):
        k = row - 120 * s
        mask[row, max(0, int(middle + 100 * s - k)) : min(width_px, int(middle + 200 * s + k))] = True
    return mask


def rays(geometry: StereoGeometry, pose: Pose) -> tuple[Floats, Floats, Floats]:
    """(forward, left, up) of every pixel's direction per unit of depth, each h x w, in the chair frame."""
    x = (np.arange(geometry.width_px, dtype=np.float32) - geometry.cx_px) / geometry.focal_px
    y = (np.arange(geometry.height_px, dtype=np.float32) - geometry.cy_px) / geometry.focal_px
    right, down = np.meshgrid(x, y)
    r, p, w = radians(pose.roll_deg), radians(pose.pitch_deg), radians(pose.yaw_deg)
    right, down = cos(r) * right - sin(r) * down, sin(r) * right + cos(r) * down
    level = cos(p) - down * sin(p)
    up = -sin(p) - down * cos(p)
    forward = cos(w) * level + sin(w) * right
    left = sin(w) * level - cos(w) * right
    return forward.astype(np.float32), left.astype(np.float32), up.astype(np.float32)


@dataclass(frozen=True, slots=True)
class View:
    """One pair of cameras on one chair: everything that does not change from frame to frame.

    forward, left, up: rays (see the module). d_floor: disparity of the floor in every pixel (0 above the horizon),
    all zero when the mount is unknown (floor_known False). fb: focal length times baseline, px mm.
    """

    geometry: StereoGeometry
    pose: Pose
    footprint: Footprint
    forward: Floats
    left: Floats
    up: Floats
    d_floor: Floats
    floor_known: bool

    @property
    def fb(self) -> float:
        """Focal length times baseline, px mm."""
        return self.geometry.focal_px * self.geometry.baseline_mm

    def depth_mm(self, disparity_px: Floats | float) -> Floats:
        """Depth along the optical axis of a disparity (px, without doffs)."""
        return np.asarray(self.fb / np.maximum(np.asarray(disparity_px) + self.geometry.doffs_px, 1e-3), np.float32)

    def ahead_offset_mm(self) -> float:
        """What is added to the forward distance from the lens to get the distance from the footprint's front edge."""
        return self.pose.x_mm - self.footprint.front_mm


def make_view(geometry: StereoGeometry, pose: Pose, footprint: Footprint) -> View:
    """The view of a rectified left camera at `pose`. pose.z_mm 0 means that the mount is unknown: no floor is known."""
    forward, left, up = rays(geometry, pose)
    known = pose.z_mm > 0
    fb = geometry.focal_px * geometry.baseline_mm
    floor = np.maximum(fb * -up / pose.z_mm - geometry.doffs_px, -geometry.doffs_px) if known else np.zeros_like(up)
    return View(geometry, pose, footprint, forward, left, up, floor.astype(np.float32), known)

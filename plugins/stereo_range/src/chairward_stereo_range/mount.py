"""Height, pitch and roll of the cameras, from the floor itself.

The floor's disparity is a plane in the picture, d + doffs = a + b y + c x with x, y in focal lengths from the
principal point; a = f B sin(pitch) / h, b = f B cos(pitch) cos(roll) / h, c = f B cos(pitch) sin(roll) / h.
The plane is found by RANSAC; as nothing lies below a floor, what lies below a proposal counts against it.
"""

from __future__ import annotations

from dataclasses import dataclass
from math import atan2, degrees, hypot

import numpy as np

from chairward.components import Pose
from chairward.stages import Floats, StereoGeometry

PROPOSALS = 400
MAX_PITCH_DEG = 40.0
MAX_ROLL_DEG = 5.0
Z_RANGE_MM = (80.0, 2000.0)
MIN_SHARE = 0.1
"""Of the measured pixels below the middle of the picture: fewer on the plane than this is no floor."""


@dataclass(frozen=True, slots=True)
class Mount:
    """A camera above a floor. share: part of the measured lower pixels that lie on the floor."""

    z_mm: float
    pitch_deg: float
    roll_deg: float
    share: float

    def pose(self, at: Pose) -> Pose:
        """`at` with this height, pitch and roll."""
        return Pose(
            x_mm=at.x_mm,
            y_mm=at.y_mm,
            z_mm=self.z_mm,
            yaw_deg=at.yaw_deg,
            pitch_deg=self.pitch_deg,
            roll_deg=self.roll_deg,
        )


def estimate_mount(disparities: list[Floats], geometry: StereoGeometry) -> Mount | None:
    """The mount from disparity maps (h x w px, NaN unknown) of one camera pair; None when no floor is found."""
    samples = [_lower_pixels(d, geometry) for d in disparities]
    x, y, d = (np.concatenate([s[i] for s in samples]) for i in range(3))
    if d.size < 500:
        return None
    rng = np.random.default_rng(0)
    if d.size > 8000:
        keep = rng.choice(d.size, 8000, replace=False)
        x, y, d = x[keep], y[keep], d[keep]
    tolerance = 0.5 * geometry.height_px / 240
    best, best_score = (0.0, 0.0), -np.inf
    fb = geometry.focal_px * geometry.baseline_mm
    for i, j in rng.integers(0, d.size, (PROPOSALS, 2)):
        if abs(y[i] - y[j]) < 0.05:
            continue
        b = (d[i] - d[j]) / (y[i] - y[j])
        a = d[i] - b * y[i]
        height = fb / hypot(a, b)
        if b <= 0 or not Z_RANGE_MM[0] < height < Z_RANGE_MM[1] or abs(degrees(atan2(a, b))) > MAX_PITCH_DEG:
            continue
        residual = d - a - b * y
        score = int((np.abs(residual) < tolerance).sum()) - 2 * int((residual < -3 * tolerance).sum())
        if score > best_score:
            best, best_score = (a, b), score
    if best_score <= MIN_SHARE * d.size:
        return None
    on = np.abs(d - best[0] - best[1] * y) < 2 * tolerance
    for _ in range(3):
        design = np.stack([np.ones(int(on.sum())), y[on], x[on]], axis=1)
        a, b, c = np.linalg.lstsq(design, d[on], rcond=None)[0]
        on = np.abs(d - a - b * y - c * x) < 1.5 * tolerance
    level = hypot(b, c)
    found = Mount(
        z_mm=float(fb / hypot(a, level)),
        pitch_deg=degrees(atan2(a, level)),
        roll_deg=degrees(atan2(c, b)),
        share=float(on.mean()),
    )
    sane = Z_RANGE_MM[0] < found.z_mm < Z_RANGE_MM[1] and abs(found.pitch_deg) <= MAX_PITCH_DEG
    return found if sane and abs(found.roll_deg) < MAX_ROLL_DEG and found.share >= MIN_SHARE else None


def _lower_pixels(disparity: Floats, geometry: StereoGeometry) -> tuple[Floats, Floats, Floats]:
    """(x, y, disparity with doffs) of the known pixels below the middle, in focal lengths and px."""
    rows, cols = np.nonzero(np.isfinite(disparity))
    keep = rows > geometry.height_px * 0.5
    rows, cols = rows[keep], cols[keep]
    x = (cols - geometry.cx_px) / geometry.focal_px
    y = (rows - geometry.cy_px) / geometry.focal_px
    return x, y, disparity[rows, cols] + geometry.doffs_px

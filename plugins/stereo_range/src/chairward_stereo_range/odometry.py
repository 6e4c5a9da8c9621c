"""How far the chair has driven between two frames, from the texture of the floor.

A patch of floor ahead is seen from above (the mount tells how) and shifted onto itself by phase correlation.
A plain floor gives no answer: None, never a guess.
"""

from __future__ import annotations

from collections import deque

import numpy as np

from chairward.stages import Floats, Image
from chairward_stereo_range.geometry import View
from chairward_stereo_range.opencv import opencv
from chairward_stereo_range.region import Bools

CELL_MM = 10.0
CELLS = 64
MIN_RESPONSE = 0.15
MAX_SHIFT_MM = 200.0
MIN_STD = 2.0
AROUND = np.ones((5, 5), np.uint8)
"""So many cells about what stands up do not count either."""
MOST_RAISED = 0.6
"""With more of the patch standing up there is too little floor to tell."""
MEDIAN_OF = 3


class Steady:
    """The median of the last motions told: single ones are wrong by more than a chair can change its speed."""

    def __init__(self) -> None:
        self._last: deque[tuple[float, float]] = deque(maxlen=MEDIAN_OF)

    def step(self, moved: tuple[float, float] | None) -> tuple[float, float] | None:
        """moved: (forward, sideways) mm since the last picture; None stays None."""
        if moved is None:
            return None
        self._last.append(moved)
        forward, sideways = np.median(self._last, axis=0)
        return float(forward), float(sideways)


class FloorOdometry:
    """Forward motion between successive left pictures of one view."""

    def __init__(self, view: View) -> None:
        cv2 = opencv()
        g, p = view.geometry, view.pose
        self.visible_from_mm = nearest_floor_mm(view)
        ahead = self.visible_from_mm + 20.0 + CELL_MM * np.arange(CELLS, dtype=np.float64)[::-1]
        self.middle_mm = float(ahead.mean())
        across = CELL_MM * (np.arange(CELLS, dtype=np.float64) - CELLS / 2)
        pitch = np.radians(p.pitch_deg)
        depth = ahead * np.cos(pitch) + p.z_mm * np.sin(pitch)
        down = p.z_mm * np.cos(pitch) - ahead * np.sin(pitch)
        rows = g.cy_px + g.focal_px * down / depth
        self._x = (g.cx_px + g.focal_px * across[None, :] / depth[:, None]).astype(np.float32)
        self._y = np.repeat(rows[:, None], CELLS, axis=1).astype(np.float32)
        self._window: Floats = cv2.createHanningWindow((CELLS, CELLS), cv2.CV_32F)
        self._last: Floats | None = None

    def step(self, left: Image, obstacle: Bools) -> tuple[float, float] | None:
        """(forward, sideways) mm since the last picture (h x w x 3 BGR); None when the floor does not tell.

        obstacle: h x w, what stands up: it seems to move faster than the floor, and does not count.

        sideways is how far the floor ahead went to the side: by sliding (never) or by turning.
        """
        cv2 = opencv()
        seen = cv2.cvtColor(cv2.remap(left, self._x, self._y, cv2.INTER_LINEAR), cv2.COLOR_BGR2GRAY)
        patch: Floats = seen.astype(np.float32)
        raised = cv2.dilate(cv2.remap(obstacle.view(np.uint8), self._x, self._y, cv2.INTER_NEAREST), AROUND) > 0
        share = float(raised.mean())
        if share > 0:
            patch[raised] = patch[~raised].mean() if share < 1.0 else 0.0
        last, self._last = self._last, patch
        if last is None or share > MOST_RAISED or float(patch.std()) < MIN_STD:
            return None
        (dx, dy), response = cv2.phaseCorrelate(last, patch, self._window)
        forward, sideways = float(dy) * CELL_MM, float(dx) * CELL_MM
        return (forward, sideways) if response >= MIN_RESPONSE and abs(forward) <= MAX_SHIFT_MM else None


def nearest_floor_mm(view: View) -> float:
    """Forward distance from the lens at which the floor enters the picture's bottom; infinite if it does not."""
    row, col = view.geometry.height_px - 1, view.geometry.width_px // 2
    up = float(view.up[row, col])
    return view.pose.z_mm / -up * float(view.forward[row, col]) if up < -1e-6 and view.floor_known else float("inf")

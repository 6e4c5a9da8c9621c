"""What can be wrong with a pair before anything is measured on it: each is noticed, named, and counts as blind.

Dark, covered, frozen, wrongly exposed or unequal pictures are seen in the pictures themselves. Swapped cameras, cameras
that no longer look along the same rows and the calibration of another rig are seen in where corners of the left picture
lie in the right one (pyramidal Lucas-Kanade, there and back): on the same row, and never to the right, if all is well.
"""

from __future__ import annotations

import numpy as np

from chairward.stages import Floats, Image
from chairward_stereo_range.opencv import opencv

DARK_LEVEL = 14.0
BRIGHT_LEVEL = 250.0
FLAT_STD = 2.5
EXPOSURE_RATIO = 1.6
MAX_SKEW_NS = 20_000_000
FROZEN_FRAMES = 3
CORNERS, LEAST_CORNERS = 80, 15
ROWS = 120
"""Corners are looked for in pictures of this height, in every EVERY-th pair; TIMES in turn must say the same."""
EVERY, TIMES = 3, 2
APART_PX = 1.5
"""Rows (at 240) between the two pictures of a corner, in the median: block matching fails from about two on."""
SWAPPED_PX = 1.5
"""So far to the right (at 240 rows) the median corner lies if left and right are exchanged; nothing is so far away."""
RETURN_PX = 0.5


class FaultWatch:
    """Call `check` once a frame."""

    def __init__(self) -> None:
        self._last: tuple[Image, Image] | None = None
        self._same = [0, 0]
        self._pairs = 0
        self._suspected = ""
        self._times = 0

    def check(self, left: Image, right: Image, skew_ns: int) -> str:
        """left, right: h x w x 3 BGR of the working size. Returns "" or one short sentence that names the fault."""
        cv2 = opencv()
        size = (left.shape[1] * ROWS // left.shape[0], ROWS)
        a, b = (
            np.asarray(cv2.cvtColor(cv2.resize(p, size, interpolation=cv2.INTER_AREA), cv2.COLOR_BGR2GRAY), np.uint8)
            for p in (left, right)
        )
        return self._frozen(a, b) or _exposure(a, b) or _skew(skew_ns) or self._alignment(a, b)

    def _frozen(self, left: Image, right: Image) -> str:
        """One camera repeats its picture to the bit while the other one's changes."""
        if self._last is not None:
            same = [bool(np.array_equal(now, then)) for now, then in zip((left, right), self._last, strict=True)]
            self._same = [n + 1 if s and not all(same) else 0 for n, s in zip(self._same, same, strict=True)]
        self._last = (left, right)
        for name, count in zip(("left", "right"), self._same, strict=True):
            if count >= FROZEN_FRAMES:
                return f"the {name} camera is frozen: its picture does not change"
        return ""

    def _alignment(self, left: Image, right: Image) -> str:
        self._pairs += 1
        if self._pairs % EVERY == 1:
            suspected = _misaligned(left, right)
            self._times = self._times + 1 if suspected == self._suspected else 1
            self._suspected = suspected
        return self._suspected if self._times >= TIMES else ""


def _misaligned(left: Image, right: Image) -> str:
    """What the corners of one pair say; "" when all is well or there are too few of them."""
    moved = corner_shifts(left, right)
    if len(moved) < LEAST_CORNERS:
        return ""
    right_px = float(np.median(moved[:, 0])) * (240 / ROWS)
    apart_px = float(np.median(np.abs(moved[:, 1]))) * (240 / ROWS)
    if right_px > SWAPPED_PX:
        return "the left and right cameras are swapped"
    if apart_px > APART_PX:
        return "the cameras do not look along the same rows: calibrate again, or use this rig's calibration"
    return ""


def corner_shifts(left: Image, right: Image) -> Floats:
    """n x 2: how far (px) right and down the corners of the left grey picture lie in the right one."""
    cv2 = opencv()
    corners = cv2.goodFeaturesToTrack(left, CORNERS, 0.02, 5)
    if corners is None or len(corners) < LEAST_CORNERS:
        return np.empty((0, 2), np.float32)
    how = {"winSize": (11, 11), "maxLevel": 3}
    there, found, _ = cv2.calcOpticalFlowPyrLK(left, right, corners, None, **how)
    back, again, _ = cv2.calcOpticalFlowPyrLK(right, left, there, None, **how)
    sure = (found.ravel() == 1) & (again.ravel() == 1)
    sure &= np.abs(back - corners).reshape(-1, 2).max(axis=1) < RETURN_PX
    return np.asarray((there - corners).reshape(-1, 2)[sure], np.float32)


def _exposure(left: Image, right: Image) -> str:
    levels, spreads = zip(*(_mean_std(p) for p in (left, right)), strict=True)
    for name, level, spread in zip(("left", "right"), levels, spreads, strict=True):
        if level < DARK_LEVEL:
            return f"the {name} camera sees only darkness (covered, or no light)"
        if level > BRIGHT_LEVEL:
            return f"the {name} camera is blinded by light"
        if spread < FLAT_STD and max(spreads) > 4 * FLAT_STD:
            return f"the {name} camera is covered: its picture shows nothing"
    if max(levels) > EXPOSURE_RATIO * min(levels):
        return f"the {('left', 'right')[levels.index(min(levels))]} camera's picture is much darker than the other's"
    return ""


def _mean_std(grey: Image) -> tuple[float, float]:
    mean, std = opencv().meanStdDev(grey)
    return float(mean[0, 0]), float(std[0, 0])


def _skew(skew_ns: int) -> str:
    if abs(skew_ns) > MAX_SKEW_NS:
        return f"the two pictures were taken {abs(skew_ns) / 1e6:.0f} ms apart"
    return ""

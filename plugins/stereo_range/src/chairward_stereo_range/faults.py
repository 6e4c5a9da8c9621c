"""What can be wrong with a pair before anything is measured on it: each is noticed, named, and counts as blind.

Dark, covered, frozen, wrongly exposed or unequal pictures are seen in the pictures themselves. Swapped cameras and
cameras that no longer look along the same rows are found by trying, on a quarter of the size, two alternatives a frame
(the pair swapped, one picture moved up or down) and counting how much matches: a pair that matches much better when
changed is not the pair that was calibrated.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from chairward.stages import Image
from chairward_stereo_range.opencv import opencv

DARK_LEVEL = 14.0
BRIGHT_LEVEL = 250.0
FLAT_STD = 2.5
EXPOSURE_RATIO = 1.6
MAX_SKEW_NS = 20_000_000
FROZEN_FRAMES = 3
PROBES = ("as it is", "swapped", -2, -1, 1, 2)
BETTER = 1.7
"""A changed pair must match this many times better ..."""
LEAST_SHARE = 0.12
"""... over this much of the picture ..."""
TIMES = 2
"""... in so many rounds of probes in turn. A round takes three frames."""
DISPARITIES = 32


@dataclass(slots=True)
class _Votes:
    """How often in turn each changed pair has won."""

    swapped: int = 0
    shifted: int = 0


class FaultWatch:
    """Call `check` once a frame."""

    def __init__(self) -> None:
        self._last: tuple[Image, Image] | None = None
        self._same = [0, 0]
        self._shares: dict[object, float] = {}
        self._next = 0
        self._votes = _Votes()
        self._matcher: object = None

    def check(self, left: Image, right: Image, skew_ns: int) -> str:
        """left, right: h x w x 3 BGR of the working size. Returns "" or one short sentence that names the fault."""
        cv2 = opencv()
        size = (left.shape[1] // 4, left.shape[0] // 4)
        small = [
            np.asarray(cv2.cvtColor(cv2.resize(p, size, interpolation=cv2.INTER_AREA), cv2.COLOR_BGR2GRAY), np.uint8)
            for p in (left, right)
        ]
        return (
            self._frozen(small[0], small[1])
            or _exposure(small[0], small[1])
            or _skew(skew_ns)
            or self._alignment(small[0], small[1])
        )

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
        for _ in range(2):
            probe = PROBES[self._next]
            self._shares[probe] = self._share(left, right, probe)
            self._next = (self._next + 1) % len(PROBES)
        if self._next == 0:
            base = self._shares[PROBES[0]]
            self._votes.swapped = self._votes.swapped + 1 if self._wins(("swapped",), base) else 0
            self._votes.shifted = self._votes.shifted + 1 if self._wins((-2, -1, 1, 2), base) else 0
        if self._votes.swapped >= TIMES:
            return "the left and right cameras are swapped"
        if self._votes.shifted >= TIMES:
            return "the cameras no longer look along the same rows: calibrate again"
        return ""

    def _wins(self, probes: tuple[object, ...], base: float) -> bool:
        best = max(self._shares.get(p, 0.0) for p in probes)
        return best > LEAST_SHARE and best > BETTER * base

    def _share(self, left: Image, right: Image, probe: object) -> float:
        """The part of the picture that block matching trusts, for one way of taking the pair."""
        cv2 = opencv()
        if self._matcher is None:
            matcher = cv2.StereoBM_create(DISPARITIES, 9)
            matcher.setUniquenessRatio(15)
            matcher.setTextureThreshold(40)
            matcher.setDisp12MaxDiff(1)
            matcher.setSpeckleWindowSize(30)
            matcher.setSpeckleRange(1)
            self._matcher = matcher
        a, b = (right, left) if probe == "swapped" else (left, right)
        if isinstance(probe, int):
            b = np.asarray(np.roll(b, probe, axis=0), np.uint8)
        found: npt.NDArray[np.int16] = self._matcher.compute(a, b)  # type: ignore[attr-defined]
        inner = found[4:-4, DISPARITIES:]
        return float((inner > 0).mean())


def _exposure(left: Image, right: Image) -> str:
    levels = [float(p.mean()) for p in (left, right)]
    spreads = [float(p.std()) for p in (left, right)]
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


def _skew(skew_ns: int) -> str:
    if abs(skew_ns) > MAX_SKEW_NS:
        return f"the two pictures were taken {abs(skew_ns) / 1e6:.0f} ms apart"
    return ""

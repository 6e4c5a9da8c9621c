"""What the floor looks like, learned from pixels that stereo has just measured to be floor.

A look is a bin of brightness and colour. Two histograms are kept, one that forgets within seconds and one that
remembers for a minute, so that a floor seen before a change of light is known again after it. Any number of modes fits
(tiles and their joints, a patterned rug). A look counts as floor when a neighbourhood of its bin holds a fair share of
either: what covers little of the measured floor (a cable on it) is not learned, however long it lies there.
"""

from __future__ import annotations

import cv2
import numpy as np
import numpy.typing as npt

from chairward.stages import Image

Bools = npt.NDArray[np.bool_]
Bins = npt.NDArray[np.int32]

Y_BINS, C_BINS = 32, 16
Y_STEP, C_STEP = 8, 5
N_BINS = Y_BINS * C_BINS * C_BINS
_C_TABLE = np.clip((np.arange(256) - 128) // C_STEP + C_BINS // 2, 0, C_BINS - 1).astype(np.int32)
_Y_TABLE = (np.arange(256) // Y_STEP * C_BINS * C_BINS).astype(np.int32)
_CR_TABLE = (_C_TABLE * C_BINS).astype(np.int32)


def looks(image: Image) -> Bins:
    """The bin of each pixel, h x w int32. image: h x w x 3 BGR."""
    ycc = cv2.cvtColor(image, cv2.COLOR_BGR2YCrCb)
    return np.asarray(_Y_TABLE[ycc[..., 0]] + _CR_TABLE[ycc[..., 1]] + _C_TABLE[ycc[..., 2]], np.int32)


class Memory:
    """A histogram of looks that forgets exponentially; life_s: seconds until 63 % is forgotten."""

    def __init__(self, life_s: float) -> None:
        self._life_s = life_s
        self._last_ns: int | None = None
        self.shares: npt.NDArray[np.float32] = np.zeros(N_BINS, np.float32)

    def add(self, sample: Bins, now_ns: int) -> None:
        """Take in the looks of a picture captured at now_ns; the first ones fill an empty memory at once."""
        found = np.bincount(sample, minlength=N_BINS).astype(np.float32) / max(1, sample.size)
        keep = 0.0
        if self._last_ns is not None:
            keep = float(np.exp(-max((now_ns - self._last_ns) / 1e9, 1 / 60) / self._life_s))
        self._last_ns = now_ns
        self.shares = np.asarray(keep * self.shares + (1.0 - keep) * found, np.float32)


class FloorLook:
    """The learned floor, and for contrast the look of what was measured to stand on it.

    share: part of the learned floor that the neighbourhood of a look (3 x 3 x 3 bins) must hold to count as floor;
    it must also hold at least `contrast` times as much of the floor as of the obstacles.
    """

    def __init__(self, share: float, contrast: float, fast_s: float, slow_s: float, enough: int) -> None:
        self._share, self._contrast, self._enough = share, contrast, enough
        self._floor = Memory(fast_s), Memory(slow_s)
        self._obstacle = Memory(fast_s)
        self._is_floor: Bools = np.zeros(N_BINS, np.bool_)
        self.pixels = 0

    def learn(self, bins: Bins, floor: Bools, obstacle: Bools, now_ns: int) -> None:
        """Take in what was measured to be floor, and obstacle, in a picture of now_ns; too few pixels teach nothing."""
        sample, other = bins[floor], bins[obstacle]
        if other.size >= self._enough:
            self._obstacle.add(other, now_ns)
        if sample.size < self._enough:
            return
        for memory in self._floor:
            memory.add(sample, now_ns)
        self.pixels = min(1_000_000, self.pixels + sample.size)
        near = _spread(np.maximum(self._floor[0].shares, self._floor[1].shares))
        self._is_floor = np.asarray(
            (near >= self._share) & (near >= self._contrast * _spread(self._obstacle.shares)), np.bool_
        )

    @property
    def knows(self) -> bool:
        """Whether enough has been learned to judge anything."""
        return self.pixels >= 2 * self._enough

    def is_floor(self, bins: Bins) -> Bools:
        """Where a picture looks like the learned floor."""
        return np.asarray(self._is_floor[bins], np.bool_)


def _spread(shares: npt.NDArray[np.float32]) -> npt.NDArray[np.float32]:
    """The sum over each bin's 3 x 3 x 3 neighbourhood (brightness, Cr, Cb)."""
    cube = np.pad(shares.reshape(Y_BINS, C_BINS, C_BINS), 1)
    cube = cube[:-2] + cube[1:-1] + cube[2:]
    cube = cube[:, :-2] + cube[:, 1:-1] + cube[:, 2:]
    cube = cube[:, :, :-2] + cube[:, :, 1:-1] + cube[:, :, 2:]
    return np.asarray(cube.reshape(-1), np.float32)

"""The default matcher: semi-global matching at half size proposes, block matching at full size confirms and refines.

Half the size averages the noise, reaches a large surround cheaply (1/8 of the work) and fills faint texture; its pixels
bleed over edges and lock to whole disparities. 9x9 blocks at full size are sharp and precise but often wrong. Where the
two agree, the blocks' value is taken ("precise"); elsewhere the proposal stands where the picture has texture, or where
it bridges a plain surface in a straight line between textured rims ("bridged").

All results lie on the half-size grid of the left picture; disparities are full-size pixels.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from chairward.stages import Floats, Image
from chairward_stereo_range.matching import Matcher, block_matcher, semi_global_matcher, where_known
from chairward_stereo_range.opencv import opencv
from chairward_stereo_range.texture import noise_sigma, textured

Bools = npt.NDArray[np.bool_]

AGREE_PX = 2.5
"""At 240 rows: how far the block match may lie from the proposal that it confirms."""
BRIDGE_PX = 1.5
"""How far a bridged value may lie from the straight line between its rims."""
SPECK_PIXELS = 12
LARGE = 1.5
"""Pictures of so many times 240 rows are proposed at a quarter of their size: full size confirms in any case."""


@dataclass(frozen=True, slots=True)
class Match:
    """Disparities (full-size px, NaN unknown) of a strip.

    fused, textured, sharp: on the half-size grid; sharp: where blocks confirmed.
    precise: on the full-size grid, only where both matchers agree.
    sigma: noise of the left strip at half size, grey levels. small, small_right: the strips at half size.
    """

    fused: Floats
    textured: Bools
    sharp: Bools
    precise: Floats
    sigma: float
    small: Image
    small_right: Image


class Pyramid:
    """Both matchers for one search range. fine: rows (first, end) of the strip in which blocks confirm."""

    def __init__(self, first: int, count: int, scale: float, fine: tuple[int, int]) -> None:
        self._coarser = 2 if scale >= LARGE else 1
        shrink = 2 * self._coarser
        coarse_count = max(16, int(np.ceil(count / shrink / 16)) * 16)
        self._coarse: Matcher = semi_global_matcher(first // shrink, coarse_count, "sgbm_3way")
        self._first, self._count = first, count
        self._fine = {n: block_matcher(first, n, block=9) for n in range(16, count + 1, 16)}
        self._scale = scale
        self._rows = (fine[0] // 2 * 2, fine[1] // 2 * 2)

    def __call__(self, left: Image, right: Image) -> Match:
        """left, right: grey strips, h x w with h and w even."""
        small_left, small_right = half_size(left), half_size(right)
        raw = self._proposed(small_left, small_right)
        sigma = noise_sigma(small_left)
        texture = textured(small_left, sigma)
        proposed = islands(raw, texture & np.isfinite(raw), round(SPECK_PIXELS * self._scale**2), 1.0)
        fused = where_known(raw * np.float32(2.0), proposed | bridged(raw, proposed, BRIDGE_PX / 2))
        top, end = self._rows
        blocks = self._fine[self._needed(raw[proposed])](left[top:end], right[top:end])
        around = np.repeat(np.repeat(fused[top // 2 : end // 2], 2, axis=0), 2, axis=1)
        precise = np.full(left.shape, np.nan, np.float32)
        precise[top:end] = where_known(blocks, np.abs(blocks - around) <= AGREE_PX * self._scale)
        sharp = np.zeros(fused.shape, bool)
        confirmed = mean_of_four(precise[top:end])
        sharp[top // 2 : end // 2] = np.isfinite(confirmed)
        np.copyto(fused[top // 2 : end // 2], confirmed, where=np.isfinite(confirmed))
        return Match(fused, texture, sharp, precise, sigma, small_left, small_right)

    def _proposed(self, left: Image, right: Image) -> Floats:
        """Semi-global matching of the half-size strips, px of theirs; of large pictures at half their size again."""
        if self._coarser == 1:
            return self._coarse(left, right)
        cv2 = opencv()
        found = self._coarse(half_size(left), half_size(right)) * np.float32(2.0)
        size = (found.shape[1] * 2, found.shape[0] * 2)
        return np.asarray(cv2.resize(found, size, interpolation=cv2.INTER_NEAREST)[: left.shape[0], : left.shape[1]])

    def _needed(self, known: Floats) -> int:
        """How many disparities the blocks must search to reach all that is proposed: most rooms are empty nearby."""
        if known.size == 0:
            return 16
        reach = (
            2.0 * float(np.partition(known, -1 - known.size // 1000)[-1 - known.size // 1000]) + AGREE_PX * self._scale
        )
        return min(self._count, max(16, int(np.ceil((reach + 1 - self._first) / 16)) * 16))


def half_size(image: Image) -> Image:
    """Half the size after a 5-tap Gaussian: the pixel (i, j) lies at (2i, 2j) of the full picture."""
    return np.asarray(opencv().pyrDown(image), np.uint8)


def mean_of_four(values: Floats) -> Floats:
    """Mean of the known ones of each 2x2 block; NaN where none is known."""
    cv2 = opencv()
    known = np.isfinite(values)
    size = (values.shape[1] // 2, values.shape[0] // 2)
    share = cv2.resize(known.astype(np.float32), size, interpolation=cv2.INTER_AREA)
    total = cv2.resize(cv2.patchNaNs(values.copy(), 0.0), size, interpolation=cv2.INTER_AREA)
    return where_known(total / np.maximum(share, np.float32(0.25)), share > 0)


def bridged(raw: Floats, trusted: Bools, tolerance: float) -> Bools:
    """Which untrusted pixels lie on the straight line between the trusted ends of their row's gap; tolerance: px."""
    width = raw.shape[1]
    known = np.flatnonzero(trusted)
    steps = np.diff(known)
    gaps = np.flatnonzero((steps > 1) & (np.diff(known // width) == 0))
    inner = steps[gaps] - 1
    part = 1 + np.arange(inner.sum()) - np.repeat(np.cumsum(inner) - inner, inner)
    at = np.repeat(known[gaps], inner) + part
    value = raw.ravel()
    start, end = value[known[gaps]], value[known[gaps + 1]]
    slope = (part / np.repeat(steps[gaps], inner)).astype(np.float32)
    with np.errstate(invalid="ignore"):
        fits = np.abs(value[at] - (np.repeat(start, inner) + np.repeat(end - start, inner) * slope)) <= tolerance
    out = np.zeros(raw.size, bool)
    out[at[fits]] = True
    return out.reshape(raw.shape)


def gap_ends(known: Bools) -> tuple[npt.NDArray[np.int32], npt.NDArray[np.int32]]:
    """(columns of the last known pixel on the left or -1, of the first on the right or the width) of every pixel."""
    w = known.shape[1]
    columns = np.arange(w, dtype=np.int32)
    before = np.maximum.accumulate(np.where(known, columns, np.int32(-1)), axis=1)
    after = np.minimum.accumulate(np.where(known, columns, np.int32(w))[:, ::-1], axis=1)[:, ::-1]
    return before, after


def islands(disparity: Floats, known: Bools, max_pixels: int, jump_px: float) -> Bools:
    """Which known pixels belong to islands of more than max_pixels (islands: neighbours differ by at most jump_px)."""
    fixed = np.where(known, disparity * np.float32(16.0), np.float32(-32768.0)).astype(np.int16)
    opencv().filterSpeckles(fixed, -32768, max_pixels, int(jump_px * 16))
    return np.asarray(fixed > -32768)

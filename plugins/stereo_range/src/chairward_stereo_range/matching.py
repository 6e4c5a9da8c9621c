"""Matchers: grey pair -> disparity of the left picture, float32 px, NaN where no match is trusted.

All take strips of equal shape (h x w uint8) and search `first .. first + count - 1` whole disparities.
`block` holds the textbook measures (one code path for NCC, ZNCC, SAD, SSD, so that a table compares the measures and
nothing else); `bm` and `sgbm*` are OpenCV's. SGBM is semi-global dynamic programming (Hirschmueller 2008).
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, Literal

import numpy as np
import numpy.typing as npt

from chairward.stages import Floats, Image, StereoGeometry
from chairward_stereo_range.geometry import disparity_range
from chairward_stereo_range.opencv import opencv

Method = Literal[
    "pyramid", "thesis_code", "thesis_text", "ncc", "zncc", "sad", "ssd", "bm", "sgbm", "sgbm_3way", "sgbm_hh"
]
BLOCK_METHODS = ("ncc", "zncc", "sad", "ssd")
Matcher = Callable[[Image, Image], Floats]

SUBPIXEL = 16.0
"""OpenCV's fixed point: disparities in sixteenths of a pixel."""


def make_matcher(method: Method, first: int, count: int) -> Matcher:
    """The matcher called `method` (not the thesis methods, see thesis.py). Raises ValueError for an unknown name."""
    if method in BLOCK_METHODS:
        return lambda left, right: block_match(left, right, method, first, count)
    if method == "bm":
        return block_matcher(first, count)
    if method in ("sgbm", "sgbm_3way", "sgbm_hh"):
        return semi_global_matcher(first, count, method)
    raise ValueError(f"stereo_range.method = '{method}': use one of bm, sgbm, sgbm_3way, sgbm_hh, {BLOCK_METHODS}")


def whole_frame_disparity(left: Image, right: Image, geometry: StereoGeometry, nearest_mm: float = 240.0) -> Floats:
    """Block matching of two whole BGR pictures, for set-up work (mount, alignment)."""
    cv2 = opencv()
    grey = [np.asarray(cv2.cvtColor(picture, cv2.COLOR_BGR2GRAY), np.uint8) for picture in (left, right)]
    return block_matcher(*disparity_range(geometry, nearest_mm))(grey[0], grey[1])


def _padded(image: Image, left_px: int, right_px: int) -> Image:
    """OpenCV leaves the columns that could match outside the right picture empty: give it room there."""
    cv2 = opencv()
    return np.asarray(cv2.copyMakeBorder(image, 0, 0, left_px, right_px, cv2.BORDER_REPLICATE), np.uint8)


def _opencv(matcher: Any, first: int, count: int) -> Matcher:
    ahead, behind = max(0, first + count), max(0, -first)

    def match(left: Image, right: Image) -> Floats:
        found = matcher.compute(_padded(left, ahead, behind), _padded(right, ahead, behind))
        d: Floats = found[:, ahead : ahead + left.shape[1]].astype(np.float32) / np.float32(SUBPIXEL)
        return where_known(d, d >= first)

    return match


def where_known(disparity: Floats, known: npt.NDArray[np.bool_]) -> Floats:
    """The known disparities, NaN elsewhere: numpy's own where takes six times as long."""
    out = np.full(disparity.shape, np.nan, np.float32)
    return np.asarray(opencv().copyTo(disparity, known.view(np.uint8), out), np.float32)


def block_matcher(first: int, count: int, block: int = 15) -> Matcher:
    """OpenCV's StereoBM: absolute differences of Sobel-filtered blocks."""
    cv2 = opencv()
    m = cv2.StereoBM_create(count, block)
    m.setMinDisparity(first)
    m.setPreFilterType(cv2.STEREO_BM_PREFILTER_XSOBEL)
    m.setPreFilterCap(31)
    m.setUniquenessRatio(10)
    m.setTextureThreshold(20)
    m.setDisp12MaxDiff(1)
    return _opencv(m, first, count)


def semi_global_matcher(first: int, count: int, method: str, block: int = 5) -> Matcher:
    """OpenCV's StereoSGBM, in three directions (sgbm_3way), five (sgbm) or eight (sgbm_hh)."""
    cv2 = opencv()
    modes = {
        "sgbm": cv2.STEREO_SGBM_MODE_SGBM,
        "sgbm_3way": cv2.STEREO_SGBM_MODE_SGBM_3WAY,
        "sgbm_hh": cv2.STEREO_SGBM_MODE_HH,
    }
    area = block * block
    m = cv2.StereoSGBM_create(
        minDisparity=first,
        numDisparities=count,
        blockSize=block,
        P1=8 * area,
        P2=32 * area,
        disp12MaxDiff=1,
        preFilterCap=31,
        uniquenessRatio=10,
        mode=modes[method],
    )
    return _opencv(m, first, count)


def block_match(
    left: Image,
    right: Image,
    measure: str,
    first: int,
    count: int,
    half: int = 4,
    uniqueness: float = 0.85,
    subpixel: bool = True,
) -> Floats:
    """Block matching, left referenced: winner takes all, left-right check, uniqueness, parabola through the winner.

    measure: ncc (no mean subtraction, as the thesis), zncc, sad, ssd; windows of 2 half + 1. Costs are >= 0 and the
    smallest wins: 1 - score for ncc and zncc. Result NaN where a check fails or the winner is at the search's end.
    """
    volume = cost_volume(left, right, measure, first, count, half)
    k = volume.argmin(axis=0)
    rows, cols = np.indices(k.shape, sparse=True)
    best = volume[k, rows, cols]
    inner = np.clip(k, 1, count - 2)
    before, after = volume[inner - 1, rows, cols], volume[inner + 1, rows, cols]
    found = k.astype(np.float32) + first
    with np.errstate(invalid="ignore", over="ignore"):
        curve = before - 2 * best + after
        good = np.isfinite(curve) & (curve > 1e-9)
        if subpixel:
            found += np.where(good, 0.5 * (before - after) / np.where(good, curve, 1.0), 0.0).astype(np.float32)
    trusted = np.isfinite(best) & (k > 0) & (k < count - 1) & _agrees(volume, k, first)
    rest = volume.copy()
    for step in (-1, 0, 1):
        rest[np.clip(k + step, 0, count - 1), rows, cols] = np.inf
    trusted &= best <= uniqueness * rest.min(axis=0)
    found[~trusted] = np.nan
    return np.asarray(found, np.float32)


def cost_volume(left: Image, right: Image, measure: str, first: int, count: int, half: int) -> Floats:
    """count x h x w costs of comparing left (y, x) with right (y, x - d); inf where that window leaves the picture."""
    cv2 = opencv()
    h, w = left.shape
    side = (2 * half + 1, 2 * half + 1)
    a, b = left.astype(np.float32), right.astype(np.float32)
    if measure == "zncc":
        a, b = a - np.float32(a.mean()), b - np.float32(b.mean())

    def box(x: Floats) -> Floats:
        return np.asarray(cv2.boxFilter(x, cv2.CV_32F, side, borderType=cv2.BORDER_REFLECT_101), np.float32)

    mean_a = box(a) if measure == "zncc" else np.zeros_like(a)
    mean_b = box(b) if measure == "zncc" else np.zeros_like(b)
    power_a = np.maximum(box(a * a) - mean_a * mean_a, 1e-3)
    power_b = np.maximum(box(b * b) - mean_b * mean_b, 1e-3)
    volume = np.full((count, h, w), np.inf, np.float32)
    for i in range(count):
        d = first + i
        at = slice(max(0, d), min(w, w + d))
        to = slice(max(0, -d), min(w, w - d))
        if at.stop - at.start < side[0]:
            continue
        x, y = a[:, at], b[:, to]
        if measure == "sad":
            cost = box(np.abs(x - y))
        elif measure == "ssd":
            cost = box((x - y) ** 2)
        else:
            score = (box(x * y) - mean_a[:, at] * mean_b[:, to]) / np.sqrt(power_a[:, at] * power_b[:, to])
            cost = np.maximum(1.0 - score, 0.0)
        volume[i, :, at.start + half : at.stop - half] = cost[:, half : cost.shape[1] - half]
    volume[:, :half], volume[:, h - half :] = np.inf, np.inf
    return volume


def _agrees(volume: Floats, k: npt.NDArray[np.intp], first: int) -> npt.NDArray[np.bool_]:
    """The left-right check: the right pixel that a left pixel chose chooses it back, to one pixel."""
    count, h, w = volume.shape
    reverse = np.full((count, h, w), np.inf, np.float32)
    for i in range(count):
        d = first + i
        reverse[i, :, max(0, -d) : min(w, w - d)] = volume[i, :, max(0, d) : min(w, w + d)]
    chosen = reverse.argmin(axis=0)
    rows, cols = np.indices((h, w), sparse=True)
    back = chosen[rows, np.clip(cols - (k + first), 0, w - 1)]
    return np.asarray(np.abs(back - k) <= 1)

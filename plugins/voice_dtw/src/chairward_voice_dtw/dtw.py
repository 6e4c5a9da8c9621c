"""Symmetric dynamic time warping, weights 1/2/1 (Sakoe & Chiba 1978), banded, divided by the lengths' sum.

`distances` is the compiled kernel (all templates of a pass in one call), `distances_numpy` the fallback, both checked
against the obvious loop and against each other in the tests.
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from chairward_voice_dtw.audio import Floats
from chairward_voice_dtw.jit import HAVE_NUMBA, jit

BAND = 0.35
Lengths = npt.NDArray[np.int64]


@jit
def _distance(x: Floats, y: Floats, band: float) -> float:
    """One word against one template; both n x d float32. Two columns of memory."""
    n, m, d = x.shape[0], y.shape[0], x.shape[1]
    reach = max(band * max(n, m), 2.0)
    slope = m / n
    before = np.full(m + 1, np.inf, np.float32)
    now = np.full(m + 1, np.inf, np.float32)
    before[0] = 0.0
    for i in range(n):
        centre = (i + 0.5) * slope
        low = max(0, int(centre - reach))
        high = min(m, int(centre + reach) + 1)
        for j in range(m + 1):
            now[j] = np.inf
        for j in range(low, high):
            total = np.float32(0.0)
            for k in range(d):
                step = x[i, k] - y[j, k]
                total += step * step
            cost = np.sqrt(total)
            best = before[j] + np.float32(2.0) * cost
            best = min(best, before[j + 1] + cost)
            best = min(best, now[j] + cost)
            now[j + 1] = best
        before, now = now, before
    return float(before[m] / (n + m))


@jit
def _all(x: Floats, templates: Floats, lengths: Lengths, band: float, out: npt.NDArray[np.float64]) -> None:
    for r in range(len(lengths)):
        out[r] = _distance(x, templates[r, : lengths[r]], band)


def distance_numpy(x: Floats, y: Floats, band: float = BAND) -> float:
    """The same, a whole row of local costs at a time, without numba."""
    n, m = len(x), len(y)
    reach = max(band * max(n, m), 2.0)
    squares = (x * x).sum(1)[:, None] + (y * y).sum(1)[None] - 2.0 * (x.astype(np.float64) @ y.T.astype(np.float64))
    cost = np.sqrt(np.maximum(squares, 0.0))
    before = np.full(m + 1, np.inf)
    before[0] = 0.0
    for i in range(n):
        centre = (i + 0.5) * (m / n)
        low, high = max(0, int(centre - reach)), min(m, int(centre + reach) + 1)
        row = cost[i, low:high]
        enter = np.minimum(before[low:high] + 2.0 * row, before[low + 1 : high + 1] + row)
        # now[j] = min(enter[j], now[j-1] + row[j]): a running minimum once the cumulated costs are taken off
        sums = np.cumsum(row)
        now = np.full(m + 1, np.inf)
        now[low + 1 : high + 1] = np.minimum.accumulate(enter - sums) + sums
        before = now
    return float(before[m] / (n + m))


def pack(items: list[Floats]) -> tuple[Floats, Lengths]:
    """Templates as one r x longest x d array, and their lengths."""
    lengths = np.array([len(item) for item in items], np.int64)
    packed = np.zeros((len(items), int(lengths.max(initial=1)), items[0].shape[1]), np.float32)
    for row, item in zip(packed, items, strict=True):
        row[: len(item)] = item
    return packed, lengths


def distances(x: Floats, templates: Floats, lengths: Lengths, band: float = BAND) -> npt.NDArray[np.float64]:
    """Distance of word x (n x d) to every template of `pack`; inf where the band allows no path."""
    if not HAVE_NUMBA:
        return np.array([distance_numpy(x, t[:k], band) for t, k in zip(templates, lengths, strict=True)])
    out = np.empty(len(lengths))
    _all(x, templates, lengths, band, out)
    return out


@jit
def _nearest(x: Floats, templates: Floats, lengths: Lengths, out: npt.NDArray[np.float32]) -> None:
    n, d = x.shape
    for r in range(len(lengths)):
        for i in range(n):
            least = np.float32(np.inf)
            for j in range(lengths[r]):
                total = np.float32(0.0)
                for k in range(d):
                    step = x[i, k] - templates[r, j, k]
                    total += step * step
                least = min(least, total)
            out[r, i] = np.sqrt(least)


def nearest(x: Floats, templates: Floats, lengths: Lengths) -> npt.NDArray[np.float32]:
    """Distance of each frame of x to its nearest frame of each template, in any order: r x n."""
    out = np.empty((len(lengths), len(x)), np.float32)
    if HAVE_NUMBA:
        _nearest(x, templates, lengths, out)
    else:
        for row, t, k in zip(out, templates, lengths, strict=True):
            squares = (x * x).sum(1)[:, None] + (t[:k] * t[:k]).sum(1)[None] - 2.0 * (x @ t[:k].T)
            row[:] = np.sqrt(np.maximum(squares.min(axis=1), 0.0))
    return out


@jit
def path_shape(x: Floats, y: Floats, band: float, window: int) -> tuple[float, float]:
    """Of the best path: the mean local distance in its worst `window` frames of x, and its share of diagonal steps.

    A word that shares half its sounds with another matches well in one half and badly in the other.
    """
    n, m, d = x.shape[0], y.shape[0], x.shape[1]
    cost = np.zeros((n, m), np.float32)
    total = np.full((n + 1, m + 1), np.inf, np.float32)
    came = np.zeros((n + 1, m + 1), np.int8)
    total[0, 0] = 0.0
    reach = max(band * max(n, m), 2.0)
    for i in range(n):
        centre = (i + 0.5) * m / n
        for j in range(max(0, int(centre - reach)), min(m, int(centre + reach) + 1)):
            square = np.float32(0.0)
            for k in range(d):
                step = x[i, k] - y[j, k]
                square += step * step
            here = np.sqrt(square)
            cost[i, j] = here
            best, way = total[i, j] + np.float32(2.0) * here, 0
            if total[i, j + 1] + here < best:
                best, way = total[i, j + 1] + here, 1
            if total[i + 1, j] + here < best:
                best, way = total[i + 1, j] + here, 2
            total[i + 1, j + 1] = best
            came[i + 1, j + 1] = way
    sums = np.zeros(n)
    counts = np.zeros(n)
    i, j, steps, straight = n, m, 0, 0
    while i > 0 and j > 0:
        sums[i - 1] += cost[i - 1, j - 1]
        counts[i - 1] += 1.0
        steps += 1
        if came[i, j] == 0:
            i -= 1
            j -= 1
            straight += 1
        elif came[i, j] == 1:
            i -= 1
        else:
            j -= 1
    width = min(window, n)
    worst = 0.0
    for first in range(n - width + 1):
        mean = 0.0
        for at in range(first, first + width):
            mean += sums[at] / max(counts[at], 1.0)
        worst = max(worst, mean / width)
    return worst, straight / max(steps, 1)

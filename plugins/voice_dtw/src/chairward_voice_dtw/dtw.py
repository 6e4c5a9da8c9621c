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
    """One word against one template; both n x d float32. Two columns of memory.

    Local costs of a row are summed dimension by dimension over a transposed template, so that the processor works on
    eight of them at a time; only the last minimum of the recursion has to wait for its neighbour.
    """
    n, m, d = x.shape[0], y.shape[0], x.shape[1]
    reach = max(band * max(n, m), 2.0)
    slope = m / n
    across = np.empty((d, m), np.float32)
    for j in range(m):
        for k in range(d):
            across[k, j] = y[j, k]
    cost = np.empty(m, np.float32)
    before = np.full(m + 1, np.inf, np.float32)
    now = np.full(m + 1, np.inf, np.float32)
    before[0] = 0.0
    for i in range(n):
        centre = (i + 0.5) * slope
        low = max(0, int(centre - reach))
        high = min(m, int(centre + reach) + 1)
        cost[low:high] = 0.0
        for k in range(d):
            value = x[i, k]
            row = across[k]
            for j in range(low, high):
                step = value - row[j]
                cost[j] += step * step
        now[:] = np.inf
        for j in range(low, high):
            cost[j] = np.sqrt(cost[j])
            now[j + 1] = min(before[j] + cost[j] + cost[j], before[j + 1] + cost[j])
        left = np.float32(np.inf)
        for j in range(low, high):
            left = min(now[j + 1], left + cost[j])
            now[j + 1] = left
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

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
LANES = 8
"""Templates that are warped side by side: the float32 of one vector register."""
Lengths = npt.NDArray[np.int64]


@jit
def _chunk(templates: Floats, lengths: Lengths, first: int, across: Floats, mine: Lengths) -> int:
    """How many templates there are from `first` on, LANES at most. across[k, j, q]: dimension k of frame j of template
    first + q. mine: their lengths; lanes without a template get zeros of the first one's length."""
    count = min(LANES, len(lengths) - first)
    across[:] = 0.0
    mine[:] = lengths[first]
    for q in range(count):
        mine[q] = lengths[first + q]
        for j in range(mine[q]):
            for k in range(across.shape[0]):
                across[k, j, q] = templates[first + q, j, k]
    return count


@jit
def _bounds(i: int, n: int, lengths: Lengths, band: float, lows: Lengths, highs: Lengths) -> tuple[int, int]:
    """The band of row i in each of LANES templates, and of all of them together."""
    for q in range(LANES):
        centre, reach = (i + 0.5) * (lengths[q] / n), max(band * max(n, lengths[q]), 2.0)
        lows[q] = max(0, int(centre - reach))
        highs[q] = min(lengths[q], int(centre + reach) + 1)
    return max(0, lows.min()), highs.max()


@jit
def _frame_distances(frame: Floats, across: Floats, low: int, high: int, out: Floats) -> None:
    """out[j, q]: distance of one frame to frame j of each of LANES templates, low <= j < high."""
    flat = out[low:high].reshape(-1)
    flat[:] = 0.0
    for k in range(len(frame)):
        value, row = frame[k], across[k, low:high].reshape(-1)
        for at in range(len(flat)):
            step = value - row[at]
            flat[at] += step * step
    for at in range(len(flat)):
        flat[at] = np.sqrt(flat[at])


@jit
def _step(cost: Floats, before: Floats, now: Floats) -> None:
    """The recursion of a row of LANES templates, interleaved: each step waits for the one LANES before it only, so that
    the processor does LANES of them at once. before, now: one column more than cost."""
    for at in range(len(cost)):
        now[at + LANES] = min(before[at] + cost[at] + cost[at], before[at + LANES] + cost[at])
    for at in range(len(cost)):
        now[at + LANES] = min(now[at + LANES], now[at] + cost[at])


@jit
def _warp(table: Floats, lengths: Lengths, band: float, out: npt.NDArray[np.float64]) -> None:
    """One word against LANES templates side by side, with two rows of memory each. table: n x longest x LANES."""
    n, m = table.shape[0], table.shape[1]
    infinite = np.float32(np.inf)
    lows, highs = np.empty(LANES, np.int64), np.empty(LANES, np.int64)
    cost = np.empty((m, LANES), np.float32)
    before = np.full((m + 1, LANES), infinite, np.float32)
    now = np.full((m + 1, LANES), infinite, np.float32)
    before[0] = 0.0
    for i in range(n):
        low, high = _bounds(i, n, lengths, band, lows, highs)
        cost[low:high] = table[i, low:high]
        for q in range(LANES):
            cost[low : lows[q], q] = infinite
            cost[highs[q] : high, q] = infinite
        now[low] = infinite
        _step(cost[low:high].reshape(-1), before[low : high + 1].reshape(-1), now[low : high + 1].reshape(-1))
        before, now = now, before
        if i == 0:
            now[0] = infinite
    for q in range(LANES):
        out[q] = before[lengths[q], q] / (n + lengths[q])


@jit
def _all(x: Floats, templates: Floats, lengths: Lengths, band: float, out: npt.NDArray[np.float64]) -> None:
    n, longest = len(x), templates.shape[1]
    across = np.empty((x.shape[1], longest, LANES), np.float32)
    table = np.empty((n, longest, LANES), np.float32)
    found, mine = np.empty(LANES), np.empty(LANES, np.int64)
    lows, highs = np.empty(LANES, np.int64), np.empty(LANES, np.int64)
    for first in range(0, len(lengths), LANES):
        count = _chunk(templates, lengths, first, across, mine)
        for i in range(n):
            low, high = _bounds(i, n, mine, band, lows, highs)
            _frame_distances(x[i], across, low, high, table[i])
        _warp(table, mine, band, found)
        out[first : first + count] = found[:count]


@jit
def _both_ways(
    x: Floats,
    templates: Floats,
    lengths: Lengths,
    band: float,
    out: npt.NDArray[np.float64],
    free: npt.NDArray[np.float32],
) -> None:
    n, longest = len(x), templates.shape[1]
    across = np.empty((x.shape[1], longest, LANES), np.float32)
    table = np.empty((n, longest, LANES), np.float32)
    found, mine = np.empty(LANES), np.empty(LANES, np.int64)
    for first in range(0, len(lengths), LANES):
        count = _chunk(templates, lengths, first, across, mine)
        for i in range(n):
            _frame_distances(x[i], across, 0, longest, table[i])
            for q in range(count):
                least = np.float32(np.inf)
                for j in range(mine[q]):
                    least = min(least, table[i, j, q])
                free[first + q, i] = least
        _warp(table, mine, band, found)
        out[0, first : first + count] = found[:count]
        _warp(table[::-1], mine, band, found)
        out[1, first : first + count] = found[:count]


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


def both_ways(
    x: Floats, templates: Floats, lengths: Lengths, band: float = BAND
) -> tuple[npt.NDArray[np.float64], npt.NDArray[np.float64], npt.NDArray[np.float32]]:
    """`distances` of x and of x backwards, and of each frame of x to the nearest frame of each template (r x n)."""
    out, free = np.empty((2, len(lengths))), np.empty((len(lengths), len(x)), np.float32)
    if HAVE_NUMBA:
        _both_ways(x, templates, lengths, band, out, free)
        return out[0], out[1], free
    for row, t, k in zip(free, templates, lengths, strict=True):
        squares = (x * x).sum(1)[:, None] + (t[:k] * t[:k]).sum(1)[None] - 2.0 * (x @ t[:k].T)
        row[:] = np.sqrt(np.maximum(squares.min(axis=1), 0.0))
    return distances(x, templates, lengths, band), distances(x[::-1], templates, lengths, band), free

"""Figures with their 95 % bounds: exact for rates, order statistics for quantiles, bootstrap for means."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

CONFIDENCE = 0.95


@dataclass(frozen=True, slots=True)
class Figure:
    """One figure: its value, how many cases it rests on, and its two-sided 95 % bounds (None: no cases)."""

    value: float | None
    n: int
    low: float | None = None
    high: float | None = None


def rate_pct(hits: int, n: int) -> Figure:
    """A rate in per cent with the exact (Clopper-Pearson) interval."""
    from scipy.stats import beta

    if n == 0:
        return Figure(None, 0)
    tail = (1 - CONFIDENCE) / 2
    low = 0.0 if hits == 0 else float(beta.ppf(tail, hits, n - hits + 1))
    high = 1.0 if hits == n else float(beta.ppf(1 - tail, hits + 1, n - hits))
    return Figure(100.0 * hits / n, n, 100.0 * low, 100.0 * high)


def quantile(values: Sequence[float], q: float) -> Figure:
    """A quantile with the distribution-free interval between two order statistics."""
    from scipy.stats import binom

    data = np.sort(np.asarray([v for v in values if np.isfinite(v)], float))
    n = data.size
    if n == 0:
        return Figure(None, 0)
    tail = (1 - CONFIDENCE) / 2
    low = int(max(binom.ppf(tail, n, q) - 1, 0))
    high = int(min(binom.ppf(1 - tail, n, q), n - 1))
    return Figure(float(np.quantile(data, q)), n, float(data[low]), float(data[high]))


def per_100(events: int, amount: float, n: int) -> Figure:
    """Events for each hundred of `amount` (metres, hours), with the exact Poisson interval; n: cases they rest on."""
    from scipy.stats import chi2

    if amount <= 0:
        return Figure(None, n)
    tail = (1 - CONFIDENCE) / 2
    low = 0.0 if events == 0 else float(chi2.ppf(tail, 2 * events)) / 2
    high = float(chi2.ppf(1 - tail, 2 * events + 2)) / 2
    return Figure(100.0 * events / amount, n, 100.0 * low / amount, 100.0 * high / amount)


def mean(values: Sequence[float]) -> Figure:
    """A mean with the percentile bootstrap (2000 draws, fixed seed)."""
    data = np.asarray([v for v in values if np.isfinite(v)], float)
    if data.size == 0:
        return Figure(None, 0)
    draws = np.random.default_rng(0).choice(data, (2000, data.size)).mean(axis=1)
    return Figure(float(data.mean()), data.size, float(np.quantile(draws, 0.025)), float(np.quantile(draws, 0.975)))


def as_dict(figures: dict[str, Figure | int]) -> dict[str, object]:
    """Flat numbers, with `n` and `bounds_95` beside them by the same names."""
    out: dict[str, object] = {}
    n: dict[str, int] = {}
    bounds: dict[str, list[float | None]] = {}
    for name, figure in figures.items():
        if isinstance(figure, int):
            out[name] = figure
            continue
        out[name] = None if figure.value is None else round(figure.value, 3)
        n[name] = figure.n
        bounds[name] = [None if v is None else round(v, 3) for v in (figure.low, figure.high)]
    return {**out, "n": n, "bounds_95": bounds}

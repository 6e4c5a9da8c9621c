"""Small statistics for the reports: shares with 95 % bounds, percentiles, equal error rate."""

from __future__ import annotations

from collections.abc import Sequence
from math import sqrt
from typing import TypedDict

import numpy as np


class Share(TypedDict):
    """A percentage, how many trials it rests on, and its 95 % Wilson bounds (trials taken as independent)."""

    pct: float | None
    n: int
    low: float | None
    high: float | None


def share(hits: int, n: int) -> Share:
    """Wilson score interval (Wilson 1927)."""
    if n == 0:
        return Share(pct=None, n=0, low=None, high=None)
    z, p = 1.96, hits / n
    middle = (p + z * z / (2 * n)) / (1 + z * z / n)
    half = z * sqrt(p * (1 - p) / n + z * z / (4 * n * n)) / (1 + z * z / n)
    return Share(
        pct=round(100 * p, 2),
        n=n,
        low=round(100 * max(0.0, middle - half), 2),
        high=round(100 * min(1.0, middle + half), 2),
    )


def rate_per_hour(count: int, hours: float) -> dict[str, float | int | None]:
    """Events an hour with 95 % bounds of a Poisson count (exact, chi-squared)."""
    from scipy.stats import chi2

    if hours <= 0.0:
        return {"per_hour": None, "n": count, "low": None, "high": None}
    low = chi2.ppf(0.025, 2 * count) / 2 if count else 0.0
    high = chi2.ppf(0.975, 2 * count + 2) / 2
    return {
        "per_hour": round(count / hours, 2),
        "n": count,
        "low": round(float(low) / hours, 2),
        "high": round(float(high) / hours, 2),
    }


def percentiles(values: Sequence[float], *wanted: int) -> dict[str, float | None]:
    """p50, p95, ...; None without values."""
    return {f"p{p}": round(float(np.percentile(values, p)), 1) if len(values) else None for p in wanted}


def equal_error_rate_pct(known: Sequence[float], unknown: Sequence[float]) -> float | None:
    """Where as many known utterances fall under a threshold as unknown ones reach it, in per cent."""
    if not len(known) or not len(unknown):
        return None
    right, wrong = np.sort(known), np.sort(unknown)
    lines = np.unique(np.concatenate([right, wrong, [np.inf]]))
    missed = np.searchsorted(right, lines, side="left") / len(right)
    passed = 1.0 - np.searchsorted(wrong, lines, side="left") / len(wrong)
    at = int(np.argmin(np.abs(missed - passed)))
    return round(50.0 * float(missed[at] + passed[at]), 2)


def accepted_at(known: Sequence[float], unknown: Sequence[float], true_accept: float) -> Share:
    """Unknown utterances that pass the line which `true_accept` of the known ones pass."""
    if not len(known) or not len(unknown):
        return share(0, 0)
    line = np.sort(known)[int(np.floor((1.0 - true_accept) * len(known)))]
    return share(int((np.asarray(unknown) >= line).sum()), len(unknown))

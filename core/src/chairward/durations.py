"""Percentiles of durations, for the figures of a run."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, field

from chairward.facts import MS


@dataclass(slots=True)
class Durations:
    """Percentiles of any number of durations in little memory: they are counted by their first three digits.

    So a percentile is within 0.5 %; the largest is exact.
    """

    n: int = 0
    largest_ns: int = 0
    _counts: dict[int, int] = field(default_factory=dict)

    def add(self, ns: int) -> None:
        """Count one."""
        self.largest_ns = max(ns, self.largest_ns) if self.n else ns
        self.n += 1
        about_ns = int(float(f"{ns:.2e}"))
        self._counts[about_ns] = self._counts.get(about_ns, 0) + 1

    def percentiles_ms(self) -> dict[str, float] | None:
        """p50, p99, p99.9 and the largest, in milliseconds; None without values."""
        if not self.n:
            return None
        result: dict[str, float] = {"n": self.n}
        for name, share in (("p50", 0.5), ("p99", 0.99), ("p99_9", 0.999)):
            result[name] = round(min(self._at(min(self.n - 1, int(self.n * share))), self.largest_ns) / MS, 3)
        return result | {"max": round(self.largest_ns / MS, 3)}

    def _at(self, rank: int) -> int:
        """The value that so many are before, in order of size."""
        before = 0
        for ns, count in sorted(self._counts.items()):
            before += count
            if before > rank:
                return ns
        return self.largest_ns


def percentiles_ms(values_ns: Iterable[int]) -> dict[str, float] | None:
    """See `Durations`; None without values."""
    durations = Durations()
    for value in values_ns:
        durations.add(value)
    return durations.percentiles_ms()

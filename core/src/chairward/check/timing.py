"""Reaction, measured: from light on the glass of the cameras to the bytes that tell the drive to stop.

The chair drives (wheels off the ground, or simulated), something appears at a known moment, and the first record in
which the drive was told to stand says when that was. Again and again, at moments that no clock of the chair knows.
"""

from __future__ import annotations

import random
import time
from collections.abc import Callable
from dataclasses import dataclass
from datetime import date
from math import ceil
from pathlib import Path
from statistics import median
from typing import Any

import tomlkit

from chairward.check.stimulus import Stimulus
from chairward.check.trial import Trial, TrialError, told
from chairward.components import STILL
from chairward.facts import MS

NEAR_MM = 450.0
SETTLE_S = (0.6, 1.1)
REACT_S = 5.0
ATTEMPTS = 8
"""For each time: a chair that stops by itself just before (a short gap of its computer) is asked again."""


@dataclass(frozen=True, slots=True)
class Timing:
    """What was measured, ms, in order; how, and when."""

    reactions_ms: tuple[float, ...]
    method: str
    on: date

    @property
    def longest_ms(self) -> int:
        """What the proof has to reckon with."""
        return ceil(max(self.reactions_ms))

    def __str__(self) -> str:
        middle = median(self.reactions_ms)
        return f"{len(self.reactions_ms)} times: {middle:.0f} ms in the middle, {self.longest_ms} ms at most"


def measure(
    chair: Trial, stimulus: Stimulus, times: int, tell: Callable[[str], None] = lambda _: None, seed: int | None = None
) -> Timing:
    """Let it appear so many times. Raises TrialError."""
    chance = random.Random(seed)
    reactions = []
    for nth in range(times):
        reactions.append(_once(chair, stimulus, chance))
        tell(f"{nth + 1} of {times}: {reactions[-1]:.0f} ms")
    return Timing(tuple(reactions), f"{times} times, {stimulus.method}", date.fromtimestamp(time.time()))


def _once(chair: Trial, stimulus: Stimulus, chance: random.Random) -> float:
    """One reaction, ms. Raises TrialError."""
    for _ in range(ATTEMPTS):
        stimulus.hide()
        chair.drive()
        stopped = chair.wait(lambda r: told(r) == STILL, chance.uniform(*SETTLE_S))
        if stopped is not None:
            continue
        shown_ns = stimulus.show(NEAR_MM)
        found = chair.wait(lambda r, at=shown_ns: r.wrote_ns > at and told(r) == STILL, REACT_S)  # type: ignore[misc]
        seen = found is not None and _saw(found.facts.ranges.values(), shown_ns)
        chair.stand()
        stimulus.hide()
        if found is not None and seen:
            return (found.wrote_ns - shown_ns) / MS
    raise TrialError(f"the chair did not stop for what appeared: {chair.why()}")


def _saw(windows: Any, shown_ns: int) -> bool:
    """Did a reading of something taken after that moment, near or blind, make it stop?"""
    for window in windows:
        newest = window[-1]
        near = newest.ahead_mm is not None and newest.ahead_mm < 2 * NEAR_MM
        if newest.captured_ns >= shown_ns - 50 * MS and (near or not newest.can_see):
            return True
    return False


def write(path: Path, found: Timing) -> None:
    """Into the chair file's [stopping], comments and order kept; the file is replaced in one step."""
    document = tomlkit.parse(path.read_text(encoding="utf-8"))
    if "stopping" not in document:
        document.add("stopping", tomlkit.table())
    table: Any = document["stopping"]
    for key, value in values(found).items():
        table[key] = value
    part = path.with_name(f"{path.name}.part")
    part.write_text(tomlkit.dumps(document), encoding="utf-8")
    part.replace(path)


def values(found: Timing) -> dict[str, Any]:
    """The keys of [stopping]."""
    return {"reaction_ms": found.longest_ms, "reaction_measured": found.on, "reaction_method": found.method}

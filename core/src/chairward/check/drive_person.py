"""Motion seen by a person: a question for each step, and a key for what has to be timed.

A person's key comes some 200 ms late, which is about as long as what is to be proved. So the person is not asked to be
fast: hard stops at unknown moments and silences at unknown moments come mixed, and what the silences took *longer* than
the hard stops, which begin within a few milliseconds, is how long the controller needed to notice.
"""

from __future__ import annotations

import random
from collections.abc import Sequence
from math import pi, sqrt
from statistics import fmean, stdev
from typing import Protocol

from chairward.check.drive_bench import BenchError, DriveBench
from chairward.components import STILL, Motion

SHOW_S = 2.0
TURNS = 10
PAIRS = 12
WAIT_S = (1.0, 3.0)
"""At speed before a stop, at random: nobody can press the key in time by rhythm."""
KEY_S = 5.0
TOO_SOON_S = 0.05
SURE = 2.5
"""Standard errors added to a mean: about 1 in 100 that it is longer."""
WAYS = {(1, 0): "forward", (-1, 0): "backward", (0, 1): "to the left", (0, -1): "to the right", (0, 0): "not at all"}


class Person(Protocol):
    """Who sits beside the chair."""

    def choose(self, question: str, answers: Sequence[str]) -> int:
        """The number of the answer."""

    def tell(self, text: str) -> None:
        """A line to read."""

    def pressed(self) -> bool:
        """Whether a key has been pressed since the last call."""


class PersonEyes:
    """`chairward.check.drive_eyes.Eyes` of a person with a key. wheel_mm: diameter; track_mm: between the wheels."""

    method = "seen by a person, timed by a key against hard stops"
    silences = 1

    def __init__(self, person: Person, wheel_mm: float, track_mm: float, *, seed: int | None = None) -> None:
        self._person, self._wheel_mm, self._track_mm = person, wheel_mm, track_mm
        self._chance = random.Random(seed)

    def ways(self, bench: DriveBench, motion: Motion) -> tuple[int, int]:
        """Ask which way the chair would have gone."""
        bench.arm()
        bench.hold(motion, SHOW_S)
        bench.hold(STILL, SHOW_S)
        answers = list(WAYS.values())
        return list(WAYS)[self._person.choose("Which way would the chair have gone?", answers)]

    def speed(self, bench: DriveBench, motion: Motion) -> Motion | None:
        """Time ten turns of a wheel; None without its size."""
        if self._wheel_mm <= 0.0 or (motion.turn_deg_s and self._track_mm <= 0.0):
            return None
        self._person.tell(
            f"Mark the left wheel. Press a key when the mark passes, count {TURNS} more, press again at the last."
        )
        bench.arm()
        bench.hold(motion, SHOW_S)
        start = self._key_ns(bench, motion, 60.0)
        end = self._key_ns(bench, motion, 600.0)
        bench.hold(STILL, SHOW_S)
        rim_mm_s = TURNS * pi * self._wheel_mm / ((end - start) / 1e9)
        if motion.turn_deg_s:
            return Motion(0.0, rim_mm_s / (self._track_mm / 2.0) * 180.0 / pi)
        return Motion(rim_mm_s, 0.0)

    def stop_s(self, bench: DriveBench, motion: Motion, *, hard_stop: bool) -> float | None:
        """Only whether they stop: a controlled stop cannot be timed by eye."""
        bench.arm()
        bench.hold(motion, SHOW_S)
        bench.hold(STILL, SHOW_S, hard_stop=hard_stop)
        if self._person.choose("Do the wheels stand now?", ["yes", "no"]) == 1:
            raise BenchError("told to stop, the wheels still turn")
        return None

    def silence_ms(self, bench: DriveBench, motion: Motion, longest_s: float) -> float:
        """By how much silences take longer than hard stops, with what chance may add."""
        self._person.tell(
            f"{2 * PAIRS} times: press a key as soon as the wheels begin to stop. Two kinds of stop come mixed."
        )
        kinds = [True, False] * PAIRS
        self._chance.shuffle(kinds)
        took: dict[bool, list[float]] = {True: [], False: []}
        for silent in kinds:
            took[silent].append(self._timed(bench, motion, longest_s, silent=silent))
        return longer_by_ms(took[True], took[False])

    def _timed(self, bench: DriveBench, motion: Motion, longest_s: float, *, silent: bool) -> float:
        """Milliseconds from the last command, or from the hard stop, to the key; a key too soon counts for nothing."""
        while True:
            bench.arm()
            self._person.pressed()
            early = bench.hold(motion, self._chance.uniform(*WAIT_S), self._person.pressed)
            start = bench.commanded_ns if silent else bench.clock.now_ns()
            if silent:
                late = not bench.silent(longest_s + KEY_S, self._person.pressed)
            else:
                late = not bench.hold(STILL, KEY_S, self._person.pressed, hard_stop=True)
            end = bench.clock.now_ns()
            bench.hold(STILL, 0.5, hard_stop=True)
            if late:
                raise BenchError("no key was pressed: the wheels do not stop by themselves, or nobody looked")
            if not early and end - start > TOO_SOON_S * 1e9:
                return (end - start) / 1e6
            self._person.tell("That key came before the stop: once more.")

    def _key_ns(self, bench: DriveBench, motion: Motion, longest_s: float) -> int:
        self._person.pressed()
        if not bench.hold(motion, longest_s, self._person.pressed):
            raise BenchError("no key was pressed")
        return bench.clock.now_ns()


def longer_by_ms(silent: Sequence[float], known: Sequence[float]) -> float:
    """How much longer the silent stops take on average, plus 2.5 standard errors; both in ms, three or more of each."""
    error = sqrt(stdev(silent) ** 2 / len(silent) + stdev(known) ** 2 / len(known))
    return max(0.0, fmean(silent) - fmean(known)) + SURE * error

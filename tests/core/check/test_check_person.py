"""A person as the instrument: questions, turns of a wheel, and a silence timed by a slow and honest key."""

from __future__ import annotations

import random
from collections.abc import Sequence
from math import pi
from typing import Any

import pytest

from chairward.check.drive_bench import BenchError
from chairward.check.drive_person import WAYS, PersonEyes, longer_by_ms
from chairward.components import STILL, Motion

WHEEL_MM, TRACK_MM = 320.0, 560.0
HALF = Motion(250.0, 0.0)


class Watcher:
    """Sees the puppet's wheels; presses the key about 230 ms after they begin to stop, as people do."""

    def __init__(self, puppet: Any, *, seed: int = 1, early: int = 0, asleep: bool = False) -> None:
        self._puppet, self._chance, self._early, self._asleep = puppet, random.Random(seed), early, asleep
        self._most = STILL
        self._cruise_ns = self._fell_ns = self._late_ns = 0
        self.told: list[str] = []
        self.counting = False
        self._way_mm = 0.0
        self.first: int | None = None
        self._then_ns = puppet.now

    def tell(self, text: str) -> None:
        self.told.append(text)
        self.counting = text.startswith("Mark")

    def choose(self, question: str, answers: Sequence[str]) -> int:
        if answers[0] == "yes":
            return 0 if self._puppet.wheels == STILL else 1
        wanted = self._puppet.seen
        return list(answers).index(wanted)

    def pressed(self) -> bool:
        now, speed = self._puppet.now, abs(self._puppet.wheels.drive_mm_s)
        if self._asleep:
            return False
        if self.counting:
            return self._passes(now)
        if speed > 200.0:
            self._fell_ns = 0
            self._cruise_ns = self._cruise_ns or now
            if self._early and now - self._cruise_ns > 300_000_000:
                self._early -= 1
                self._cruise_ns = 0
                return True
            return False
        self._cruise_ns = 0
        if not self._fell_ns:
            self._fell_ns, self._late_ns = now, int(self._chance.gauss(230.0, 35.0) * 1e6)
        if now - self._fell_ns >= self._late_ns > 0:
            self._late_ns = 0
            return True
        return False

    def _passes(self, now: int) -> bool:
        """The mark is at the top once a turn; a key at the first and at the eleventh."""
        wheels = self._puppet.wheels
        rim = abs(wheels.drive_mm_s) + abs(wheels.turn_deg_s) * pi / 180.0 * TRACK_MM / 2.0
        before = self._way_mm
        self._way_mm += rim * (now - self._then_ns) / 1e9
        self._then_ns = now
        turn = pi * WHEEL_MM
        crossed = int(before / turn) != int(self._way_mm / turn)
        if crossed and (self.first is None or int(self._way_mm / turn) - self.first == 10):
            self.first = int(self._way_mm / turn) if self.first is None else None
            return True
        return False


def eyes(puppet: Any, watcher: Watcher, seed: int = 7) -> PersonEyes:
    return PersonEyes(watcher, WHEEL_MM, TRACK_MM, seed=seed)


@pytest.mark.parametrize("seed", range(2))
@pytest.mark.parametrize("silence_ms", [60.0, 200.0])
def test_a_silence_timed_by_a_slow_key_is_bounded_from_above_and_not_by_the_reaction(
    puppet_type, seed: int, silence_ms: float
) -> None:
    puppet = puppet_type(silence_ms=silence_ms)
    bench = puppet.bench()
    bench.connect()
    found = eyes(puppet, Watcher(puppet, seed=seed), seed).silence_ms(bench, HALF, 3.0)
    assert silence_ms - 5.0 <= found <= silence_ms + 100.0


def test_a_key_that_comes_before_the_stop_counts_for_nothing(puppet) -> None:
    watcher = Watcher(puppet, early=3)
    bench = puppet.bench()
    bench.connect()
    found = eyes(puppet, watcher).silence_ms(bench, HALF, 3.0)
    assert 145.0 <= found <= 250.0
    assert watcher.told.count("That key came before the stop: once more.") == 3


def test_nobody_pressing_is_no_measurement(puppet) -> None:
    bench = puppet.bench()
    bench.connect()
    with pytest.raises(BenchError, match="no key was pressed"):
        eyes(puppet, Watcher(puppet, asleep=True)).silence_ms(bench, HALF, 3.0)


@pytest.mark.parametrize("motion", [HALF, Motion(0.0, 22.5)])
def test_ten_turns_of_a_wheel_give_its_speed(puppet, motion: Motion) -> None:
    bench = puppet.bench()
    bench.connect()
    seen = eyes(puppet, Watcher(puppet)).speed(bench, motion)
    assert seen is not None
    assert seen.drive_mm_s == pytest.approx(motion.drive_mm_s, rel=0.01)
    assert seen.turn_deg_s == pytest.approx(motion.turn_deg_s, rel=0.01)


def test_without_the_wheels_size_the_scale_is_not_seen(puppet) -> None:
    assert PersonEyes(Watcher(puppet), 0.0, TRACK_MM).speed(puppet.bench(), HALF) is None
    assert PersonEyes(Watcher(puppet), WHEEL_MM, 0.0).speed(puppet.bench(), Motion(0.0, 20.0)) is None


@pytest.mark.parametrize("ways", WAYS)
def test_what_the_person_answers_is_the_way(puppet, ways: tuple[int, int]) -> None:
    puppet.seen = WAYS[ways]
    bench = puppet.bench()
    bench.connect()
    assert eyes(puppet, Watcher(puppet)).ways(bench, HALF) == ways
    assert puppet.wheels == STILL


def test_wheels_that_the_person_still_sees_turning_are_refused(puppet) -> None:
    bench = puppet.bench()
    bench.connect()
    assert eyes(puppet, Watcher(puppet)).stop_s(bench, HALF, hard_stop=False) is None
    puppet.ignores_stop = True
    with pytest.raises(BenchError, match="still turn"):
        eyes(puppet, Watcher(puppet)).stop_s(bench, HALF, hard_stop=True)


def test_chance_only_ever_lengthens_the_result() -> None:
    steady = longer_by_ms([400.0, 400.0, 400.0], [200.0, 200.0, 200.0])
    assert steady == 200.0
    assert longer_by_ms([380.0, 400.0, 420.0], [180.0, 200.0, 220.0]) > steady
    assert longer_by_ms([200.0, 200.0, 200.0], [300.0, 300.0, 300.0]) == 0.0

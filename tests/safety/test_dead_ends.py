"""Whoever is stopped is told a way out that leads out (benchmarks/dead_ends.py has a thousand of these)."""

from __future__ import annotations

from random import Random

import pytest

from chairward.testing.dead_ends import NAMED_WITHIN_NS, Escape, Outcome

FREE = [seed for seed in range(22) if seed != 1]
BOXED_IN = (1, 25)
"""Dead ends in which somebody puts a box across the way back."""


def ride(seed: int, chair: str) -> Outcome:
    outcome = Escape(Random(seed), chair).run()
    assert outcome.stops > 0, "it was stopped at all"
    assert outcome.named_s * 1e9 <= NAMED_WITHIN_NS
    return outcome


@pytest.mark.parametrize("seed", FREE)
def test_a_chair_with_one_camera_pair_gets_out_of_a_dead_end_by_the_ways_that_are_named(seed: int) -> None:
    assert ride(seed, "camera").out


@pytest.mark.parametrize("seed", [0, 3, 5, 9])
def test_a_chair_with_sonars_all_round_gets_out_too_and_touches_nothing(seed: int) -> None:
    outcome = ride(seed, "all round")
    assert outcome.out
    assert outcome.touched == 0


@pytest.mark.parametrize("seed", BOXED_IN)
def test_where_the_way_back_was_blocked_help_is_called_at_the_latest(seed: int) -> None:
    outcome = ride(seed, "camera")
    assert outcome.boxed_in
    assert outcome.out or outcome.helped

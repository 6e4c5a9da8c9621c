"""The rules, said a second time for arrays of cases, decide as the rules do; and over many cases P2 holds."""

from __future__ import annotations

from dataclasses import replace
from random import Random

import numpy as np
import pytest

from chairward.arbiter import decide
from chairward.testing import cases, many
from chairward.testing.many_rides import twins


@pytest.mark.parametrize("seed", range(12))
def test_an_array_of_cases_is_decided_as_each_of_them_alone(seed: int) -> None:
    limits = cases.some_limits(Random(seed))
    facts = many.some(np.random.default_rng(seed), limits, 150)
    together = many.motions(facts)
    assert (together != 0.0).any(axis=1).mean() > 0.1, "a law about chairs that all stand shows nothing"
    for row in range(len(together)):
        _, decision = decide(*many.alone(facts, row), facts.limits)
        assert decision.motion == pytest.approx(tuple(together[row]), abs=1e-9), row


@pytest.mark.parametrize("seed", range(20))
def test_no_worse_case_is_faster(seed: int) -> None:
    limits, rng = cases.some_limits(Random(seed)), np.random.default_rng(seed)
    facts = many.some(rng, limits, 20_000)
    worse = many.worse(rng, facts)
    assert many.no_faster(many.motions(worse), many.motions(facts), limits.steer_deg_s).all()


def test_a_rule_that_gave_something_would_be_noticed() -> None:
    """The judge is no rubber stamp: read the other way round, the law is broken."""
    limits, rng = cases.some_limits(Random(1)), np.random.default_rng(1)
    facts = many.some(rng, limits, 2_000, trouble=0.0)
    blind = replace(facts, blind=np.full_like(facts.blind, 3))
    assert not many.no_faster(many.motions(facts), many.motions(blind), limits.steer_deg_s).all()


@pytest.mark.parametrize("seed", range(6))
def test_no_twin_whose_facts_are_now_and_then_worse_is_ever_faster(seed: int) -> None:
    """And the state that the arrays carry from tick to tick is the one that the decisions leave behind."""
    limits = cases.some_limits(Random(seed))
    stood = 0
    for tick in twins(np.random.default_rng(seed), limits, 2_000, 60):
        assert many.no_faster(tick.worse_motion, tick.better_motion, limits.steer_deg_s).all()
        stood += int(((tick.worse_motion == 0.0) & (tick.better_motion != 0.0)).any(axis=1).sum())
        for shown, moved in ((tick.better, tick.better_motion), (tick.worse, tick.worse_motion)):
            for row in range(4):
                state, facts = many.alone(shown, row)
                after, decision = decide(state, facts, shown.limits)
                assert decision.motion == pytest.approx(tuple(moved[row]), abs=1e-9)
                assert state.wish is None or (after.wish is None) == many.spent(shown)[row]
    assert stood > 100, "twins that do the same show nothing"

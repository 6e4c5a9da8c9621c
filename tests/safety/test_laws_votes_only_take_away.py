"""P2 as laws: whatever gets worse, nothing gets faster. The laws and what "worse" means are in `chairward.testing`."""

from __future__ import annotations

from random import Random

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from chairward.facts import Facts
from chairward.testing import cases, laws
from chairward.testing.ride import START_NS

MANY = settings(max_examples=2_500, deadline=None, suppress_health_check=list(HealthCheck))
SEED = st.integers(0, 2**48)


@MANY
@given(SEED)
def test_in_the_same_state_worse_facts_never_give_a_faster_motion(seed: int) -> None:
    laws.one_step(Random(seed))


@settings(MANY, max_examples=50)
@given(SEED)
def test_over_a_whole_ride_a_twin_with_worse_facts_is_never_faster(seed: int) -> None:
    laws.twin_rides(Random(seed), ticks=60)


@settings(MANY, max_examples=60)
@given(SEED)
def test_every_law_of_one_decision_holds_along_random_rides(seed: int) -> None:
    laws.random_ride(Random(seed), ticks=60)


def test_the_laws_are_not_kept_by_standing_still() -> None:
    """Of the cases of the first law a good part moves, and every way of making things worse stops some of them."""
    moved, stopped = 0, set()
    for seed in range(10_000):
        name, worse, better = laws.one_step(Random(seed))
        moved += better != (0.0, 0.0)
        if better != worse:
            stopped.add(name)
    assert moved > 1_600
    assert stopped == set(cases.WORSE) - {"messages are refused"}


def test_the_twins_of_the_second_law_drive() -> None:
    assert sum(laws.twin_rides(Random(seed), ticks=60) > 50.0 for seed in range(12)) >= 3


@pytest.mark.parametrize("name", tuple(cases.WORSE))
def test_what_is_made_worse_was_never_said_later_than_before(name: str) -> None:
    """Else it would be less silent than its twin: whose silence latches may then stand while the worse one drives."""
    for seed in range(200):
        rng = Random(seed)
        limits = cases.some_limits(rng)
        facts = cases.some_facts(rng, limits, START_NS)
        before, after = last_said(facts), last_said(cases.WORSE[name](rng, facts, limits))
        assert all(after[source] <= before[source] for source in after.keys() & before.keys())


def last_said(facts: Facts) -> dict[str, int]:
    said = {source: window[-1].captured_ns for source, window in facts.ranges.items() if window}
    said |= {source: one.captured_ns for source, one in (*facts.vetoes.items(), *facts.alive.items())}
    return said | {"drive": facts.drive.at_ns, "supervisor": facts.supervisor_ns}

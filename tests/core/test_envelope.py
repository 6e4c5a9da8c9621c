"""The algebra: votes only take away, in any order, and a motion keeps its path."""

from __future__ import annotations

from itertools import permutations
from math import inf, isclose

import pytest
from hypothesis import assume, given
from hypothesis import strategies as st

from chairward.components import STILL, Motion
from chairward.envelope import CLOSED, OPEN, Caps, Envelope, Grip, binding, fit, meet, scale

SPEED = st.sampled_from([0.0, 1.0, 20.0, 150.0, 500.0, inf]) | st.floats(0.0, 2_000.0)
CAPS = st.builds(Caps, SPEED, SPEED, SPEED, SPEED)
VOTE = st.builds(Envelope, CAPS, st.sampled_from("abc"))
MOTION = st.builds(Motion, st.floats(-1_500, 1_500), st.floats(-90, 90))


def at_most(motion: Motion, caps: Caps) -> bool:
    drive, turn = motion
    slack = 1 + 1e-9
    return (
        -caps.backward_mm_s * slack <= drive <= caps.forward_mm_s * slack
        and -caps.right_deg_s * slack <= turn <= caps.left_deg_s * slack
    )


def test_no_votes_leave_everything_open() -> None:
    assert meet([]) == OPEN


@given(st.lists(VOTE, max_size=4))
def test_the_order_of_votes_does_not_matter(votes: list[Envelope]) -> None:
    assert {meet(order) for order in permutations(votes)} == {meet(votes)}


@given(st.lists(VOTE, max_size=4), st.lists(VOTE, max_size=4))
def test_merging_is_associative_and_a_vote_twice_is_a_vote_once(a: list[Envelope], b: list[Envelope]) -> None:
    merged = [Envelope(meet(a), "a"), Envelope(meet(b), "b")]
    assert meet(merged) == meet(a + b) == meet(a + b + a)


@given(st.lists(VOTE, max_size=4), VOTE)
def test_one_more_vote_never_widens(votes: list[Envelope], more: Envelope) -> None:
    wider, narrower = meet(votes), meet([*votes, more])
    assert all(n <= w for n, w in zip(narrower, wider, strict=True))
    assert all(n <= m for n, m in zip(narrower, more.caps, strict=True))


@given(MOTION, CAPS)
def test_a_fitted_motion_is_within_the_caps(motion: Motion, caps: Caps) -> None:
    assert at_most(fit(motion, caps), caps)


@given(MOTION, CAPS)
def test_a_fitted_motion_keeps_its_path_and_gains_nothing(motion: Motion, caps: Caps) -> None:
    drive, turn = fit(motion, caps)
    assert abs(drive) <= abs(motion.drive_mm_s)
    assert abs(turn) <= abs(motion.turn_deg_s)
    assert isclose(drive * motion.turn_deg_s, turn * motion.drive_mm_s, rel_tol=1e-9, abs_tol=1e-9)


@given(MOTION, CAPS, CAPS)
def test_narrower_caps_never_make_a_motion_faster(motion: Motion, a: Caps, b: Caps) -> None:
    both = Caps(*map(min, a, b))
    assert scale(motion, both) <= min(scale(motion, a), scale(motion, b))


@given(MOTION, CAPS)
def test_fitting_takes_no_more_than_it_must(motion: Motion, caps: Caps) -> None:
    s = scale(motion, caps)
    assume(1e-6 < s < 1.0)
    a_little_more = Motion(motion.drive_mm_s * s * 1.001, motion.turn_deg_s * s * 1.001)
    assert not at_most(a_little_more, caps)


def test_a_closed_way_that_is_wanted_stops_the_whole_motion() -> None:
    assert fit(Motion(300.0, 20.0), OPEN._replace(left_deg_s=0.0)) == STILL
    assert fit(Motion(300.0, 20.0), OPEN._replace(right_deg_s=0.0)) == Motion(300.0, 20.0)


EACH_WAY = (Motion(300.0, 0.0), Motion(-300.0, 0.0), Motion(0.0, 30.0), Motion(0.0, -30.0))
"""In the order of Caps."""


@pytest.mark.parametrize("nth", range(4), ids=Caps._fields)
def test_a_third_of_the_speed_allowed_is_a_third_of_the_motion_and_the_other_ways_are_free(nth: int) -> None:
    motion = EACH_WAY[nth]
    third = [inf] * 4
    third[nth] = abs(motion.drive_mm_s + motion.turn_deg_s) / 3.0
    assert scale(motion, Caps(*third)) == pytest.approx(1.0 / 3.0)
    assert all(scale(other, Caps(*third)) == 1.0 for other in EACH_WAY if other != motion)


@pytest.mark.parametrize("motion", EACH_WAY)
def test_where_all_is_closed_nothing_moves(motion: Motion) -> None:
    assert fit(motion, CLOSED) == STILL


def test_a_gap_a_protective_stop_and_a_fault_are_three_things() -> None:
    assert len(set(Grip)) == 3


def test_standing_still_fits_even_where_all_is_closed() -> None:
    assert fit(STILL, CLOSED) == STILL
    assert scale(STILL, CLOSED) == 1.0


@given(MOTION, st.lists(VOTE, max_size=5))
def test_the_binding_votes_are_those_that_alone_would_slow_as_much(motion: Motion, votes: list[Envelope]) -> None:
    all_together = scale(motion, meet(votes))
    named = binding(motion, votes)
    if all_together >= 1.0:
        assert named == ()
    else:
        assert named
        assert all(scale(motion, vote.caps) == all_together for vote in named)
        assert all(scale(motion, vote.caps) > all_together for vote in votes if vote not in named)

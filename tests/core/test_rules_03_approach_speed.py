"""Rule 3: only as fast as the chair can still stop before stop_mm, all delays included."""

from __future__ import annotations

from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st
from msgspec.structs import replace

from chairward.envelope import Caps, meet
from chairward.facts import Limits
from chairward.messages import Way
from chairward.rules import CREEP_MM_S, CREEP_ROOM_MM, approach_speed
from chairward.scene import look
from chairward.stopping import stopping_distance_mm
from chairward.testing.ride import FRONT, START_NS, chair_limits, driving, healthy, readings

LIMITS = chair_limits(caps=Caps(1_250.0, 400.0, 40.0, 40.0))


def caps_for(limits: Limits = LIMITS, reported: float | None = None, **said: Any) -> Caps:
    facts = healthy(limits, ranges={FRONT: readings(START_NS, **said)})
    facts = replace(facts, drive=replace(facts.drive, speed_mm_s=reported))
    votes = list(approach_speed(look(facts, driving(), limits)))
    assert all(vote.rule == "approach_speed" and vote.source == FRONT for vote in votes)
    return meet(votes)


@given(st.integers(601, 5_000), st.floats(0.1, 1.5), st.floats(200.0, 2_000.0))
def test_from_the_speed_allowed_the_chair_stands_before_stop_mm_less_the_creep(
    ahead: int, reaction: float, decel: float
) -> None:
    limits = replace(LIMITS, reaction_s=reaction, decel_mm_s2=decel)
    speed = min(caps_for(limits, ahead_mm=ahead).forward_mm_s, limits.caps.forward_mm_s)
    rests_at = ahead - stopping_distance_mm(speed, reaction, decel)
    assert rests_at >= limits.stop_mm - CREEP_ROOM_MM - 1e-6


@given(st.integers(601, 4_999))
def test_the_allowance_is_not_wasted(ahead: int) -> None:
    speed = caps_for(ahead_mm=ahead).forward_mm_s
    late_mm = 600.0 * 0.45**2 / 2
    if CREEP_MM_S < speed < LIMITS.caps.forward_mm_s:
        assert ahead - stopping_distance_mm(speed, 0.45, 600.0) <= LIMITS.stop_mm + late_mm + 1e-6


@given(st.integers(0, 5_000), st.integers(0, 5_000), st.integers(0, 3_000))
def test_nearer_or_coming_closer_never_allows_more(a: int, b: int, closing: int) -> None:
    near, far = sorted((a, b))
    assert caps_for(ahead_mm=near).forward_mm_s <= caps_for(ahead_mm=far).forward_mm_s
    assert caps_for(ahead_mm=far, closing_mm_s=closing).forward_mm_s <= caps_for(ahead_mm=far).forward_mm_s


def test_while_there_is_room_the_chair_creeps_so_that_the_stop_is_reached() -> None:
    assert caps_for(ahead_mm=601).forward_mm_s == CREEP_MM_S == 60.0
    assert caps_for(ahead_mm=600).forward_mm_s == 0.0
    assert caps_for(ahead_mm=500).forward_mm_s == 0.0


def test_with_a_poor_brake_even_the_creep_is_slower() -> None:
    poor = replace(LIMITS, reaction_s=2.5, decel_mm_s2=100.0)
    creep = caps_for(poor, ahead_mm=601).forward_mm_s
    assert creep < CREEP_MM_S
    assert stopping_distance_mm(creep, 2.5, 100.0) == pytest.approx(CREEP_ROOM_MM)
    assert CREEP_ROOM_MM == 100.0


@given(st.integers(601, 5_000), st.integers(1, 2_000))
def test_somebody_walking_at_the_chair_is_met_by_a_chair_at_rest_before_stop_mm(ahead: int, closing: int) -> None:
    speed = min(caps_for(ahead_mm=ahead, closing_mm_s=closing).forward_mm_s, LIMITS.caps.forward_mm_s)
    if speed > 0.0:
        walked = closing * (LIMITS.reaction_s + speed / LIMITS.decel_mm_s2)
        driven = stopping_distance_mm(speed, LIMITS.reaction_s, LIMITS.decel_mm_s2)
        assert ahead - walked - driven >= LIMITS.stop_mm - 1e-6


def test_somebody_who_will_be_too_near_within_the_reaction_time_stops_the_chair() -> None:
    walked = int(1_400 * LIMITS.reaction_s)
    assert caps_for(ahead_mm=600 + walked, closing_mm_s=1_400).forward_mm_s == 0.0
    assert caps_for(ahead_mm=600 + walked + 62, closing_mm_s=1_400).forward_mm_s > 0.0


def test_the_fastest_closing_of_three_readings_counts() -> None:
    calm, quick = readings(START_NS, ahead_mm=1_500), readings(START_NS, ahead_mm=1_500, closing_mm_s=1_000)
    facts = healthy(LIMITS, ranges={FRONT: (quick[0], *calm[1:])})
    votes = approach_speed(look(facts, driving(), LIMITS))
    assert meet(votes) == caps_for(ahead_mm=1_500, closing_mm_s=1_000)


def test_far_away_there_is_nothing_to_say() -> None:
    assert caps_for(ahead_mm=5_000) == Caps()


def test_there_is_something_to_say_from_where_the_chair_could_no_longer_go_at_its_own_limit() -> None:
    assert LIMITS.caps.forward_mm_s - 1.0 < caps_for(ahead_mm=2_525).forward_mm_s < LIMITS.caps.forward_mm_s
    assert caps_for(ahead_mm=2_526) == Caps()
    assert LIMITS.caps.backward_mm_s - 2.0 < caps_for(behind_mm=973).backward_mm_s < LIMITS.caps.backward_mm_s
    assert caps_for(behind_mm=975) == Caps()


def test_each_way_is_told_with_its_own_distance() -> None:
    facts = healthy(LIMITS, ranges={FRONT: readings(START_NS, ahead_mm=900, behind_mm=800)})
    assert [vote.detail for vote in approach_speed(look(facts, driving(), LIMITS))] == ["900 mm ahead", "800 mm behind"]


def test_somebody_closing_in_from_far_away_slows_the_chair_too_and_leaves_no_creep() -> None:
    assert caps_for(ahead_mm=3_000, closing_mm_s=2_000).forward_mm_s < LIMITS.caps.forward_mm_s
    assert 0.0 < caps_for(ahead_mm=670, closing_mm_s=1).forward_mm_s < CREEP_MM_S


def test_behind_counts_for_backing_with_the_same_formula() -> None:
    limits = replace(LIMITS, caps=Caps(1_250.0, 1_250.0, 40.0, 40.0))
    assert caps_for(limits, behind_mm=1_000, ahead_mm=None).backward_mm_s == caps_for(ahead_mm=1_000).forward_mm_s
    assert caps_for(limits, behind_mm=600, ahead_mm=None).backward_mm_s == 0.0


def test_a_chair_that_reports_to_be_too_fast_to_stop_in_time_is_stopped() -> None:
    just_enough = int(600 + stopping_distance_mm(800.0, 0.0, LIMITS.decel_mm_s2)) + 1
    assert caps_for(reported=800.0, ahead_mm=just_enough).forward_mm_s > 0.0
    assert caps_for(reported=800.0, ahead_mm=just_enough - 2).forward_mm_s == 0.0


def test_a_chair_that_needs_exactly_the_room_is_not_too_fast() -> None:
    assert stopping_distance_mm(600.0, 0.0, LIMITS.decel_mm_s2) == 300.0
    assert caps_for(reported=600.0, ahead_mm=900).forward_mm_s > 0.0
    assert caps_for(reported=600.0, ahead_mm=899).forward_mm_s == 0.0
    assert caps_for(reported=61.0, ahead_mm=601).forward_mm_s == 0.0, "faster than the creep, and 1 mm of room"


def test_a_chair_that_races_beyond_its_own_limit_is_stopped_from_farther_away() -> None:
    assert caps_for(reported=2_000.0, ahead_mm=3_500).forward_mm_s == 0.0
    assert caps_for(reported=2_000.0, ahead_mm=3_933).forward_mm_s == 0.0
    assert caps_for(reported=2_000.0, ahead_mm=3_934) == Caps()


def test_backing_fast_does_not_close_the_way_ahead_and_the_other_way_round() -> None:
    both = {"ahead_mm": 900, "behind_mm": 900}
    back, ahead = caps_for(reported=-900.0, **both), caps_for(reported=900.0, **both)
    assert (back.backward_mm_s, ahead.forward_mm_s) == (0.0, 0.0)
    assert back.forward_mm_s > 0.0
    assert ahead.backward_mm_s > 0.0


def test_a_chair_that_lags_a_tenth_of_a_second_behind_its_allowance_is_not_called_too_fast() -> None:
    for ahead in range(640, 4_000, 7):
        lagging = min(caps_for(ahead_mm=ahead).forward_mm_s, 1_250.0) + LIMITS.decel_mm_s2 * 0.1
        assert caps_for(reported=lagging, ahead_mm=ahead).forward_mm_s > 0.0


def test_a_chair_at_creep_speed_is_never_too_fast() -> None:
    assert caps_for(reported=CREEP_MM_S, ahead_mm=601).forward_mm_s == CREEP_MM_S


def test_only_the_way_that_is_near_is_slowed() -> None:
    caps = caps_for(ahead_mm=900)
    assert [way for way, cap in zip(Way, caps, strict=True) if cap < 1_250.0] == [Way.AHEAD]


@pytest.mark.parametrize(("way", "nth", "reported"), [("ahead_mm", 0, 2_000.0), ("behind_mm", 1, -800.0)])
def test_a_chair_reported_faster_than_its_cap_is_stopped_from_farther_off(way: str, nth: int, reported: float) -> None:
    brakes_in = stopping_distance_mm(abs(reported), 0.0, LIMITS.decel_mm_s2)
    at = {way: round(LIMITS.stop_mm + brakes_in - 50)}
    assert caps_for(reported=reported, **at)[nth] == 0.0
    assert caps_for(reported=0.0, **at)[nth] >= LIMITS.caps[nth]

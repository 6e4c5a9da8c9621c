"""Rule 2: nearest <= stop_mm closes that way; stop on any one of three readings, release on all three."""

from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st
from msgspec.structs import replace

from chairward.components import STILL
from chairward.envelope import OPEN, Caps, Grip, meet
from chairward.facts import Decision
from chairward.messages import Command, Way
from chairward.rules import stop_distance
from chairward.scene import look
from chairward.testing.ride import FRONT, START_NS, Ride, chair_limits, driving, healthy, readings

LIMITS = chair_limits()


def caps_for(*windows: dict[str, int | None]) -> Caps:
    """What the rule leaves when the three readings say these distances (one given: all three the same)."""
    three = windows if len(windows) == 3 else windows * 3
    said = tuple(readings(START_NS, **w)[i] for i, w in enumerate(three))
    votes = list(stop_distance(look(healthy(LIMITS, ranges={FRONT: said}), driving(), LIMITS)))
    assert all(vote.rule == "stop_distance" and vote.source == FRONT and vote.grip is Grip.SPENDS for vote in votes)
    return meet(votes)


@pytest.mark.parametrize(
    ("way", "limit_mm", "closed"),
    [
        ("ahead_mm", 600, OPEN._replace(forward_mm_s=0.0)),
        ("behind_mm", 600, OPEN._replace(backward_mm_s=0.0)),
        ("left_mm", 250, OPEN._replace(left_deg_s=0.0)),
        ("right_mm", 250, OPEN._replace(right_deg_s=0.0)),
    ],
)
def test_at_the_limit_that_way_closes_and_one_millimetre_farther_it_is_open(
    way: str, limit_mm: int, closed: Caps
) -> None:
    assert caps_for({"ahead_mm": 4_000, way: limit_mm}) == closed
    assert caps_for({"ahead_mm": 4_000, way: limit_mm + 1}) == OPEN


def test_what_stands_before_the_toes_closes_turning_both_ways_too() -> None:
    assert caps_for({"ahead_mm": 250}) == Caps(0.0, OPEN.backward_mm_s, 0.0, 0.0)
    assert caps_for({"ahead_mm": 251}) == OPEN._replace(forward_mm_s=0.0)


@pytest.mark.parametrize("near", [0, 1, 2])
def test_any_one_of_three_readings_stops(near: int) -> None:
    windows: list[dict[str, int | None]] = [{"ahead_mm": 4_000}] * 3
    windows[near] = {"ahead_mm": 600}
    assert caps_for(*windows).forward_mm_s == 0.0


def test_a_way_that_no_reading_speaks_of_is_not_closed_here() -> None:
    assert caps_for({"ahead_mm": None}) == OPEN


@given(st.lists(st.none() | st.integers(0, 5_000), min_size=3, max_size=3))
def test_the_nearest_of_three_decides_whatever_their_order(distances: list[int | None]) -> None:
    nearest = min((mm for mm in distances if mm is not None), default=5_000)
    closed = caps_for(*({"ahead_mm": mm} for mm in distances)).forward_mm_s == 0.0
    assert closed == (nearest <= LIMITS.stop_mm)


def test_a_farther_stop_distance_of_the_person_counts() -> None:
    limits = replace(LIMITS, stop_mm=900)
    facts = healthy(limits, ranges={FRONT: readings(START_NS, ahead_mm=900)})
    assert meet(stop_distance(look(facts, driving(), limits))).forward_mm_s == 0.0


def stopped_at_a_wall() -> tuple[Ride, Decision]:
    ride = Ride()
    ride.drive_off()
    ride.world[FRONT] = {"ahead_mm": 560, "left_mm": 900, "right_mm": 900}
    return ride, ride.tick()


def test_the_chair_stops_in_the_very_decision_that_sees_it_and_says_why() -> None:
    _, decision = stopped_at_a_wall()
    assert decision.motion == STILL
    assert decision.protective_stop
    assert not decision.hard_stop, "a protective stop is a controlled stop"
    assert (decision.reasons[0].rule, decision.reasons[0].source) == ("stop_distance", FRONT)
    assert decision.reasons[0].detail == "560 mm ahead"
    assert decision.instruction == "Stop now"
    assert decision.nearest_mm == 560


def test_backing_out_and_turning_away_stay_possible_and_are_named() -> None:
    ride, decision = stopped_at_a_wall()
    assert decision.open_ways == (Way.BEHIND, Way.LEFT, Way.RIGHT)
    assert ride.tick(Command.BACK, times=5).motion.drive_mm_s < 0.0
    ride.tick(Command.STOP)
    assert ride.tick(Command.LEFT, times=5).motion.turn_deg_s > 0.0


def test_the_same_word_does_not_move_into_it() -> None:
    ride, _ = stopped_at_a_wall()
    refused = ride.tick(Command.FRONT)
    assert refused.motion == STILL
    assert not refused.protective_stop, "nothing was moving: a word is refused, no stop took place"
    assert ride.state.wish is None


@pytest.mark.parametrize("mm", [0, 100])
@pytest.mark.parametrize(
    ("way", "nth"), [("ahead_mm", 0), ("behind_mm", 1), ("left_mm", 2), ("right_mm", 3)], ids=Caps._fields
)
def test_what_is_much_too_near_closes_its_way_too(way: str, nth: int, mm: int) -> None:
    assert caps_for({way: mm})[nth] == 0.0


@pytest.mark.parametrize("mm", [0, 100, 250])
def test_what_is_before_the_toes_closes_both_turns(mm: int) -> None:
    caps = caps_for({"ahead_mm": mm})
    assert (caps.left_deg_s, caps.right_deg_s) == (0.0, 0.0)

"""Rule 4: between stop_mm and avoid_mm slowly, and (where the chair allows it) a slight turn to the freer side."""

from __future__ import annotations

from typing import Any

import pytest
from msgspec.structs import replace

from chairward.arbiter import decide
from chairward.components import STILL, Motion
from chairward.envelope import OPEN, meet
from chairward.facts import MS, Decision, Limits, SourceLimits, State
from chairward.messages import Command
from chairward.rules import avoid, freer_side
from chairward.scene import look
from chairward.testing.ride import AHEAD_AND_SIDES, FRONT, START_NS, Ride, chair_limits, driving, healthy, readings

LIMITS = chair_limits(steer_deg_s=8.0, reaction_s=0.3)
SECOND = "second/range"
TWO = replace(LIMITS, sensors={**LIMITS.sensors, SECOND: SourceLimits(freshness_ns=200 * MS, covers=AHEAD_AND_SIDES)})


def side(limits: Limits = LIMITS, **said: dict[str, int | None]) -> float:
    ranges = {name.replace("_", "/"): readings(START_NS, **fields) for name, fields in said.items()}
    return freer_side(look(healthy(limits, ranges=ranges), driving(), limits))


def went_past(limits: Limits = LIMITS, *, words: tuple[Command, ...] = (Command.FRONT,), **said: Any) -> Decision:
    """Driving at the speed that is left when the obstacle comes into the avoid zone, a fifth of a second later."""
    ride = Ride(limits=limits)
    ride.arm()
    ride.world[FRONT] = {"ahead_mm": 760}
    ride.tick(*words, times=60)
    ride.world[FRONT] = said
    return ride.tick(times=10)


@pytest.mark.parametrize(("ahead", "slow"), [(300, False), (600, False), (601, True), (750, True), (751, False)])
def test_between_stop_and_avoid_the_way_ahead_is_slow(ahead: int, slow: bool) -> None:
    facts = healthy(LIMITS, ranges={FRONT: readings(START_NS, ahead_mm=ahead)})
    expected = OPEN._replace(forward_mm_s=200.0) if slow else OPEN
    assert meet(avoid(look(facts, driving(), LIMITS))) == expected


def test_the_freer_side_must_be_clear_by_the_reading_that_saw_the_obstacle() -> None:
    near = {"ahead_mm": 700}
    assert side(front_range={**near, "left_mm": 900, "right_mm": 800}) == 1.0
    assert side(front_range={**near, "left_mm": 800, "right_mm": 900}) == -1.0
    assert side(front_range={**near, "left_mm": 750, "right_mm": 700}) == 0.0, "freer, but not clear"
    assert side(front_range={**near, "left_mm": 500, "right_mm": 400}) == 0.0, "freer, but near"
    assert side(front_range={**near, "left_mm": 900, "right_mm": 900}) == 0.0, "no side is freer"
    assert side(front_range={**near, "left_mm": int("900"), "right_mm": int("900")}) == 0.0, (
        "equal, not the same object"
    )
    assert side(front_range={"ahead_mm": 750, "left_mm": 900, "right_mm": 800}) == 1.0, "just near enough"
    assert side(front_range={"ahead_mm": 600, "left_mm": 900, "right_mm": 800}) == 0.0, "stopped, nothing to pass"
    assert side(front_range={"ahead_mm": 300, "left_mm": 900, "right_mm": 800}) == 0.0, "stopped, nothing to pass"
    assert side(front_range=near) == 0.0, "a side that is not sensed is not clear"
    assert side(front_range={**near, "left_mm": None, "right_mm": 900}) == -1.0
    assert side(front_range={"ahead_mm": 800, "left_mm": 900, "right_mm": 800}) == 0.0, "nothing to avoid"


def test_sensors_that_do_not_agree_on_the_side_do_not_steer() -> None:
    left = {"ahead_mm": 700, "left_mm": 900, "right_mm": 800}
    right = {"ahead_mm": 700, "left_mm": 800, "right_mm": 900}
    assert side(TWO, front_range=left, second_range=left) == 1.0
    assert side(TWO, front_range=left, second_range=right) == 0.0
    assert side(TWO, front_range=left, second_range={"ahead_mm": 700}) == 0.0
    assert side(TWO, front_range=left, second_range={"ahead_mm": 3_000}) == 1.0, (
        "one that sees nothing near is not asked"
    )


def test_the_nearest_of_three_counts_for_the_sides_too() -> None:
    window = [*readings(START_NS, ahead_mm=700, left_mm=2_000, right_mm=800)]
    window[1] = readings(START_NS, ahead_mm=700, left_mm=500, right_mm=800)[1]
    scene = look(healthy(LIMITS, ranges={FRONT: tuple(window)}), driving(), LIMITS)
    assert freer_side(scene) == -1.0


def test_driving_ahead_the_chair_turns_slightly_to_the_clear_side_and_goes_slowly() -> None:
    decision = went_past(ahead_mm=740, left_mm=2_000, right_mm=800)
    assert decision.motion == (200.0, LIMITS.steer_deg_s)
    assert decision.instruction == "Turn slightly left"


def test_steering_leaves_the_forward_speed_as_it_was() -> None:
    said = {"ahead_mm": 740, "left_mm": 2_000, "right_mm": 800}
    with_steer, without = went_past(**said), went_past(replace(LIMITS, steer_deg_s=0.0), **said)
    assert with_steer.motion.drive_mm_s == without.motion.drive_mm_s == 200.0
    assert without.motion.turn_deg_s == 0.0


@pytest.mark.parametrize("word", [Command.LEFT, Command.BACK])
def test_no_other_command_is_steered(word: Command) -> None:
    said = {"ahead_mm": 740, "left_mm": 800, "right_mm": 2_000}
    ride, plain = Ride(limits=LIMITS), Ride(limits=replace(LIMITS, steer_deg_s=0.0))
    for each in (ride, plain):
        each.arm()
        each.world[FRONT] = said
        each.tick(word, times=10)
    assert ride.decisions[-1].motion == plain.decisions[-1].motion


def test_a_stick_and_a_standing_chair_are_not_steered() -> None:
    ride = Ride(limits=LIMITS)
    ride.arm()
    ride.world[FRONT] = {"ahead_mm": 740, "left_mm": 2_000, "right_mm": 800}
    assert ride.tick(times=3).motion.turn_deg_s == 0.0
    stick = ride.wish(Command.FRONT, held=True, source="panel/stick", stick=(1.0, 0.0))
    assert ride.tick(stick, times=3).motion.turn_deg_s == 0.0


@pytest.mark.parametrize(("commanded_mm_s", "reported_mm_s"), [(0.0, -150.0), (-150.0, -150.0), (-150.0, 0.0)])
@pytest.mark.parametrize(
    "state",
    [
        driving(),
        driving(Command.LEFT, base=driving().wish),
        replace(driving(), wish=replace(driving().wish, stick=(0.5, -0.5))),
    ],
    ids=["steered", "arc", "stick"],
)
def test_a_chair_that_still_rolls_back_does_not_turn_before_it_can_go_ahead(
    state: State, commanded_mm_s: float, reported_mm_s: float
) -> None:
    """A million random cases did not show it, ten million did (benchmarks/laws_many.py): it turned where it stood."""
    facts = healthy(LIMITS, ranges={FRONT: readings(START_NS, ahead_mm=700, left_mm=900, right_mm=800)})
    facts = replace(facts, drive=replace(facts.drive, speed_mm_s=reported_mm_s))
    _, decision = decide(replace(state, output=Motion(commanded_mm_s, 0.0)), facts, LIMITS)
    assert decision.caps.forward_mm_s > 0.0
    assert decision.motion == STILL


def test_where_the_turn_is_not_wholly_allowed_the_chair_goes_straight() -> None:
    slow_turns = replace(LIMITS, caps=LIMITS.caps._replace(left_deg_s=7.9))
    decision = went_past(slow_turns, ahead_mm=740, left_mm=2_000, right_mm=800)
    assert decision.motion.turn_deg_s == 0.0
    assert decision.motion.drive_mm_s > 0.0


def test_the_turn_that_is_just_allowed_is_made_whatever_the_other_side_allows() -> None:
    caps = LIMITS.caps._replace(left_deg_s=8.0, right_deg_s=1.0)
    assert went_past(replace(LIMITS, caps=caps), ahead_mm=740, left_mm=2_000, right_mm=800).motion == (200.0, 8.0)
    caps = LIMITS.caps._replace(left_deg_s=1.0, right_deg_s=8.0)
    assert went_past(replace(LIMITS, caps=caps), ahead_mm=740, left_mm=800, right_mm=2_000).motion == (200.0, -8.0)


def test_where_nothing_may_move_ahead_the_chair_is_not_turned_either() -> None:
    ranges = {
        FRONT: readings(START_NS, ahead_mm=700, left_mm=2_000, right_mm=800),
        SECOND: readings(START_NS, ahead_mm=600, left_mm=2_000, right_mm=800),
    }
    assert decide(driving(output=STILL), healthy(TWO, ranges=ranges), TWO)[1].motion == STILL


@pytest.mark.parametrize(
    ("left", "right", "told"),
    [(800, 700, "left"), (700, 800, "right"), (700, 700, "left"), (None, 700, "right"), (700, None, "left")],
)
def test_the_person_is_told_the_freer_side_clear_or_not_and_left_when_equal(
    left: int | None, right: int | None, told: str
) -> None:
    decision = went_past(ahead_mm=740, left_mm=left, right_mm=right)
    assert decision.instruction == f"Turn slightly {told}"


def test_a_side_that_is_not_sensed_is_not_clear_whoever_made_the_infinity() -> None:
    scene = look(healthy(LIMITS, ranges={FRONT: readings(START_NS, ahead_mm=700)}), driving(), LIMITS)
    sides = tuple(seen._replace(left_mm=float("inf"), right_mm=900.0) for seen in scene.seen)
    assert freer_side(scene._replace(seen=sides)) == -1.0

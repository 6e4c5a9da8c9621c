"""The arbiter at its edges: nearly standing, nearly closed, ways that are very slow, presses that come together."""

from __future__ import annotations

from math import inf

import pytest
from msgspec.structs import replace

from chairward.arbiter import decide, instruct, ramp, steer
from chairward.components import STILL, Motion
from chairward.envelope import OPEN, Caps
from chairward.facts import MS, Decision, Limits, Near, Pressed, State
from chairward.messages import Button, Command, Way
from chairward.scene import Seen, look
from chairward.testing.ride import FRONT, PANEL, START_NS, Ride, chair_limits, driving, healthy, readings

LIMITS = chair_limits()
STANDING = State(latch="not armed yet", output_ns=START_NS)


def near(state: State, limits: Limits = LIMITS, **said: int | None) -> Decision:
    return decide(state, healthy(limits, ranges={FRONT: readings(START_NS, **said)}), limits)[1]


def pressed(*buttons: Button, state: State = STANDING, heard: Command | None = None, **drive: float) -> Decision:
    presses = tuple(Pressed(source=PANEL, button=one, at_ns=START_NS) for one in buttons)
    status = replace(healthy(LIMITS).drive, armed=False, **drive)
    words = (Ride().wish(heard),) if heard else ()
    return decide(state, healthy(LIMITS, pressed=presses, heard=words, drive=status), LIMITS)[1]


@pytest.mark.parametrize("side", ["left_mm", "right_mm"])
def test_without_a_wish_only_what_closes_the_way_ahead_is_told(side: str) -> None:
    assert [why.rule for why in near(driving(wish=None), **{side: 200}).reasons] == ["lease"]


def test_a_wish_for_a_way_without_any_speed_is_told_like_none_and_is_not_spent() -> None:
    still = chair_limits(backward_mm_s=0.0)
    backs = driving(Command.BACK, step_left=300.0)
    after, decision = decide(backs, healthy(still, ranges={FRONT: readings(START_NS, ahead_mm=500)}), still)
    assert decision.motion == STILL
    assert "stop_distance" in [why.rule for why in decision.reasons]
    assert not decision.protective_stop
    assert after.wish == backs.wish
    slow = chair_limits(backward_mm_s=0.0, caps=Caps(1.5, 1.5, 1.5, 1.5))
    assert near(backs, slow).reasons == ()


def test_a_latch_spends_every_wish_also_one_that_would_not_move() -> None:
    still = chair_limits(backward_mm_s=0.0)
    after, _ = decide(driving(Command.BACK, step_left=300.0, latch="STOP was pressed"), healthy(still), still)
    assert after.wish is None


def test_a_way_that_is_open_for_half_a_millimetre_a_second_is_open() -> None:
    slow = chair_limits(caps=Caps(0.5, 0.5, 0.5, 0.5))
    decision = near(driving(wish=None), slow)
    assert decision.open_ways == (Way.AHEAD, Way.BEHIND, Way.LEFT, Way.RIGHT)
    assert decision.instruction == "Way clear"


@pytest.mark.parametrize("word", list(Command))
def test_no_other_word_is_a_call_for_help(word: Command) -> None:
    said = decide(driving(), healthy(LIMITS, heard=(Ride().wish(word),)), LIMITS)[1]
    assert said.help is (word is Command.HELP)


def test_steering_needs_a_way_ahead_however_slow() -> None:
    limits = chair_limits(steer_deg_s=8.0)
    scene = look(
        healthy(limits, ranges={FRONT: readings(START_NS, ahead_mm=700, left_mm=900, right_mm=0)}), driving(), limits
    )
    slow = OPEN._replace(forward_mm_s=0.5)
    assert steer(Motion(500.0, 0.0), slow, scene) == Motion(0.5, 8.0)
    assert steer(Motion(500.0, 0.0), OPEN._replace(forward_mm_s=0.0), scene) == Motion(500.0, 0.0)


@pytest.mark.parametrize(
    ("reported", "was", "asked", "given"),
    [
        (10.0, 0.0, -150.0, -10.0),  # all but standing: the way back is open
        (25.0, 0.0, 0.02, 0.02),  # on its way ahead a crawl ahead is no reversal
        (25.0, 0.0, -0.02, 0.0),  # but the slightest way back is
        (0.0, 0.5, -0.5, 0.0),
    ],
)
def test_a_reversal_goes_through_standstill_however_slow_it_is(
    reported: float, was: float, asked: float, given: float
) -> None:
    drive = replace(healthy(LIMITS).drive, speed_mm_s=reported)
    scene = look(healthy(LIMITS, drive=drive), driving(), LIMITS)
    assert ramp(Motion(was, 0.0), Motion(asked, 0.0), 0.02, scene).drive_mm_s == given


def test_a_turn_on_the_spot_need_not_wait_until_the_chair_stands() -> None:
    drive = replace(healthy(LIMITS).drive, speed_mm_s=150.0)
    scene = look(healthy(LIMITS, drive=drive), driving(), LIMITS)
    assert ramp(STILL, Motion(0.0, 20.0), 0.02, scene).turn_deg_s > 0.0


def test_stop_beats_arm_in_the_same_drain_said_or_pressed() -> None:
    assert pressed(Button.ARM).arm
    assert not pressed(Button.ARM, heard=Command.STOP).arm
    assert not pressed(Button.ARM, Button.STOP).arm
    assert not pressed(Button.STOP, Button.ARM).arm


def test_another_button_does_not_swallow_the_press_of_arm() -> None:
    assert pressed(Button.HOLD, Button.ARM).arm


@pytest.mark.parametrize("output", [Motion(10.0, 0.0), Motion(-10.0, 0.0), Motion(0.0, 2.0), Motion(0.0, -2.0)])
def test_a_chair_that_is_told_to_move_is_not_armed(output: Motion) -> None:
    state = driving(output=output, wish=None, armed=False)
    assert pressed(Button.ARM, state=state).notes == ("ARM refused: the chair is moving",)


@pytest.mark.parametrize("turning", [2.0, -2.0, 3.0, -30.0])
def test_a_chair_that_turns_is_not_armed(turning: float) -> None:
    assert pressed(Button.ARM, turn_deg_s=turning).notes == ("ARM refused: the chair is moving",)
    assert pressed(Button.ARM, turn_deg_s=turning / 31.0).arm


@pytest.mark.parametrize("side", ["left_mm", "right_mm"])
def test_a_side_without_a_reading_is_unknown_whoever_made_the_infinity(side: str) -> None:
    scene = look(healthy(LIMITS), driving(), LIMITS)
    unknown = Seen(FRONT, 700.0, inf, 100.0, 100.0, 0, 0, "")._replace(**{side: float("inf")})
    told = instruct(driving(), scene._replace(seen=(unknown,)), OPEN, 700.0)
    assert told == ("Turn slightly right" if side == "left_mm" else "Turn slightly left")


def test_reset_forgets_what_had_vanished_and_a_press_that_changes_nothing_says_nothing() -> None:
    near = {FRONT: Near(distance_mm=700, seen_ns=1, gone=True)}
    pressed = (Pressed(source=PANEL, button=Button.RESET, at_ns=START_NS),)
    standing = driving(wish=None, near=near)
    after, decision = decide(standing, healthy(LIMITS, pressed=pressed), LIMITS)
    assert after.near == {}
    assert decision.notes == ()
    assert after.armed
    assert not decision.hard_stop


def test_of_several_faults_the_one_of_the_first_rule_is_told() -> None:
    facts = healthy(LIMITS)
    facts = replace(facts, gap_ns=1_000 * MS, drive=replace(facts.drive, linked=False, fault="unplugged"))
    after, _ = decide(driving(), facts, LIMITS)
    assert after.latch == "drive: unplugged"

"""The arbiter: the order of steer, merge, scale and ramp, and what people are told."""

from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st
from msgspec.structs import replace

from chairward import records
from chairward.arbiter import decide, ramp
from chairward.components import STILL, Motion
from chairward.envelope import Caps
from chairward.facts import MS, Facts, Limits, Pressed, SourceLimits, State
from chairward.messages import Button, Command, Way
from chairward.scene import look
from chairward.testing.ride import FRONT, PANEL, START_NS, Ride, chair_limits, driving, healthy, readings, recorded

LIMITS = chair_limits()
SIDE = "side/range"


def now(limits: Limits = LIMITS, state: State | None = None, **said: int | None) -> tuple[State, Facts, Limits]:
    return state or driving(), healthy(limits, ranges={FRONT: readings(START_NS, **said)}), limits


def test_deciding_twice_on_the_same_is_the_same() -> None:
    case = now(ahead_mm=900)
    assert decide(*case) == decide(*case)


def test_a_record_of_a_decision_replays_to_the_same_decision() -> None:
    state, facts, limits = now(ahead_mm=700, left_mm=900)
    kept = records.decode(records.encode(recorded(1, state, facts, limits)))
    assert decide(kept.before, kept.facts, limits) == (kept.after, kept.decision) == decide(state, facts, limits)


def test_the_first_decision_of_all_cannot_move_the_chair() -> None:
    state = driving(output_ns=0, output=STILL)
    assert decide(*now(state=state))[1].motion == STILL


def test_a_speed_rises_by_the_chairs_acceleration_and_falls_at_once() -> None:
    ride = Ride()
    ride.arm()
    speeds = [ride.tick(*([Command.FRONT] if i == 0 else [])).motion.drive_mm_s for i in range(5)]
    assert speeds == pytest.approx([10.0, 20.0, 30.0, 40.0, 50.0])
    ride.tick(times=60)
    assert ride.tick(Command.STOP).motion == STILL


def test_a_late_decision_may_not_make_up_for_lost_time() -> None:
    ride = Ride()
    ride.arm()
    ride.tick(Command.FRONT)
    before = ride.decisions[-1].motion.drive_mm_s
    assert ride.tick(dt_ns=400 * MS).motion.drive_mm_s == pytest.approx(before + 50.0)


def test_time_that_runs_backwards_lets_nothing_rise() -> None:
    state = driving(output=Motion(100.0, 0.0), output_ns=START_NS + 50 * MS)
    assert decide(*now(state=state))[1].motion == Motion(100.0, 0.0)


@given(st.floats(-600, 600), st.floats(-600, 600), st.floats(0.0, 0.1))
def test_the_ramp_never_overshoots_and_never_rises_faster_than_it_may(old: float, new: float, dt_s: float) -> None:
    scene = look(healthy(LIMITS), driving(), LIMITS)
    got = ramp(Motion(old, 0.0), Motion(new, 0.0), dt_s, scene).drive_mm_s
    assert abs(got) <= abs(new)
    assert got * new >= 0.0
    assert abs(got) <= (abs(old) if old * new > 0.0 else 0.0) + LIMITS.accel_mm_s2 * dt_s + 1e-9
    if abs(new) <= abs(old) and old * new > 0.0:
        assert got == new


def test_an_arc_is_slowed_as_a_whole_and_keeps_its_curve() -> None:
    arc = driving(Command.LEFT, base=driving().wish, output=Motion(300.0, 20.0))
    full = decide(*now(state=arc))[1].motion
    slowed = decide(*now(state=arc, ahead_mm=720, left_mm=900))[1].motion
    assert full == Motion(300.0, 20.0)
    assert 0.0 < slowed.drive_mm_s <= 200.0
    assert slowed.turn_deg_s / slowed.drive_mm_s == pytest.approx(20.0 / 300.0)


def test_the_caps_told_hold_for_the_motion_and_do_not_depend_on_a_wish() -> None:
    with_wish, without = decide(*now(ahead_mm=900))[1], decide(*now(state=driving(wish=None), ahead_mm=900))[1]
    assert with_wish.caps == without.caps
    assert with_wish.motion.drive_mm_s <= with_wish.caps.forward_mm_s


def test_open_ways_are_told_whether_or_not_a_wish_is_live() -> None:
    ride = Ride()
    ride.arm()
    assert ride.tick().open_ways == (Way.AHEAD, Way.BEHIND, Way.LEFT, Way.RIGHT)
    ride.world[FRONT] = {"ahead_mm": 500, "left_mm": 200, "right_mm": 3_000}
    assert ride.tick().open_ways == (Way.BEHIND, Way.RIGHT)


def test_while_a_required_source_is_silent_no_way_is_open() -> None:
    ride = Ride()
    ride.arm()
    ride.silent.add(FRONT)
    assert ride.tick(times=20).open_ways == ()


@pytest.mark.parametrize(
    ("ahead", "drives", "told"),
    [
        (751, True, "Go straight"),
        (751, False, "Way clear"),
        (750, True, "Turn slightly left"),
        (601, False, "Turn slightly left"),
        (600, True, "Stop now"),
        (600, False, "Stop now"),
    ],
)
def test_the_instruction_follows_the_nearest_distance(ahead: int, drives: bool, told: str) -> None:
    state = driving() if drives else driving(wish=None)
    assert decide(*now(state=state, ahead_mm=ahead, left_mm=900, right_mm=700))[1].instruction == told


@pytest.mark.parametrize(
    ("left", "right", "told"),
    [
        (900, 900, "Turn slightly left"),
        (400, 500, "Turn slightly right"),
        (0, None, "Turn slightly left"),
        (None, 0, "Turn slightly right"),
        (None, 900, "Turn slightly right"),
        (None, None, "Stop now"),
    ],
)
def test_a_side_that_nobody_senses_is_never_recommended(left: int | None, right: int | None, told: str) -> None:
    assert decide(*now(ahead_mm=700, left_mm=left, right_mm=right))[1].instruction == told


@pytest.mark.parametrize("swapped", [False, True])
def test_the_side_recommended_is_by_all_sensors_not_only_by_the_nearest(swapped: bool) -> None:
    limits = replace(LIMITS, sensors={**LIMITS.sensors, SIDE: LIMITS.sensors[FRONT]})
    only_ahead = readings(START_NS, ahead_mm=650, left_mm=None, right_mm=None)
    ranges = {FRONT: readings(START_NS, ahead_mm=700, left_mm=300, right_mm=2_000), SIDE: only_ahead}
    if swapped:
        ranges = {FRONT: only_ahead, SIDE: ranges[FRONT]}
    assert decide(driving(), healthy(limits, ranges=ranges), limits)[1].instruction == "Turn slightly right"


def test_the_instruction_is_stop_now_when_nothing_may_move_ahead_for_any_reason() -> None:
    limits = replace(LIMITS, lease_s=8.0)
    unarmed = decide(State(output_ns=START_NS), healthy(limits), limits)[1]
    lost = decide(driving(), healthy(limits, lost={"front": "gone"}), limits)[1]
    assert (unarmed.instruction, lost.instruction) == ("Stop now", "Stop now")


def test_the_nearest_distance_is_over_all_fresh_sensors_and_none_where_nothing_is_known() -> None:
    need = SourceLimits(freshness_ns=200 * MS)
    limits = replace(LIMITS, sensors={**LIMITS.sensors, SIDE: need})
    near, far = readings(START_NS, ahead_mm=900), readings(START_NS, ahead_mm=2_000)
    old = readings(START_NS, age_ns=300 * MS, ahead_mm=900)

    def nearest(front: object, side: object) -> int | None:
        return decide(driving(), healthy(limits, ranges={FRONT: front, SIDE: side}), limits)[1].nearest_mm

    assert nearest(far, near) == nearest(near, far) == 900
    assert nearest(far, old) == 2_000, "what is too old to trust is not told as a distance"
    assert nearest((), readings(START_NS, ahead_mm=None)) is None


def test_the_reasons_are_the_binding_votes_and_nothing_else() -> None:
    decision = decide(*now(ahead_mm=640, left_mm=900))[1]
    assert [(why.rule, why.source, why.detail) for why in decision.reasons] == [
        ("approach_speed", FRONT, "640 mm ahead")
    ]
    assert decide(*now())[1].reasons == ()


def test_without_a_wish_the_reasons_say_why_a_word_would_not_move_the_chair_ahead() -> None:
    decision = decide(*now(state=driving(wish=None), ahead_mm=500))[1]
    assert [why.rule for why in decision.reasons] == ["stop_distance", "approach_speed", "lease"]


def test_a_protective_stop_is_told_exactly_once() -> None:
    ride = Ride()
    ride.drive_off()
    ride.world[FRONT] = {"ahead_mm": 500, "left_mm": 2_000}
    ride.tick(times=30)
    assert [decision.protective_stop for decision in ride.decisions[-30:]] == [True] + [False] * 29


def test_a_new_word_that_is_refused_while_driving_by_another_is_a_protective_stop_too() -> None:
    ride = Ride()
    ride.drive_off(Command.BACK, times=20)
    ride.world[FRONT] = {"ahead_mm": 500, "left_mm": 2_000}
    assert ride.tick(Command.FRONT).protective_stop


def test_a_veto_that_comes_with_a_gap_still_spends_the_wish() -> None:
    ride = Ride()
    ride.drive_off()
    near = readings(ride.now_ns, ahead_mm=500)
    stopped = ride.tick(ranges={FRONT: near}, lost={"voice": "restarting"})
    assert stopped.protective_stop
    assert ride.state.wish is None


def test_the_controllers_acceptance_is_remembered_only_while_not_latched() -> None:
    ride = Ride()
    ride.drive = replace(ride.drive, armed=True)
    ride.tick()
    assert not ride.state.armed
    ride.arm()
    assert ride.state.armed


def test_turning_has_its_own_acceleration() -> None:
    ride = Ride()
    ride.arm()
    assert ride.tick(Command.LEFT).motion == Motion(0.0, pytest.approx(1.2))


def test_no_motion_ever_exceeds_the_chairs_caps_whatever_the_person_asks() -> None:
    greedy = replace(LIMITS, forward_mm_s=2_000.0, turn_deg_s=300.0, caps=Caps(400.0, 100.0, 25.0, 25.0))
    ride = Ride(limits=greedy)
    ride.arm()
    assert ride.tick(Command.FRONT, times=100).motion == Motion(400.0, 0.0)
    ride.tick(Command.STOP)
    assert abs(ride.tick(Command.RIGHT, times=5).motion.turn_deg_s) <= 25.0


def test_the_time_since_the_last_decision_counts_however_long_ago_it_was() -> None:
    state = driving(output=STILL, output_ns=START_NS // 2)
    assert decide(*now(state=state))[1].motion == Motion(50.0, 0.0)


@pytest.mark.parametrize(
    ("word", "output", "near"),
    [
        (Command.FRONT, Motion(300.0, 0.0), {"ahead_mm": 600}),
        (Command.BACK, Motion(-150.0, 0.0), {"behind_mm": 600}),
        (Command.LEFT, Motion(0.0, 20.0), {"left_mm": 250}),
        (Command.RIGHT, Motion(0.0, -20.0), {"right_mm": 250}),
    ],
)
def test_whichever_way_it_goes_what_is_too_near_there_is_a_protective_stop(
    word: Command, output: Motion, near: dict[str, int]
) -> None:
    state = driving(word, output=output, step_left=0.0 if word is Command.FRONT else 10.0)
    after, decision = decide(*now(state=state, **near))
    assert decision.motion == STILL
    assert decision.protective_stop
    assert after.wish is None


@pytest.mark.parametrize(
    ("word", "output", "near"),
    [
        (Command.FRONT, Motion(300.0, 0.0), {"ahead_mm": 640, "left_mm": 900}),
        (Command.BACK, Motion(-150.0, 0.0), {"behind_mm": 640}),
    ],
)
def test_to_be_slowed_is_no_stop(word: Command, output: Motion, near: dict[str, int]) -> None:
    state = driving(word, output=output, step_left=0.0 if word is Command.FRONT else 10.0)
    after, decision = decide(*now(state=state, **near))
    assert 0.0 < abs(decision.motion.drive_mm_s) < abs(output.drive_mm_s)
    assert not decision.protective_stop
    assert after.wish == state.wish


def test_a_controller_that_accepted_motion_before_it_was_asked_to_is_not_counted_as_armed() -> None:
    pressed = (Pressed(source=PANEL, button=Button.ARM, at_ns=START_NS),)
    after, decision = decide(State(output_ns=START_NS), healthy(LIMITS, pressed=pressed), LIMITS)
    assert decision.arm
    assert after.latch == ""
    assert not after.armed


@pytest.mark.parametrize(
    ("reported", "asked", "given"),
    [
        (20.0, -150.0, -10.0),
        (20.5, -150.0, 0.0),
        (-20.5, 150.0, 0.0),
        (-20.0, 150.0, 10.0),
        (300.0, 150.0, 10.0),
        (-300.0, -150.0, -10.0),
    ],
)
def test_the_way_back_opens_when_the_chair_is_reported_to_stand(reported: float, asked: float, given: float) -> None:
    drive = replace(healthy(LIMITS).drive, speed_mm_s=reported)
    scene = look(healthy(LIMITS, drive=drive), driving(), LIMITS)
    assert ramp(STILL, Motion(asked, 0.0), 0.02, scene) == Motion(given, 0.0)

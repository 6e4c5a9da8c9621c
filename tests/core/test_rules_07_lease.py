"""Rule 7: a word is a lease, turns and backing are steps, a held switch must repeat; nothing else moves the chair."""

from __future__ import annotations

import pytest
from msgspec.structs import replace

from chairward.components import STILL, Motion
from chairward.envelope import CLOSED
from chairward.facts import MS, S, State
from chairward.messages import Command
from chairward.rules import lease
from chairward.scene import look
from chairward.testing.ride import START_NS, TICK_NS, VOICE, Ride, armed, chair_limits, driving, healthy, integrated
from chairward.wishes import lease_left_s, travel

STICK = "panel/stick"


def test_without_a_live_wish_all_ways_are_closed_by_the_lease_alone() -> None:
    limits = chair_limits()
    (vote,) = lease(look(healthy(limits), State(latch="", armed=True), limits))
    assert vote.caps == CLOSED
    assert list(lease(look(healthy(limits), driving(), limits))) == []


def test_forward_lasts_its_lease_and_not_a_moment_longer() -> None:
    ride = armed()
    ride.tick(Command.FRONT)
    said_ns = ride.now_ns
    while ride.now_ns < said_ns + 8 * S:
        assert ride.tick().motion.drive_mm_s > 0.0
    over = ride.tick()
    assert over.motion == STILL
    assert not over.protective_stop, "the end of a lease is no stop by a veto"
    assert over.command is None


def test_the_lease_left_is_told_so_that_its_end_can_be_warned_of() -> None:
    ride = armed()
    assert ride.tick(Command.FRONT).lease_left_s == pytest.approx(8.0)
    assert ride.tick(times=150).lease_left_s == pytest.approx(5.0)
    ride.tick(times=260)
    assert ride.decisions[-1].lease_left_s == 0.0


def test_the_same_word_renews_without_a_jerk() -> None:
    ride = armed()
    ride.tick(Command.FRONT, times=390)
    for _ in range(3):
        assert ride.tick(Command.FRONT).motion.drive_mm_s == 500.0
        assert {d.motion.drive_mm_s for d in ride.decisions[-50:]} == {500.0}
        ride.tick(times=390)
    assert ride.decisions[-1].motion.drive_mm_s == 500.0


@pytest.mark.parametrize(("word", "sign"), [(Command.LEFT, 1.0), (Command.RIGHT, -1.0)])
def test_standing_a_turn_is_one_step_on_the_spot(word: Command, sign: float) -> None:
    ride = armed()
    start = len(ride.decisions)
    ride.tick(word, times=150)
    forward, turned = integrated(ride, start)
    assert forward == 0.0
    assert turned == pytest.approx(sign * 15.0, abs=0.5)
    assert ride.state.wish is None


@pytest.mark.parametrize(("word", "step"), [(Command.BACK, 300.0), (Command.REVERSE, 120.0)])
def test_backing_is_one_step(word: Command, step: float) -> None:
    ride = armed(chair_limits(reverse_step_mm=120.0))
    start = len(ride.decisions)
    ride.tick(word, times=200)
    assert integrated(ride, start) == (pytest.approx(-step, abs=4.0), 0.0)


def test_a_step_ends_by_what_the_controller_reports_when_that_is_more_than_was_commanded() -> None:
    plain, racing = armed(), armed()
    racing.drive = replace(racing.drive, speed_mm_s=-450.0)
    for ride in (plain, racing):
        ride.tick(Command.BACK)
        while ride.state.wish:
            ride.tick()
    assert racing.now_ns - START_NS < (plain.now_ns - START_NS) / 2


def test_a_step_that_cannot_be_made_ends_with_its_lease() -> None:
    ride = armed(chair_limits(turn_step_deg=10_000.0))
    ride.tick(Command.LEFT, times=405)
    assert ride.state.wish is None


def test_while_driving_a_turn_is_an_arc_that_keeps_going_and_then_straight_on() -> None:
    ride = armed()
    ride.tick(Command.FRONT, times=60)
    start = len(ride.decisions)
    arc = ride.tick(Command.LEFT, times=30)
    assert arc.motion == (300.0, 20.0)
    assert arc.command is Command.LEFT
    assert arc.lease_left_s > 0.0
    assert arc.instruction == "Go straight"
    after = ride.tick(times=60)
    assert integrated(ride, start)[1] == pytest.approx(15.0, abs=0.5)
    assert after.motion.turn_deg_s == 0.0
    assert after.motion.drive_mm_s > 300.0
    assert after.command is Command.FRONT


def test_an_arc_does_not_lengthen_the_lease_of_the_drive_it_bends() -> None:
    ride = armed()
    ride.tick(Command.FRONT)
    said_ns = ride.now_ns
    ride.tick(times=390)
    ride.tick(Command.LEFT)
    while ride.now_ns < said_ns + 8 * S + TICK_NS:
        ride.tick()
    assert ride.decisions[-1].motion == STILL
    assert ride.state.wish is ride.state.base is None


def test_a_second_turn_during_an_arc_is_a_new_arc_and_forward_ends_it() -> None:
    ride = armed()
    ride.tick(Command.FRONT, times=60)
    ride.tick(Command.LEFT, times=20)
    right = ride.tick(Command.RIGHT, times=10)
    assert right.motion.turn_deg_s < 0.0
    assert right.motion.drive_mm_s > 0.0
    straight = ride.tick(Command.FRONT)
    assert straight.motion.turn_deg_s == 0.0
    assert straight.lease_left_s == pytest.approx(8.0)


def test_back_during_forward_goes_through_standstill() -> None:
    ride = armed()
    ride.tick(Command.FRONT, times=60)
    assert ride.tick(Command.BACK).motion == STILL
    assert ride.tick().motion.drive_mm_s < 0.0


def test_back_waits_until_the_controller_reports_that_the_chair_has_come_to_rest() -> None:
    ride = armed()
    ride.tick(Command.FRONT, times=60)
    ride.drive = replace(ride.drive, speed_mm_s=300.0)
    assert ride.tick(Command.BACK, times=5).motion == STILL
    ride.drive = replace(ride.drive, speed_mm_s=0.0)
    assert ride.tick(times=2).motion.drive_mm_s < 0.0


@pytest.mark.parametrize("later", [Command.FRONT, Command.LEFT, Command.BACK])
def test_stop_has_no_lease_and_beats_everything_in_the_same_drain(later: Command) -> None:
    ride = armed()
    ride.tick(Command.FRONT, times=60)
    stopped = ride.tick(Command.LEFT, Command.STOP, later)
    assert stopped.motion == STILL
    assert not stopped.hard_stop
    assert not stopped.protective_stop, "the person stopped, no veto did"
    assert ride.tick(times=20).motion == STILL
    assert ride.tick(Command.FRONT).motion.drive_mm_s > 0.0, "a new word is enough after a spoken stop"


def test_a_spoken_stop_also_ends_the_drive_under_an_arc() -> None:
    ride = armed()
    ride.tick(Command.FRONT, times=60)
    ride.tick(Command.LEFT, times=5)
    ride.tick(Command.STOP)
    assert ride.tick(times=20).motion == STILL


def test_stop_and_help_work_even_where_the_person_has_no_such_command() -> None:
    ride = armed(chair_limits(commands=frozenset({Command.FRONT})))
    ride.tick(Command.FRONT, times=10)
    assert ride.tick(Command.HELP).help
    assert ride.tick(Command.STOP).motion == STILL


def test_a_call_for_help_works_latched_unarmed_and_blind_and_lasts_one_decision() -> None:
    ride = Ride()
    ride.silent.add(VOICE)
    assert ride.tick(Command.HELP).help
    assert not ride.tick().help


def test_a_command_that_the_person_does_not_have_is_noted_and_does_nothing() -> None:
    ride = armed(chair_limits(commands=frozenset({Command.FRONT})))
    decision = ride.tick(Command.BACK)
    assert decision.motion == STILL
    assert decision.notes == (f"{VOICE}: 'back' is not one of this person's commands",)


@pytest.mark.parametrize(
    ("word", "output", "reported", "left"),
    [
        (Command.LEFT, Motion(300.0, 20.0), None, 5.0),
        (Command.RIGHT, Motion(300.0, -20.0), None, 5.0),
        (Command.LEFT, Motion(0.0, 10.0), Motion(0.0, -22.0), 4.0),
        (Command.BACK, Motion(-10.0, 20.0), None, 10.0),
        (Command.REVERSE, Motion(-10.0, 0.0), Motion(-12.0, 0.0), 9.0),
        (Command.FRONT, Motion(300.0, 0.0), None, 0.0),
    ],
)
def test_a_step_is_used_up_by_what_was_commanded_or_reported_whichever_is_more(
    word: Command, output: Motion, reported: Motion | None, left: float
) -> None:
    limits, step = chair_limits(), 0.0 if word is Command.FRONT else 15.0
    facts = healthy(limits)
    if reported:
        told = {"speed_mm_s": reported.drive_mm_s, "turn_deg_s": reported.turn_deg_s}
        facts = replace(facts, drive=replace(facts.drive, **told))
    state = driving(word, output=output, step_left=step)
    assert travel(state, facts, limits, 0.5) == replace(state, step_left=left)


def test_a_step_ends_exactly_when_it_is_used_up() -> None:
    limits = chair_limits()
    state = driving(Command.LEFT, output=Motion(0.0, 20.0), step_left=10.0, base=driving().wish)
    assert travel(state, healthy(limits), limits, 0.5) == replace(state, wish=state.base, base=None, step_left=0.0)
    nearly = replace(state, step_left=10.5)
    assert travel(nearly, healthy(limits), limits, 0.5) == replace(state, step_left=0.5)


@pytest.mark.parametrize("which", ["wish", "base"])
def test_to_the_nanosecond_a_lease_lasts_and_then_everything_that_rests_on_it_is_over(which: str) -> None:
    limits = chair_limits(lease_s=2.0)
    word = driving(now_ns=START_NS + 500 * MS).wish
    assert word is not None
    over = replace(word, at_ns=START_NS - 2 * S - 1)
    last = replace(word, at_ns=START_NS - 2 * S)
    turn = replace(word, command=Command.LEFT)
    for wish, ends in ((last, False), (over, True)):
        state = driving(wish=wish) if which == "wish" else driving(wish=turn, base=wish, step_left=9.0)
        after = travel(state, healthy(limits), limits, 0.0)
        assert after == (replace(state, wish=None, base=None) if ends else state)
    assert lease_left_s(driving(wish=last), healthy(limits), limits) == 0.0

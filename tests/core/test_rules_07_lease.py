"""Rule 7: a word is a lease, turns and backing are steps, a held switch must repeat; nothing else moves the chair."""

from __future__ import annotations

from dataclasses import replace

import msgspec
import pytest

from chairward.components import STILL, Motion
from chairward.envelope import CLOSED
from chairward.facts import MS, Limits, S, State
from chairward.messages import Button, Command
from chairward.rules import lease
from chairward.scene import look
from chairward.testing.cases import stick_command
from chairward.testing.ride import PANEL, START_NS, TICK_NS, VOICE, Ride, chair_limits, driving, healthy
from chairward.wishes import lacking, lease_left_s, travel

STICK = "panel/stick"


def integrated(ride: Ride, since: int = 0) -> tuple[float, float]:
    """mm and degrees that the decisions since then commanded."""
    motions = [decision.motion for decision in ride.decisions[since:]]
    dt = TICK_NS / S
    return sum(m.drive_mm_s for m in motions) * dt, sum(m.turn_deg_s for m in motions) * dt


def armed(limits: Limits | None = None) -> Ride:
    ride = Ride(limits=limits or chair_limits())
    ride.arm()
    return ride


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
    racing.drive = msgspec.structs.replace(racing.drive, speed_mm_s=-450.0)
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
    ride.drive = msgspec.structs.replace(ride.drive, speed_mm_s=300.0)
    assert ride.tick(Command.BACK, times=5).motion == STILL
    ride.drive = msgspec.structs.replace(ride.drive, speed_mm_s=0.0)
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
        facts = replace(facts, drive=msgspec.structs.replace(facts.drive, **told))
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


# ---- held switches, HOLD, sticks -----------------------------------------------------------------------------------
def hold_down(ride: Ride, command: Command, seconds: float, source: str = PANEL) -> None:
    """A held switch: the same wish again every 100 ms."""
    for _ in range(int(seconds * 10)):
        ride.tick(ride.wish(command, held=True, source=source), times=5)


def test_a_held_switch_drives_as_long_as_it_is_held_and_stops_when_it_should_have_repeated() -> None:
    ride = armed()
    hold_down(ride, Command.FRONT, 12.0)
    assert ride.decisions[-1].motion.drive_mm_s == 500.0, "longer than any lease"
    assert ride.decisions[-1].lease_left_s == 0.0
    ride.tick(times=13)
    assert ride.decisions[-1].motion == STILL
    assert not any(d.protective_stop for d in ride.decisions)


def test_a_held_turn_or_back_is_no_step() -> None:
    ride = armed()
    start = len(ride.decisions)
    hold_down(ride, Command.LEFT, 3.0)
    assert integrated(ride, start)[1] > 30.0
    ride.tick(times=20)
    start = len(ride.decisions)
    hold_down(ride, Command.BACK, 4.0)
    assert integrated(ride, start)[0] < -450.0


def test_a_held_switch_may_resume_when_the_way_is_clear_and_stops_protectively_only_once() -> None:
    ride = armed()
    hold_down(ride, Command.FRONT, 2.0)
    start = len(ride.decisions)
    ride.world["front/range"] = {"ahead_mm": 500, "left_mm": 3_000}
    hold_down(ride, Command.FRONT, 1.0)
    assert ride.decisions[-1].motion == STILL
    assert sum(d.protective_stop for d in ride.decisions[start:]) == 1
    ride.world["front/range"] = {"ahead_mm": 640, "left_mm": 3_000}
    hold_down(ride, Command.FRONT, 0.5)
    assert ride.decisions[-1].motion.drive_mm_s > 0.0


def test_a_word_does_not_take_over_from_a_held_switch_but_stop_does() -> None:
    ride = armed()
    hold_down(ride, Command.FRONT, 1.0)
    ride.tick(Command.BACK)
    assert ride.decisions[-1].motion.drive_mm_s > 0.0
    assert ride.tick(Command.STOP).motion == STILL


def test_a_word_of_the_same_source_does_take_over_from_its_held_switch() -> None:
    ride = armed()
    hold_down(ride, Command.FRONT, 0.2, source="panel/keys")
    ride.tick(ride.wish(Command.LEFT, source="/".join(("panel", "keys"))))
    assert ride.decisions[-1].command is Command.LEFT
    assert ride.state.base is not None, "it bends the drive"


def test_a_held_switch_takes_over_from_a_word_and_from_another_held_switch() -> None:
    ride = armed()
    ride.tick(Command.FRONT)
    hold_down(ride, Command.BACK, 0.2)
    assert ride.decisions[-1].command is Command.BACK
    hold_down(ride, Command.LEFT, 0.2, source="other/keys")
    assert ride.decisions[-1].command is Command.LEFT
    assert ride.state.step_left == 0.0, "what is held is no step"


def test_a_held_turn_during_a_spoken_drive_takes_its_place() -> None:
    ride = armed()
    ride.tick(Command.FRONT, times=60)
    hold_down(ride, Command.LEFT, 0.5)
    assert ride.decisions[-1].motion.drive_mm_s == 0.0
    assert ride.tick(times=20).motion == STILL


def test_hold_keeps_a_word_alive_past_its_lease_and_letting_go_ends_it() -> None:
    ride = armed()
    ride.tick(Command.FRONT)
    for _ in range(100):
        ride.tick(press=[Button.HOLD], times=5)
    assert ride.decisions[-1].motion.drive_mm_s == 500.0
    ride.tick(times=13)
    assert ride.decisions[-1].motion == STILL


@pytest.mark.parametrize("word", [Command.LEFT, Command.RIGHT, Command.BACK, Command.REVERSE])
def test_hold_does_not_make_a_step_longer(word: Command) -> None:
    plain, held = armed(), armed()
    for ride in (plain, held):
        start = len(ride.decisions)
        ride.tick(word)
        while ride.state.wish:
            ride.tick(press=[Button.HOLD] if ride is held else [])
        assert len(ride.decisions) - start < 200
    assert integrated(held) == integrated(plain)


def test_hold_does_not_keep_a_stick_that_has_fallen_silent() -> None:
    ride = armed()
    ride.tick(ride.wish(Command.FRONT, held=True, source=STICK, stick=(1.0, 0.0)))
    for _ in range(15):
        ride.tick(press=[Button.HOLD])
    assert ride.decisions[-1].motion == STILL


def test_hold_alone_moves_nothing_and_does_not_bring_a_spent_wish_back() -> None:
    ride = armed()
    assert ride.tick(press=[Button.HOLD], times=3).motion == STILL
    ride.tick(Command.FRONT, times=20)
    ride.tick(Command.STOP, press=[Button.HOLD])
    assert ride.tick(press=[Button.HOLD], times=3).motion == STILL


@pytest.mark.parametrize("button", [Button.ARM, Button.RESET])
def test_no_other_button_holds_a_word(button: Button) -> None:
    ride = armed()
    ride.tick(Command.FRONT)
    ride.tick(press=[button])
    assert ride.state.wish is not None
    assert not ride.state.wish.held


def test_a_word_of_long_ago_is_not_live() -> None:
    limits = chair_limits()
    old = replace(driving(), wish=replace(Ride().wish(Command.FRONT), at_ns=START_NS // 2))
    assert travel(old, healthy(limits), limits, 0.02).wish is None


def test_hold_during_an_arc_holds_the_drive_under_it() -> None:
    ride = armed()
    ride.tick(Command.FRONT, times=60)
    ride.tick(press=[Button.HOLD])
    ride.tick(Command.LEFT)
    for _ in range(20):
        ride.tick(press=[Button.HOLD], times=5)
    assert ride.decisions[-1].motion.drive_mm_s > 300.0, "the arc is done, the drive goes on"
    assert ride.decisions[-1].motion.turn_deg_s == 0.0
    assert ride.tick(times=13).motion == STILL


@pytest.mark.parametrize(
    ("stick", "motion"),
    [
        ((1.0, 0.0), (500.0, 0.0)),
        ((0.5, -0.5), (250.0, -10.0)),
        ((-1.0, 0.0), (-150.0, 0.0)),
        ((-0.5, 0.0), (-75.0, 0.0)),
        ((0.0, 1.0), (0.0, 20.0)),
    ],
)
def test_a_stick_asks_for_its_share_of_the_persons_speeds(
    stick: tuple[float, float], motion: tuple[float, float]
) -> None:
    ride = armed()
    for _ in range(20):
        ride.tick(ride.wish(stick_command(*stick), held=True, source=STICK, stick=stick), times=5)
    assert ride.decisions[-1].motion == motion
    assert (ride.decisions[-1].instruction == "Go straight") == (stick[0] > 0.0)
    assert ride.state.step_left == 0.0, "a stick is no step"


@pytest.mark.parametrize(
    ("stick", "lacks"),
    [
        ((1.0, 0.0), Command.FRONT),
        ((0.4, 0.2), Command.LEFT),
        ((0.0, 1.0), Command.LEFT),
        ((0.0, -1.0), Command.RIGHT),
        ((1.0, -0.1), Command.RIGHT),
    ],
)
def test_a_stick_does_nothing_for_which_the_person_has_no_command(stick: tuple[float, float], lacks: Command) -> None:
    ride = armed(chair_limits(commands=frozenset(Command) - {lacks}))
    refused = ride.tick(ride.wish(stick_command(*stick), held=True, source=STICK, stick=stick))
    assert refused.motion == STILL
    assert ride.state.wish is None
    assert refused.notes == (f"{STICK}: '{lacks}' is not one of this person's commands",)


@pytest.mark.parametrize(
    ("stick", "needs"),
    [
        ((0.5, 0.0), {Command.FRONT}),
        ((0.0, 0.5), {Command.LEFT}),
        ((0.0, -0.5), {Command.RIGHT}),
        ((-0.5, 0.0), {Command.BACK}),
        ((-0.5, 0.0), {Command.REVERSE}),
        ((0.5, -0.5), {Command.FRONT, Command.RIGHT}),
    ],
)
def test_a_stick_needs_no_more_commands_than_it_has_directions(stick: tuple[float, float], needs: set[Command]) -> None:
    wish = Ride().wish(stick_command(*stick), held=True, source=STICK, stick=stick)
    assert lacking(wish, chair_limits(commands=frozenset(needs))) is None


@pytest.mark.parametrize("has", [(), (Command.BACK,), (Command.REVERSE,)])
def test_a_stick_backs_only_for_a_person_who_may_back_or_reverse(has: tuple[Command, ...]) -> None:
    ride = armed(chair_limits(commands=frozenset({Command.FRONT, *has})))
    backs = ride.tick(ride.wish(Command.BACK, held=True, source=STICK, stick=(-1.0, 0.0)), times=5).motion
    assert (backs.drive_mm_s < 0.0) == bool(has)


def test_a_stick_moved_to_where_it_may_not_go_ends_what_it_asked_before() -> None:
    ride = armed(chair_limits(commands=frozenset({Command.FRONT})))
    ride.tick(ride.wish(Command.FRONT, held=True, source=STICK, stick=(1.0, 0.0)), times=5)
    assert ride.tick(ride.wish(Command.FRONT, held=True, source=STICK, stick=(1.0, 0.5))).motion == STILL


def test_a_stick_let_go_stops_whatever_commands_the_person_has() -> None:
    ride = armed(chair_limits(commands=frozenset({Command.FRONT})))
    ride.tick(ride.wish(Command.FRONT, held=True, source=STICK, stick=(1.0, 0.0)), times=5)
    let_go = ride.tick(ride.wish(Command.RIGHT, held=True, source=STICK, stick=(0.0, 0.0)))
    assert (let_go.motion, let_go.notes) == (STILL, ())


def test_a_stick_let_go_stops_at_once_and_a_resting_stick_does_not_end_a_word() -> None:
    ride = armed()
    ride.tick(ride.wish(Command.FRONT, held=True, source=STICK, stick=(1.0, 0.0)))
    assert ride.tick(ride.wish(Command.FRONT, held=True, source=STICK, stick=(0.0, 0.0))).motion == STILL
    ride.tick(Command.FRONT)
    assert ride.tick(ride.wish(Command.FRONT, held=True, source=STICK, stick=(0.0, 0.0))).motion.drive_mm_s > 0.0


def test_a_stick_at_rest_ends_its_own_wish_by_name() -> None:
    ride = armed()
    ride.tick(ride.wish(Command.FRONT, held=True, source=STICK, stick=(1.0, 0.0)))
    ride.tick(ride.wish(Command.FRONT, held=True, source="/".join(("panel", "stick")), stick=(0.0, 0.0)))
    assert ride.state.wish is None


def test_a_stick_is_not_bent_into_an_arc_by_a_word_of_its_own_source() -> None:
    ride = armed()
    ride.tick(ride.wish(Command.FRONT, held=True, source=STICK, stick=(1.0, 0.0)), times=5)
    ride.tick(ride.wish(Command.LEFT, source=STICK))
    assert ride.state.base is None


def test_held_wishes_expire_exactly_when_they_should_have_repeated() -> None:
    limits = chair_limits(held_ns=100 * MS)
    ride = armed(limits)
    ride.tick(ride.wish(Command.FRONT, held=True, source=PANEL))
    held = replace(ride.state.wish or ride.wish(Command.FRONT), at_ns=ride.now_ns)
    ride.state = replace(ride.state, wish=held)
    assert ride.tick(times=5).command is Command.FRONT
    assert ride.tick().command is None

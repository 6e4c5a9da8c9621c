"""Rule 7, what is held: a switch, a word with HOLD or a stick must repeat, and what is let go is over."""

from __future__ import annotations

import pytest
from msgspec.structs import replace

from chairward.components import STILL
from chairward.facts import MS
from chairward.messages import Button, Command
from chairward.testing.cases import stick_command
from chairward.testing.ride import PANEL, START_NS, Ride, armed, chair_limits, driving, healthy, integrated
from chairward.wishes import lacking, travel

STICK = "panel/stick"


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

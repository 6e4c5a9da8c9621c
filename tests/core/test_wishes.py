"""What the person wants, function by function: which word is which, in which order they come, whose they are."""

from __future__ import annotations

import pytest
from msgspec.structs import replace

from chairward.facts import MS, Pressed, S, State, Wish
from chairward.messages import Button, Command
from chairward.testing.ride import PANEL, START_NS, VOICE, chair_limits, driving, healthy
from chairward.wishes import AT_REST, hear, lease_left_s, listen, live, wants_forward

LIMITS = chair_limits()
NOW_NS = START_NS
MOVING = (Command.FRONT, Command.BACK, Command.LEFT, Command.RIGHT, Command.REVERSE)
HOLD = (Pressed(source=PANEL, button=Button.HOLD, at_ns=NOW_NS),)


def said(command: Command, source: str = VOICE, **fields: object) -> Wish:
    return replace(Wish(source=source, seq=9, at_ns=NOW_NS, command=command), **fields)


def test_a_word_that_comes_with_a_call_for_help_is_heard_too() -> None:
    facts = healthy(LIMITS, heard=(said(Command.HELP), said(Command.FRONT)))
    state, _ = listen(State(latch=""), facts, LIMITS)
    assert state.wish == facts.heard[1]


def test_whoever_asks_for_a_stop_is_named() -> None:
    """A sensor that shouts STOP without end holds the chair fast: people must be able to see which."""
    heard = (
        said(Command.STOP, "sonar/ring"),
        said(Command.STOP),
        said(Command.STOP, "sonar/ring"),
        said(Command.FRONT),
    )
    facts = healthy(LIMITS, heard=heard)
    state, notes = listen(driving(), facts, LIMITS)
    assert state.wish is None
    assert notes == ("sonar/ring: 'stop' heard", f"{VOICE}: 'stop' heard")


@pytest.mark.parametrize("other", ["a/stick", "z/stick"])
def test_a_stick_at_rest_ends_only_its_own_wish(other: str) -> None:
    pushed = driving(wish=said(Command.FRONT, "panel/stick", stick=(1.0, 0.0)))
    assert hear(pushed, said(Command.FRONT, other, stick=AT_REST), LIMITS) == pushed
    assert hear(pushed, said(Command.FRONT, "panel/stick", stick=AT_REST), LIMITS).wish is None


@pytest.mark.parametrize("other", ["a/words", "z/words"])
def test_a_word_does_not_override_a_held_switch_of_another_source(other: str) -> None:
    held = driving(wish=said(Command.FRONT, "panel/switch", held=True))
    assert hear(held, said(Command.LEFT, other), LIMITS) == held
    assert hear(held, said(Command.LEFT, "panel/switch"), LIMITS) != held


@pytest.mark.parametrize("before", MOVING)
def test_a_turn_is_an_arc_during_a_forward_word_and_on_the_spot_during_any_other(before: Command) -> None:
    state = hear(driving(before), said(Command.LEFT), LIMITS)
    assert (state.base is not None) is (before is Command.FRONT)


@pytest.mark.parametrize("word", MOVING)
def test_hold_holds_a_forward_word_and_no_step(word: Command) -> None:
    state, _ = listen(driving(word), healthy(LIMITS, pressed=HOLD), LIMITS)
    assert state.wish is not None
    assert state.wish.held is (word is Command.FRONT)


def test_hold_during_an_arc_holds_the_drive_under_it_until_it_is_let_go() -> None:
    arc = driving(Command.LEFT, base=said(Command.FRONT), step_left=15.0)
    state, _ = listen(arc, healthy(LIMITS, pressed=HOLD), LIMITS)
    assert state.base is not None
    assert live(state.base, healthy(LIMITS, NOW_NS + LIMITS.held_ns), LIMITS)
    assert not live(state.base, healthy(LIMITS, NOW_NS + LIMITS.held_ns + MS), LIMITS)


def test_hold_counts_from_when_the_switch_was_seen_to_be_down() -> None:
    """What a lane that hung delivers late does not make up for a switch that was let go meanwhile."""
    presses = tuple(replace(HOLD[0], at_ns=NOW_NS - age_ms * MS) for age_ms in (400, LIMITS.held_ns // MS, 300))
    state, _ = listen(driving(), healthy(LIMITS, pressed=presses), LIMITS)
    assert state.wish is not None
    assert live(state.wish, healthy(LIMITS, NOW_NS), LIMITS)
    assert not live(state.wish, healthy(LIMITS, NOW_NS + MS), LIMITS)


def test_a_hold_that_is_older_than_a_held_switch_may_be_holds_nothing() -> None:
    late = (replace(HOLD[0], at_ns=NOW_NS - LIMITS.held_ns - 1),)
    state, _ = listen(driving(), healthy(LIMITS, pressed=late), LIMITS)
    assert state == driving()


@pytest.mark.parametrize("word", MOVING)
def test_only_the_forward_word_wants_forward_and_has_a_lease_to_tell(word: Command) -> None:
    state, facts = driving(word), healthy(LIMITS)
    assert wants_forward(state) is (word is Command.FRONT)
    assert (lease_left_s(state, facts, LIMITS) > 0.0) is (word is Command.FRONT)


def test_without_a_wish_nobody_wants_forward() -> None:
    assert not wants_forward(State())
    assert lease_left_s(State(), healthy(LIMITS), LIMITS) == 0.0


@pytest.mark.parametrize(("after_s", "left_s"), [(0.0, 8.0), (2.5, 5.5), (8.0, 0.0), (20.0, 0.0)])
def test_the_lease_left_counts_from_the_word_however_early_in_the_life_of_the_machine(
    after_s: float, left_s: float
) -> None:
    state = driving(wish=replace(said(Command.FRONT), at_ns=1 * S))
    assert lease_left_s(state, healthy(LIMITS, 1 * S + round(after_s * S)), LIMITS) == pytest.approx(left_s)

"""RESET and ARM by two words, for somebody who can press nothing: only where the chair file says so, only confirmed,
only at a standstill, and a STOP beats both."""

from __future__ import annotations

import dataclasses

import pytest
from msgspec.structs import replace

from chairward.arbiter import decide
from chairward.border import CONFIRM_WITHIN_NS, Border
from chairward.components import STILL
from chairward.facts import MS, Facts, Limits, SourceLimits, State
from chairward.messages import Button, Command, DriveStatus, Intent, Parcel
from chairward.plan import LanePlan, Part
from chairward.testing.ride import START_NS, Ride, chair_limits, healthy
from chairward.wire import encode_parcel

LISTENER = "voice/words"


class Listener:
    """A voice lane that is entitled to `may`, and the border it talks to."""

    def __init__(self, *may: Button) -> None:
        lane = LanePlan(name="voice", source=Part(component="mic"), stages=(Part(component="words"),))
        limits = Limits(recognizers={LISTENER: SourceLimits(freshness_ns=400 * MS)})
        self.border = Border({"voice": dataclasses.replace(lane, may=frozenset(may))}, limits)
        self.now_ns = START_NS
        self.seq = 0

    def hears(self, *commands: Command, apart_ns: int = 800 * MS, held: bool = False) -> Facts:
        """The facts after these words."""
        for command in commands:
            self.seq += 1
            self.now_ns += apart_ns
            body = Intent(seq=self.seq, captured_ns=self.now_ns, command=command, word=command.value, held=held)
            self.border.take("voice", encode_parcel(Parcel(stage="words", body=body)), self.now_ns)
        return self.border.facts(self.now_ns, DriveStatus(at_ns=self.now_ns, linked=True, armed=False), self.now_ns, 0)


def pressed(facts: Facts) -> list[Button]:
    return [one.button for one in facts.pressed]


def test_two_words_press_reset_and_arm_in_this_order() -> None:
    listener = Listener(Button.RESET, Button.ARM)
    assert pressed(listener.hears(Command.RESET)) == []
    assert pressed(listener.hears(Command.CONFIRM)) == [Button.RESET, Button.ARM]


def test_a_lane_that_may_only_reset_does_not_arm() -> None:
    assert pressed(Listener(Button.RESET).hears(Command.RESET, Command.CONFIRM)) == [Button.RESET]


@pytest.mark.parametrize("may", [(), (Button.ARM,), (Button.STOP, Button.HOLD)])
def test_a_lane_that_the_chair_file_does_not_let_reset_is_refused_by_name(may: tuple[Button, ...]) -> None:
    facts = Listener(*may).hears(Command.RESET, Command.CONFIRM)
    assert pressed(facts) == []
    assert facts.heard == ()
    assert "lane.voice.may" in facts.refused[LISTENER]


@pytest.mark.parametrize(
    "words",
    [
        (Command.CONFIRM,),
        (Command.RESET,),
        (Command.RESET, Command.RESET),
        (Command.CONFIRM, Command.RESET),
        (Command.RESET, Command.STOP, Command.CONFIRM),
        (Command.RESET, Command.FRONT, Command.CONFIRM),
        (Command.RESET, Command.HELP, Command.CONFIRM),
    ],
)
def test_anything_but_the_two_words_one_after_the_other_presses_nothing(words: tuple[Command, ...]) -> None:
    assert pressed(Listener(Button.RESET, Button.ARM).hears(*words)) == []


def test_one_confirmation_counts_once() -> None:
    listener = Listener(Button.RESET)
    assert pressed(listener.hears(Command.RESET, Command.CONFIRM)) == [Button.RESET]
    assert pressed(listener.hears(Command.CONFIRM)) == []


@pytest.mark.parametrize(("apart_ns", "counts"), [(CONFIRM_WITHIN_NS, True), (CONFIRM_WITHIN_NS + 1, False)])
def test_a_confirmation_that_comes_late_presses_nothing(apart_ns: int, counts: bool) -> None:
    facts = Listener(Button.RESET).hears(Command.RESET, Command.CONFIRM, apart_ns=apart_ns)
    assert pressed(facts) == [Button.RESET] * counts
    assert ("nothing to confirm" in facts.refused.get(LISTENER, "")) is not counts


def test_a_held_switch_is_no_word() -> None:
    assert pressed(Listener(Button.RESET).hears(Command.RESET, Command.CONFIRM, held=True)) == []


def latched() -> Ride:
    """A chair that stands after a fault which is over."""
    ride = Ride(limits=chair_limits())
    ride.drive_off()
    ride.tick(gap_ns=2_000 * MS)
    decision = ride.tick(times=5)
    assert ride.state.needs_reset
    assert decision.motion == STILL
    return ride


def test_the_two_words_lift_a_fault_and_arm_but_never_move_the_chair() -> None:
    ride = latched()
    decision = ride.tick(pressed=Listener(Button.RESET, Button.ARM).hears(Command.RESET, Command.CONFIRM).pressed)
    assert decision.arm
    assert decision.motion == STILL
    assert ride.tick(times=20).motion == STILL
    assert ride.state.latch == ""
    assert ride.tick(Command.FRONT, times=20).motion.drive_mm_s > 0.0


def test_a_stop_in_the_same_drain_beats_them() -> None:
    ride = latched()
    words = Listener(Button.RESET, Button.ARM).hears(Command.RESET, Command.CONFIRM)
    decision = ride.tick(Command.STOP, pressed=words.pressed)
    assert not decision.arm
    assert ride.state.needs_reset


def test_a_moving_chair_is_not_reset_and_says_so() -> None:
    limits = chair_limits()
    moving = DriveStatus(at_ns=START_NS, linked=True, armed=True, speed_mm_s=200.0)
    words = Listener(Button.RESET).hears(Command.RESET, Command.CONFIRM)
    facts = replace(healthy(limits, drive=moving), pressed=words.pressed)
    after, decision = decide(State(latch="a fault", needs_reset=True), facts, limits)
    assert after.needs_reset
    assert any("RESET refused: the chair is moving" in note for note in decision.notes)


@pytest.mark.parametrize("command", [Command.RESET, Command.CONFIRM])
def test_the_words_are_told_and_are_never_a_wish_for_motion(command: Command) -> None:
    ride = Ride(limits=chair_limits())
    ride.arm()
    decision = ride.tick(command, times=10)
    assert ride.state.wish is None
    assert decision.motion == STILL


def test_the_first_word_is_answered_with_what_to_do() -> None:
    ride = Ride(limits=chair_limits())
    assert any("confirm it to reset" in note for note in ride.tick(Command.RESET).notes)

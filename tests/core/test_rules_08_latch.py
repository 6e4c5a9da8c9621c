"""Rule 8: after a protective stop a new word, after a pressed STOP an ARM, after a fault RESET and then ARM."""

from __future__ import annotations

from typing import Any

import msgspec
import pytest

from chairward.components import STILL
from chairward.envelope import CLOSED
from chairward.facts import MS, NOT_ARMED, State
from chairward.messages import Button, Command
from chairward.rules import latch
from chairward.scene import look
from chairward.testing.ride import FRONT, PANEL, Ride, chair_limits, healthy

FAULT = {"gap_ns": 400 * MS}


def faulted() -> Ride:
    ride = Ride()
    ride.drive_off()
    ride.tick(**FAULT)
    ride.tick()
    return ride


def test_a_latched_state_closes_all_ways_and_says_why() -> None:
    limits = chair_limits()
    (vote,) = latch(look(healthy(limits), State(latch="because"), limits))
    assert (vote.caps, vote.detail) == (CLOSED, "because")
    assert list(latch(look(healthy(limits), State(latch=""), limits))) == []


def test_a_chair_that_has_just_been_switched_on_does_not_move() -> None:
    ride = Ride()
    decision = ride.tick(Command.FRONT, times=20)
    assert decision.motion == STILL
    assert decision.latch == NOT_ARMED
    assert not decision.hard_stop
    assert decision.open_ways == ()
    assert ride.decisions[0].notes == ("voice/words: 'front' is not obeyed: not armed yet",)


def test_arming_itself_never_moves_the_chair_and_a_word_before_it_is_spent() -> None:
    ride = Ride()
    ride.tick(Command.FRONT)
    armed = ride.tick(Command.FRONT, press=[Button.ARM])
    assert armed.arm
    assert ride.tick(times=50).motion == STILL
    assert ride.tick(Command.FRONT, times=2).motion.drive_mm_s > 0.0


def test_arm_is_asked_of_the_controller_once_and_again_on_a_new_press_until_it_accepts() -> None:
    ride = Ride()
    ride.tick(press=[Button.ARM], drive=msgspec.structs.replace(ride.facts().drive, armed=False))
    deaf = {"drive": msgspec.structs.replace(ride.facts().drive, armed=False)}
    waiting = ride.tick(**deaf)
    assert not waiting.arm
    assert waiting.latch == ""
    word = ride.tick(Command.FRONT, **deaf)
    assert word.motion == STILL
    assert word.reasons[0].detail == "the controller does not accept motion yet"
    assert ride.tick(press=[Button.ARM], **deaf).arm
    assert ride.tick(press=[Button.ARM]).arm is False, "it accepts motion: there is nothing to ask for"


def test_a_pressed_stop_brakes_at_once_latches_and_disarms_the_controller() -> None:
    ride = Ride()
    ride.drive_off()
    stopped = ride.tick(press=[Button.STOP])
    assert stopped.motion == STILL
    assert stopped.hard_stop
    assert stopped.disarm
    assert stopped.latch == f"STOP was pressed ({PANEL})"
    assert not stopped.protective_stop
    assert ride.tick(Command.FRONT, times=20).motion == STILL


def test_after_a_pressed_stop_arm_alone_is_enough_but_only_a_new_word_moves() -> None:
    ride = Ride()
    ride.drive_off()
    ride.tick(press=[Button.STOP])
    ride.tick(press=[Button.ARM])
    assert ride.tick(times=50).motion == STILL, "releasing a stop must not restart motion (ISO 13850)"
    assert ride.tick(Command.FRONT).motion.drive_mm_s > 0.0


@pytest.mark.parametrize("others", [[Button.ARM, Button.STOP], [Button.STOP, Button.RESET, Button.ARM, Button.HOLD]])
def test_a_pressed_stop_beats_every_other_press_and_word_of_the_same_drain(others: list[Button]) -> None:
    ride = Ride()
    ride.drive_off()
    decision = ride.tick(Command.FRONT, press=others)
    assert decision.motion == STILL
    assert not decision.arm
    assert ride.state.latch.startswith("STOP was pressed")


def test_a_pressed_stop_before_arming_stays_until_arm() -> None:
    ride = Ride()
    ride.tick(press=[Button.STOP])
    assert ride.state.latch.startswith("STOP was pressed")
    ride.arm()
    assert ride.state.latch == ""


def test_a_fault_latches_hard_and_is_a_protective_stop_when_driving() -> None:
    ride = Ride()
    ride.drive_off()
    decision = ride.tick(**FAULT)
    assert decision.motion == STILL
    assert decision.hard_stop
    assert decision.protective_stop
    assert decision.disarm
    assert decision.latch == "guard: its clock jumped by 400 ms"
    assert not ride.tick(**FAULT).protective_stop


def test_a_latch_keeps_its_first_reason() -> None:
    ride = faulted()
    assert ride.tick(gap_ns=900 * MS).latch == "guard: its clock jumped by 400 ms"
    assert ride.tick(press=[Button.STOP]).latch == "guard: its clock jumped by 400 ms"


def test_a_fault_needs_reset_and_then_arm_and_then_a_new_word() -> None:
    ride = faulted()
    refused = ride.tick(press=[Button.ARM])
    assert not refused.arm
    assert refused.notes == ("ARM refused: RESET first (guard: its clock jumped by 400 ms)",)
    assert ride.tick(press=[Button.RESET]).latch == NOT_ARMED
    assert ride.tick(Command.FRONT, times=5).motion == STILL
    ride.tick(press=[Button.ARM])
    assert ride.tick(times=20).motion == STILL
    assert ride.tick(Command.FRONT).motion.drive_mm_s > 0.0


def test_reset_and_arm_may_come_in_one_drain_in_that_order_only() -> None:
    right, wrong = faulted(), faulted()
    assert right.tick(press=[Button.RESET, Button.ARM]).arm
    assert not wrong.tick(press=[Button.ARM, Button.RESET]).arm
    assert wrong.state.latch == NOT_ARMED


def test_reset_while_the_fault_lasts_is_refused() -> None:
    ride = faulted()
    refused = ride.tick(press=[Button.RESET], **FAULT)
    assert refused.notes == ("RESET refused: guard: its clock jumped by 400 ms",)
    assert ride.state.needs_reset


@pytest.mark.parametrize("moving", [{"speed_mm_s": 20.0}, {"speed_mm_s": -30.0}, {"turn_deg_s": -2.0}])
@pytest.mark.parametrize("button", [Button.RESET, Button.ARM])
def test_reset_and_arm_are_refused_until_the_chair_stands(moving: dict[str, float], button: Button) -> None:
    ride = faulted()
    ride.drive = msgspec.structs.replace(ride.drive, **moving)
    assert ride.tick(press=[button]).notes == (f"{button.upper()} refused: the chair is moving",)
    ride.drive = msgspec.structs.replace(ride.drive, speed_mm_s=19.0, turn_deg_s=1.9)
    ride.tick(press=[Button.RESET])
    assert ride.state.latch == NOT_ARMED


def test_arm_is_refused_without_a_controller() -> None:
    ride = Ride()
    gone = msgspec.structs.replace(ride.facts().drive, linked=False)
    assert ride.tick(press=[Button.ARM], drive=gone).notes == ("ARM refused: the controller is not connected",)


def test_reset_and_arm_do_nothing_to_a_driving_chair() -> None:
    ride = Ride()
    ride.drive_off()
    decision = ride.tick(press=[Button.RESET, Button.ARM])
    assert not decision.arm
    assert decision.motion.drive_mm_s == 500.0
    assert decision.notes == ("RESET refused: the chair is moving", "ARM refused: the chair is moving")


def test_reset_without_a_fault_keeps_a_pressed_stop() -> None:
    ride = Ride()
    ride.drive_off()
    ride.tick(press=[Button.STOP])
    ride.tick(press=[Button.RESET])
    assert ride.state.latch.startswith("STOP was pressed")


def veto_by(what: str, ride: Ride) -> dict[str, Any]:
    if what == "wall":
        ride.world[FRONT] = {"ahead_mm": 400, "left_mm": 3_000}
    elif what == "blind":
        ride.world[FRONT] = {"can_see": False}
    elif what == "charging":
        return {"drive": msgspec.structs.replace(ride.facts().drive, charging=True)}
    return {}


@pytest.mark.parametrize("what", ["wall", "blind", "charging"])
def test_after_a_protective_stop_the_old_wish_is_spent_and_only_a_new_word_moves(what: str) -> None:
    ride = Ride()
    ride.drive_off()
    stop = ride.tick(**veto_by(what, ride))
    assert stop.protective_stop
    assert stop.motion == STILL
    assert stop.latch == ""
    ride.world.clear()
    assert ride.tick(times=30).motion == STILL
    assert not any(decision.protective_stop for decision in ride.decisions[-30:])
    if what == "wall":
        ride.tick(Command.LEFT, times=80)  # rule 6: turn away from what has vanished
    assert ride.tick(Command.FRONT, times=3).motion.drive_mm_s > 0.0

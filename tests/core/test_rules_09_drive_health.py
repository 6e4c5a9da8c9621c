"""Rule 9: no motion without a linked, faultless, accepting controller that nobody stops or charges."""

from __future__ import annotations

from typing import Any

import pytest
from msgspec.structs import replace

from chairward.components import STILL
from chairward.envelope import CLOSED, Envelope, Grip
from chairward.messages import Button, Command
from chairward.rules import drive_health
from chairward.scene import look
from chairward.testing.ride import Ride, chair_limits, driving, healthy

LIMITS = chair_limits()


def votes(*, accepted: bool = True, **changes: Any) -> list[Envelope]:
    facts = healthy(LIMITS)
    facts = replace(facts, drive=replace(facts.drive, **changes))
    return list(drive_health(look(facts, driving(armed=accepted), LIMITS)))


def test_a_healthy_controller_is_not_voted_against() -> None:
    assert votes() == []


@pytest.mark.parametrize(
    ("changes", "told"),
    [
        ({"linked": False}, "the controller is not connected"),
        ({"linked": False, "fault": "/dev/ttyUSB0 was unplugged"}, "/dev/ttyUSB0 was unplugged"),
        (
            {"fault": "the controller speaks protocol 9, this plugin 1"},
            "the controller speaks protocol 9, this plugin 1",
        ),
        ({"armed": False}, "the controller no longer accepts motion"),
    ],
)
def test_what_an_accepting_controller_loses_is_a_fault(changes: dict[str, Any], told: str) -> None:
    (vote,) = votes(**changes)
    assert (vote.caps, vote.source, vote.detail, vote.grip) == (CLOSED, "drive", told, Grip.LATCHES)


@pytest.mark.parametrize("changes", [{"linked": False}, {"fault": "overheated"}, {"armed": False}])
def test_before_it_has_accepted_motion_the_same_only_closes_so_that_arm_can_clear_it(changes: dict[str, Any]) -> None:
    (vote,) = votes(accepted=False, **changes)
    assert (vote.caps, vote.grip) == (CLOSED, Grip.SPENDS)


def test_a_controller_that_is_not_armed_yet_says_so() -> None:
    (vote,) = votes(accepted=False, armed=False)
    assert vote.detail == "the controller does not accept motion yet"


@pytest.mark.parametrize("changes", [{"stopped_by_user": True}, {"charging": True}])
def test_the_users_own_stop_and_a_charger_spend_the_wish_without_a_latch(changes: dict[str, Any]) -> None:
    (vote,) = votes(**changes)
    assert (vote.caps, vote.grip) == (CLOSED, Grip.SPENDS)


@pytest.mark.parametrize("changes", [{"linked": False}, {"fault": "overheated"}, {"armed": False}])
def test_while_driving_it_is_a_hard_latched_stop(changes: dict[str, Any]) -> None:
    ride = Ride()
    ride.drive_off()
    decision = ride.tick(drive=replace(ride.facts().drive, **changes))
    assert decision.motion == STILL
    assert decision.hard_stop
    assert ride.state.needs_reset


def test_a_fault_that_only_the_controllers_arming_clears_can_be_armed_away() -> None:
    ride = Ride()
    ride.drive_off()
    broken = {"drive": replace(ride.facts().drive, armed=False, fault="quick stop active")}
    ride.tick(**broken)
    broken = {"drive": replace(broken["drive"], at_ns=ride.now_ns + 10**7)}
    ride.tick(press=[Button.RESET], **broken)
    assert ride.tick(press=[Button.ARM], **broken).arm
    assert ride.state.latch == ""
    assert ride.tick(Command.FRONT, **broken).motion == STILL
    assert ride.tick(Command.FRONT, times=3).motion.drive_mm_s > 0.0


def test_a_latched_chair_asks_a_controller_that_still_accepts_motion_to_stop_accepting() -> None:
    ride = Ride()
    ride.drive = replace(ride.drive, armed=True)
    decision = ride.tick()
    assert decision.disarm
    assert decision.motion == STILL
    assert not ride.tick().disarm, "it has obeyed"

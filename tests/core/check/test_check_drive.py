"""What `chairward check drive` finds, and that nothing is driven on once a step has failed."""

from __future__ import annotations

from typing import Any

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from chairward.check.drive import Finding, full_motion
from chairward.check.drive_bench import BenchError
from chairward.check.drive_eyes import from_pins, from_world
from chairward.components import STILL, Motion

STEPS = ["connect", "signs", "scale", "controlled stop", "hard stop", "stop on silence", "after silence"]


def values(findings: list[Finding]) -> dict[str, Any]:
    return {key: value for finding in findings for key, value in finding.values.items()}


def failed(puppet: Any, step: str, **settings: Any) -> str:
    """The sentence of the failing step, which must be the last."""
    findings = puppet.check(**settings)
    assert [finding.step for finding in findings if not finding.ok] == [step]
    assert findings[-1].step == step
    return findings[-1].found


def test_a_drive_that_is_right_passes_every_step_in_order(puppet) -> None:
    findings = puppet.check()
    assert [finding.step for finding in findings] == STEPS
    assert all(finding.ok for finding in findings)
    found = values(findings)
    assert (found["drive_sign"], found["turn_sign"]) == (1, 1)
    assert (found["full_speed_mm_s"], found["full_turn_deg_s"]) == (500.0, 45.0)


@pytest.mark.parametrize("how", ["right", "no answer", "crossed", "no silence stop"])
def test_whatever_was_found_it_ends_with_a_hard_stop_disarmed_and_closed(puppet, how: str) -> None:
    puppet.answers, puppet.crossed = how != "no answer", how == "crossed"
    puppet.silence_ms = None if how == "no silence stop" else 150.0
    puppet.check()
    assert puppet.closed
    assert not puppet.armed
    assert puppet.last_hard
    assert puppet.wheels == STILL


def test_a_step_that_is_broken_off_leaves_the_drive_stopped_too(puppet, puppet_type) -> None:
    class Interrupted(puppet_type):
        def wait(self, seconds: float, fd: int) -> None:
            super().wait(seconds, fd)
            if self.wheels.drive_mm_s > 100.0:
                raise KeyboardInterrupt

    broken = Interrupted()
    with pytest.raises(KeyboardInterrupt):
        broken.check()
    assert (broken.closed, broken.armed, broken.last_hard) == (True, False, True)


def test_a_controller_that_does_not_answer_is_told_in_the_drives_own_words(puppet) -> None:
    puppet.answers = False
    assert failed(puppet, "connect") == "puppet: nobody answers: pull its strings"


def test_a_controller_that_arms_by_itself_is_refused(puppet) -> None:
    puppet.arms_itself = True
    assert "armed although nobody has asked for it" in failed(puppet, "connect")


@pytest.mark.parametrize("drive", [1, -1])
@pytest.mark.parametrize("turn", [1, -1])
@pytest.mark.parametrize("in_file", [1, -1])
def test_a_mirrored_motor_turns_the_sign_in_the_file_round(puppet, drive: int, turn: int, in_file: int) -> None:
    puppet.drive_sign, puppet.turn_sign = drive, turn
    found = values(puppet.check(until="signs", drive_sign=in_file, turn_sign=in_file))
    assert (found["drive_sign"], found["turn_sign"]) == (drive * in_file, turn * in_file)


def test_crossed_motors_are_refused_in_words(puppet) -> None:
    puppet.crossed = True
    assert "asked for forward, backward, seen left, right: the motors are crossed" in failed(puppet, "signs")


@pytest.mark.parametrize(("share", "turn"), [(0.4, 2.5), (1.3, 0.7)])
def test_the_measured_scale_makes_every_command_come_true(puppet, share: float, turn: float) -> None:
    puppet.true_full = Motion(500.0 * share, 45.0 * turn)
    found = values(puppet.check(until="scale"))
    assert found["full_speed_mm_s"] == pytest.approx(500.0 * share, rel=1e-3)
    assert found["full_turn_deg_s"] == pytest.approx(45.0 * turn, rel=1e-3)


def test_a_controlled_stop_that_is_gentler_than_the_proof_assumes_is_refused(puppet) -> None:
    puppet.decel_mm_s2 = 500.0
    assert "less than stopping.decel_mm_s2 = 600" in failed(puppet, "controlled stop")


def test_wheels_that_do_not_stop_when_told_to_are_refused(puppet) -> None:
    puppet.ignores_stop = True
    assert not puppet.check()[-1].ok


@settings(max_examples=8, deadline=None)
@given(silence_ms=st.integers(20, 400))
def test_a_silence_is_timed_within_five_milliseconds_and_never_too_short(puppet_type, silence_ms: int) -> None:
    puppet = puppet_type(silence_ms=float(silence_ms))
    bench = puppet.bench()
    bench.connect()
    assert silence_ms <= puppet.eyes().silence_ms(bench, Motion(250.0, 0.0), 3.0) <= silence_ms + 5


def test_a_controller_that_stops_later_than_250_ms_needs_a_relay(puppet) -> None:
    puppet.silence_ms = 251.0
    assert "at most 250 ms are allowed: name a watchdog_relay" in failed(puppet, "stop on silence")


def test_a_controller_that_never_stops_by_itself_is_stopped_and_refused(puppet) -> None:
    puppet.silence_ms = None
    assert "and the wheels still turn" in failed(puppet, "stop on silence")
    assert puppet.wheels == STILL


def test_a_controller_that_goes_on_after_silence_without_arming_is_refused(puppet) -> None:
    puppet.rearms_itself = True
    assert "moves again without having been armed" in failed(puppet, "after silence")


def test_a_drive_without_a_scale_cannot_be_measured() -> None:
    with pytest.raises(BenchError, match="no scale"):
        full_motion({"port": "x"})


def test_pins_are_read_as_a_motion_and_a_brake_is_none() -> None:
    pins = {
        "drive_duty": 0.5,
        "drive_in1": 0.0,
        "drive_in2": 1.0,
        "steer_duty": 1.0,
        "steer_in1": 1.0,
        "steer_in2": 0.0,
    }
    assert from_pins(lambda: {**pins, "brake": 0.0}, Motion(500.0, 45.0))() == Motion(-250.0, 45.0)
    assert from_pins(lambda: {**pins, "brake": 1.0}, Motion(500.0, 45.0))() == STILL
    assert from_world(lambda: {"speed_mm_s": 3.0, "turn_deg_s": -4.0})() == Motion(3.0, -4.0)

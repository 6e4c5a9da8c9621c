"""R-Net: listening is the default, and who may take the chair over when."""

from __future__ import annotations

from typing import Any

import pytest

from chairward.components import DriveError, Motion
from chairward_drive_can import rnet
from chairward_drive_can.drive import CanDrive
from chairward_drive_can.frames import MS, Frame
from chairward_drive_can.rnet_dialect import RnetDialect
from chairward_drive_can.settings import CanSettings
from chairward_drive_can.takeover import MODES

GO = Motion(250.0, 0.0)


# listening ----------------------------------------------------------------------------------------------------------
def test_by_default_it_only_listens_whatever_is_asked(new_bench: Any) -> None:
    bench = new_bench(rnet={"takeover": "listen", "hazard_accepted": ""})
    bench.rest(0.5)
    assert "'listen' never sends" in bench.refusal()
    bench.rest(0.5, motion=GO)
    bench.close()
    assert bench.bus.sent == []


def test_listen_is_the_default_takeover() -> None:
    assert CanSettings(dialect="rnet").rnet.takeover == "listen"


# refusals -----------------------------------------------------------------------------------------------------------
@pytest.mark.parametrize("mode", ["follow", "jsm_error", "emulate"])
def test_a_takeover_whose_hazard_was_not_accepted_word_for_word_is_refused_with_the_hazard(
    new_bench: Any, mode: str
) -> None:
    bench = new_bench(rnet={"takeover": mode, "hazard_accepted": "yes"})
    bench.rest(0.5)
    sentence = bench.refusal()
    assert MODES[mode].hazard in sentence
    assert f"hazard_accepted = '{MODES[mode].accept}'" in sentence


@pytest.mark.parametrize("mode", ["jsm_error", "emulate"])
def test_a_takeover_without_joystick_needs_a_relay_in_the_motor_supply(new_bench: Any, mode: str) -> None:
    bench = new_bench(rnet={"takeover": mode, "hazard_accepted": MODES[mode].accept})
    bench.rest(0.5)
    assert "watchdog_relay names a relay" in bench.refusal()


def test_an_unmeasured_stop_on_silence_is_refused(new_bench: Any) -> None:
    bench = new_bench(silence_stop_ms=None, silence_stop_measured=None)
    bench.rest(0.5)
    assert "nobody has measured that this controller stops" in bench.refusal()


def test_a_stop_on_silence_that_takes_too_long_is_refused_with_both_figures(new_bench: Any) -> None:
    bench = new_bench(silence_stop_ms=251)
    bench.rest(0.5)
    assert "only 251 ms after the last command, at most 250 ms" in bench.refusal()


def test_a_watchdog_relay_stands_in_for_the_measurement(new_bench: Any) -> None:
    relay = {"silence_stop_ms": None, "silence_stop_measured": None, "watchdog_relay": "K1 in the motor supply"}
    bench = new_bench(**relay)
    bench.armed()


def test_a_silent_power_module_is_refused(bench: Any) -> None:
    for _ in range(50):
        bench.now_ns += 10 * MS
        bench.hear(rnet.joystick(1, 0, 0))
    assert "power module is silent" in bench.refusal()


def test_a_silent_joystick_is_refused(bench: Any) -> None:
    bench.rest(0.5, stick=None)
    assert "no joystick frame of device 1" in bench.refusal()


def test_a_joystick_held_over_is_refused(bench: Any) -> None:
    bench.rest(0.5, stick=(0, 20))
    assert "joystick is not centred" in bench.refusal()


def test_a_joystick_that_has_only_just_come_to_rest_is_refused(bench: Any) -> None:
    bench.rest(0.5, stick=(0, 20))
    bench.rest(0.1)
    assert "rest centred for 300 ms" in bench.refusal()


def test_a_power_module_in_trouble_is_refused(bench: Any) -> None:
    bench.rest(0.5)
    bench.hear(Frame(0x0C140000, b"\x01", True))
    assert "trouble (heartbeat 0x01)" in bench.refusal()


def test_a_shown_error_is_refused_in_words_until_the_chair_is_switched_on_again(bench: Any) -> None:
    bench.rest(0.5)
    bench.hear(Frame(0x1C200100, b"\x00\x1e\x03\x00\x00", True))
    assert "charging" in bench.refusal()
    assert bench.drive.poll(bench.now_ns).charging
    bench.hear(Frame(0x7B0))
    bench.armed()


def test_arming_before_connecting_is_refused_with_the_port(rnet_settings: CanSettings) -> None:
    drive = CanDrive(rnet_settings, lambda: RnetDialect(rnet_settings))
    with pytest.raises(DriveError, match=rnet_settings.channel):
        drive.arm(1)

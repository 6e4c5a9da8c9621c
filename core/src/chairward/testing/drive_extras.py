"""Promises of drives that have more than wheels: each contract is inherited by the backends that it fits."""

from __future__ import annotations

import pytest

from chairward.components import DriveError, Motion
from chairward.testing.drive_moving import stands
from chairward.testing.drive_rig import DriveRig, S


class RampContract:
    """Backends whose speed rises and falls by a ramp, the controller's or the drive's own."""

    def test_speed_rises_gradually(self, rig: DriveRig) -> None:
        rig.connect()
        rig.arm()
        rig.ticks(0.1, Motion(rig.full.drive_mm_s, 0.0))
        assert rig.wheels().drive_mm_s < rig.full.drive_mm_s / 2

    def test_a_controlled_stop_is_not_a_hard_stop(self, rig: DriveRig) -> None:
        rig.go(Motion(rig.full.drive_mm_s, 0.0))
        rig.ticks(0.06)
        assert rig.wheels().drive_mm_s > rig.full.drive_mm_s / 4

    def test_after_a_controlled_stop_the_brake_is_on(self, rig: DriveRig) -> None:
        rig.go()
        rig.ticks(rig.stop_s + 0.5)
        assert rig.braked()


class SoftStartContract:
    """Backends where the controller, or the drive itself, limits the jerk of a start."""

    def test_a_start_is_softer_than_what_follows(self, rig: DriveRig) -> None:
        rig.connect()
        rig.arm()
        seen, quarter_s = [0.0], rig.drive.period_ns / 4 / S
        while seen[-1] < rig.full.drive_mm_s * 0.6 and len(seen) < 1000:
            rig.attempt(lambda: rig.drive.command(rig.now_ns(), Motion(rig.full.drive_mm_s, 0.0)))
            for _ in range(4):
                rig.run(quarter_s)
                rig.poll()
                seen.append(rig.wheels().drive_mm_s)
        first = next(i for i, speed in enumerate(seen) if speed > 0)
        middle = next(i for i, speed in enumerate(seen) if speed > rig.full.drive_mm_s * 0.3)
        assert seen[first + 10] - seen[first] < 0.75 * (seen[middle + 10] - seen[middle])


class StopInputContract:
    """Backends with a stop input at the controller, or the user's own joystick."""

    def test_the_stop_input_stops_and_is_told(self, rig: DriveRig) -> None:
        rig.go()
        rig.press_stop(True)
        status = rig.ticks(0.08, rig.half)
        assert stands(rig.wheels())
        assert status.stopped_by_user
        assert not status.armed

    def test_the_stop_input_stops_without_any_host(self, rig: DriveRig) -> None:
        rig.go()
        rig.press_stop(True)
        rig.run(rig.hard_s)
        assert stands(rig.wheels())
        assert rig.braked()

    def test_arm_is_refused_while_the_stop_input_is_active(self, rig: DriveRig) -> None:
        rig.connect()
        rig.press_stop(True)
        rig.ticks(0.1)
        rig.attempt(lambda: rig.drive.arm(rig.now_ns()))
        assert not rig.ticks(0.5).armed

    def test_released_it_still_does_not_move_until_armed(self, rig: DriveRig) -> None:
        rig.go()
        rig.press_stop(True)
        rig.ticks(0.1, rig.half)
        rig.press_stop(False)
        rig.ticks(0.5, rig.half)
        assert stands(rig.wheels())
        rig.ticks(0.1)
        assert rig.go().drive_mm_s > 0


class PowerContract:
    """Backends that know battery and charger."""

    @pytest.mark.parametrize("fraction", [0.0, 0.5, 1.0])
    def test_the_battery_is_told(self, rig: DriveRig, fraction: float) -> None:
        rig.battery(fraction)
        rig.connect()
        status = rig.ticks(0.5)
        assert status.battery is not None
        assert abs(status.battery - fraction) <= 0.05

    def test_a_charger_is_told_and_inhibits_arming(self, rig: DriveRig) -> None:
        rig.connect()
        rig.charger(True)
        assert rig.ticks(0.3).charging
        rig.attempt(lambda: rig.drive.arm(rig.now_ns()))
        assert not rig.ticks(0.3).armed

    def test_a_charger_stops_the_motion(self, rig: DriveRig) -> None:
        rig.go()
        rig.charger(True)
        rig.ticks(0.3, rig.half)
        assert stands(rig.wheels())


class ExclusivePortContract:
    """Backends whose port belongs to one program."""

    def test_a_second_opener_is_refused_by_port_and_the_first_goes_on(self, rig: DriveRig) -> None:
        rig.go()
        rival = rig.rival()
        with pytest.raises(DriveError, match=r"already|in use|busy") as caught:
            rival.connect(rig.now_ns())
        assert rig.port in str(caught.value)
        rival.close()
        assert rig.tick(rig.half).armed
        assert rig.wheels().drive_mm_s > 0


class VersionContract:
    """Backends whose controller tells a protocol version."""

    def test_another_protocol_version_is_refused_in_a_sentence_and_never_arms(self, rig: DriveRig) -> None:
        rig.other_version()
        for _ in range(10):
            rig.attempt(lambda: rig.drive.connect(rig.now_ns()))
            status = rig.ticks(0.05)
            assert not status.linked
        rig.attempt(lambda: rig.drive.arm(rig.now_ns()))
        assert not rig.ticks(0.3).armed
        assert any("protocol" in sentence for sentence in [*rig.errors, status.fault])

"""Neutral on connect, no motion before arming; signs, scale and bounds of motion."""

from __future__ import annotations

import math
import os

import pytest

from chairward.components import Motion
from chairward.testing.drive_rig import DriveRig, S

WAYS = {"forward": (1, 0), "backward": (-1, 0), "left": (0, 1), "right": (0, -1)}


def motion_of(rig: DriveRig, way: str, part: float = 0.5) -> Motion:
    """A part of the full motion one way."""
    ahead, left = WAYS[way]
    return Motion(ahead * rig.full.drive_mm_s * part, left * rig.full.turn_deg_s * part)


def stands(motion: Motion) -> bool:
    """Nothing is applied to any motor."""
    return motion.drive_mm_s == 0.0 and motion.turn_deg_s == 0.0


def sign(value: float) -> int:
    """-1, 0 or 1."""
    return (value > 0) - (value < 0)


class Connecting:
    """Neutral on connect, no motion before arming."""

    def test_the_guard_ticks_at_least_four_times_within_the_controllers_silence_limit(self, rig: DriveRig) -> None:
        assert 0 < rig.drive.period_ns <= rig.silence_s * S / 4

    def test_before_connect_there_is_no_link_no_descriptor_and_no_error(self, rig: DriveRig) -> None:
        status = rig.drive.poll(rig.now_ns())
        assert (status.linked, status.armed, rig.drive.fileno()) == (False, False, -1)
        assert status.at_ns == 0

    def test_connect_leads_to_a_link_with_a_real_descriptor(self, rig: DriveRig) -> None:
        assert rig.connect().linked
        os.fstat(rig.drive.fileno())

    def test_connecting_moves_nothing_and_asks_for_no_motion(self, rig: DriveRig) -> None:
        rig.connect()
        rig.ticks(0.3)
        assert stands(rig.wheels())
        assert all(stands(frame.motion) for frame in rig.heard())

    def test_a_connected_drive_is_not_armed(self, rig: DriveRig) -> None:
        rig.connect()
        assert not rig.ticks(0.3).armed

    def test_a_link_without_motion_stays_up(self, rig: DriveRig) -> None:
        rig.connect()
        assert rig.ticks(1.0).linked
        assert not rig.errors

    @pytest.mark.parametrize("way", WAYS)
    def test_no_motion_before_arm(self, rig: DriveRig, way: str) -> None:
        rig.connect()
        rig.ticks(0.5, motion_of(rig, way))
        assert stands(rig.wheels())

    def test_a_command_before_connect_never_moves_later(self, rig: DriveRig) -> None:
        rig.attempt(lambda: rig.drive.command(rig.now_ns(), rig.half))
        rig.connect()
        rig.ticks(0.3)
        assert stands(rig.wheels())

    def test_arm_before_connect_does_not_arm_later(self, rig: DriveRig) -> None:
        rig.attempt(lambda: rig.drive.arm(rig.now_ns()))
        rig.connect()
        assert not rig.ticks(0.5).armed

    def test_arm_standing_arms_and_moves_nothing(self, rig: DriveRig) -> None:
        rig.connect()
        assert rig.arm().armed
        assert stands(rig.wheels())

    def test_connect_again_while_linked_changes_nothing(self, rig: DriveRig) -> None:
        rig.connect()
        rig.arm()
        rig.drive.connect(rig.now_ns())
        status = rig.ticks(0.2)
        assert (status.linked, status.armed) == (True, True)

    def test_an_armed_drive_that_is_told_to_stand_stays_armed(self, rig: DriveRig) -> None:
        rig.connect()
        rig.arm()
        assert rig.ticks(1.0).armed


class Moving:
    """Signs, scale, bounds."""

    @pytest.mark.parametrize("way", WAYS)
    def test_each_way_moves_that_way_only(self, rig: DriveRig, way: str) -> None:
        wheels = rig.go(motion_of(rig, way))
        ahead, left = WAYS[way]
        signs = (sign(wheels.drive_mm_s), sign(wheels.turn_deg_s))
        assert signs == (ahead, left)

    def test_a_curve_keeps_both_parts(self, rig: DriveRig) -> None:
        wheels = rig.go(Motion(rig.full.drive_mm_s / 2, -rig.full.turn_deg_s / 2))
        assert wheels.drive_mm_s > 0 > wheels.turn_deg_s

    @pytest.mark.parametrize("part", [0.25, 0.5, 1.0])
    def test_the_applied_speed_is_the_commanded_one_and_never_more(self, rig: DriveRig, part: float) -> None:
        wanted = rig.full.drive_mm_s * part
        got = rig.go(Motion(wanted, 0.0)).drive_mm_s
        assert got <= wanted * 1.000001
        assert got >= wanted * (1 - rig.scale_error) - rig.coarse.drive_mm_s / 2

    def test_the_status_tells_the_applied_motion_with_its_sign_or_tells_nothing(self, rig: DriveRig) -> None:
        rig.go(Motion(-rig.full.drive_mm_s / 2, rig.full.turn_deg_s / 2))
        status = rig.tick(Motion(-rig.full.drive_mm_s / 2, rig.full.turn_deg_s / 2))
        assert status.speed_mm_s is None or status.speed_mm_s < 0
        assert status.turn_deg_s is None or status.turn_deg_s > 0

    def test_a_motion_below_the_controllers_resolution_stands_still(self, rig: DriveRig) -> None:
        assert stands(rig.go(Motion(rig.full.drive_mm_s * 1e-4, rig.full.turn_deg_s * 1e-4), 0.3))

    @pytest.mark.parametrize("bad", [math.nan, math.inf, -math.inf, 1.5, -1.5])
    @pytest.mark.parametrize("axis", [0, 1])
    def test_nan_and_out_of_range_are_refused_and_stop(self, rig: DriveRig, axis: int, bad: float) -> None:
        rig.go()
        before = len(rig.heard())
        parts = [0.0, 0.0]
        parts[axis] = bad * rig.full[axis]
        assert not rig.attempt(lambda: rig.drive.command(rig.now_ns(), Motion(*parts)))
        rig.run(rig.silence_s + 0.05)
        assert all(stands(frame.motion) for frame in rig.heard()[before + 2 :])
        assert stands(rig.wheels())

    def test_turning_round_passes_through_standing(self, rig: DriveRig) -> None:
        rig.go()
        back, seen = Motion(-rig.half.drive_mm_s, 0.0), []
        for _ in range(200):
            rig.drive.command(rig.now_ns(), back)
            for _ in range(4):
                rig.run(rig.drive.period_ns / 4 / S)
                rig.poll()
                seen.append(sign(rig.wheels().drive_mm_s))
            if seen[-1] < 0:
                break
        assert seen[-1] == -1
        assert 0 in seen[: seen.index(-1)]

    def test_frames_are_counted_and_answered(self, rig: DriveRig) -> None:
        rig.go()
        before = rig.tick(rig.half).sent_frames
        status = rig.ticks(0.5, rig.half)
        assert status.sent_frames > before
        assert status.unanswered <= 2

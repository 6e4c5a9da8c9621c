"""Controlled stop, hard stop, silence, disarm, close."""

from __future__ import annotations

import pytest

from chairward.components import STILL, Motion
from chairward.testing.drive_moving import WAYS, motion_of, stands
from chairward.testing.drive_rig import DriveRig, S


class Stopping:
    """Controlled stop, hard stop, silence, disarm, close."""

    def test_a_controlled_stop_comes_to_rest_and_stays_armed(self, rig: DriveRig) -> None:
        rig.go(Motion(rig.full.drive_mm_s, 0.0))
        status = rig.ticks(rig.stop_s)
        assert stands(rig.wheels())
        assert status.armed

    def test_speed_only_falls_during_a_controlled_stop(self, rig: DriveRig) -> None:
        rig.go(Motion(rig.full.drive_mm_s, 0.0))
        rig.tick()
        seen = []
        for _ in range(30):
            rig.tick()
            seen.append(rig.wheels().drive_mm_s)
        assert seen == sorted(seen, reverse=True)

    @pytest.mark.parametrize("way", WAYS)
    def test_a_hard_stop_brakes_at_once(self, rig: DriveRig, way: str) -> None:
        rig.go(motion_of(rig, way, 1.0))
        rig.drive.command(rig.now_ns(), STILL, hard_stop=True)
        rig.run(rig.hard_s)
        assert stands(rig.wheels())
        assert rig.braked()

    def test_a_hard_stop_wins_over_the_motion_beside_it(self, rig: DriveRig) -> None:
        rig.go()
        rig.attempt(lambda: rig.drive.command(rig.now_ns(), rig.half, hard_stop=True))
        rig.run(rig.hard_s)
        assert stands(rig.wheels())

    def test_a_kept_hard_stop_stays_braked(self, rig: DriveRig) -> None:
        rig.go()
        for _ in range(20):
            rig.tick(hard_stop=True)
        assert stands(rig.wheels())
        assert rig.braked()

    def test_silence_of_the_guard_stops_within_the_limit(self, rig: DriveRig) -> None:
        rig.go(Motion(rig.full.drive_mm_s, 0.0))
        rig.run(rig.silence_s + 0.015)
        assert stands(rig.wheels())
        assert rig.braked()

    def test_short_silence_does_not_stop(self, rig: DriveRig) -> None:
        rig.go()
        rig.run(rig.silence_s / 3)
        assert not stands(rig.wheels())

    def test_nothing_is_sent_while_the_guard_is_silent(self, rig: DriveRig) -> None:
        rig.go()
        rig.run(0.06)
        before = len(rig.heard())
        rig.run(0.5)
        assert len(rig.heard()) == before

    def test_polling_alone_keeps_nothing_moving(self, rig: DriveRig) -> None:
        rig.go()
        end = rig.now_ns() + int((rig.silence_s + 0.015) * S)
        while rig.now_ns() < end:
            rig.poll()
            rig.run(0.005)
        assert stands(rig.wheels())

    def test_after_silence_a_motion_does_not_resume(self, rig: DriveRig) -> None:
        rig.go()
        rig.run(rig.silence_s + 0.1)
        rig.ticks(0.5, rig.half)
        assert stands(rig.wheels())

    def test_after_silence_arming_again_moves_again(self, rig: DriveRig) -> None:
        rig.go()
        rig.run(rig.silence_s + 0.1)
        rig.ticks(0.1)
        assert rig.go().drive_mm_s > 0

    def test_disarm_stops_and_accepts_no_motion(self, rig: DriveRig) -> None:
        rig.go()
        rig.drive.disarm(rig.now_ns())
        status = rig.ticks(0.5, rig.half)
        assert not status.armed
        assert stands(rig.wheels())

    def test_disarm_then_arm_moves_again(self, rig: DriveRig) -> None:
        rig.go()
        rig.drive.disarm(rig.now_ns())
        rig.ticks(0.3)
        assert rig.go().drive_mm_s > 0

    def test_close_leaves_the_brakes_on(self, rig: DriveRig) -> None:
        rig.go()
        rig.drive.close()
        rig.run(rig.hard_s)
        assert stands(rig.wheels())
        assert rig.braked()

    def test_close_may_be_called_twice_and_before_connect(self, rig: DriveRig) -> None:
        rig.drive.close()
        rig.drive.close()
        assert rig.drive.fileno() == -1

    def test_a_closed_drive_moves_nothing(self, rig: DriveRig) -> None:
        rig.go()
        rig.drive.close()
        rig.run(0.1)
        before = len(rig.heard())
        rig.attempt(lambda: rig.drive.command(rig.now_ns(), rig.half))
        rig.run(0.1)
        assert len(rig.heard()) == before
        assert not rig.poll().linked

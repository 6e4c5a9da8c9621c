"""Wire, port and controller go away and come back; no call blocks; nothing stale ever moves."""

from __future__ import annotations

import random
import select
import time

import pytest

from chairward.components import STILL
from chairward.testing.drive_moving import stands
from chairward.testing.drive_rig import DriveRig, S

SLOW_CALL_S = 0.1
"""No call may take longer: far above what a non-blocking call takes on a busy machine, far below any blocking one."""


class Losing:
    """Wire, port and controller go away and come back; nothing stale ever moves."""

    def test_a_frozen_controller_is_called_lost(self, rig: DriveRig) -> None:
        rig.go()
        rig.freeze()
        status = rig.ticks(rig.lost_s, rig.half)
        assert not status.linked
        assert not status.armed

    def test_a_frozen_controllers_wheels_stop_by_themselves(self, rig: DriveRig) -> None:
        rig.go()
        rig.freeze()
        rig.ticks(rig.silence_s + 0.02, rig.half)
        assert stands(rig.wheels())

    def test_at_most_two_stale_motion_frames_are_hoarded_in_the_wire(self, rig: DriveRig) -> None:
        rig.go()
        rig.freeze()
        before = len(rig.heard())
        rig.ticks(0.5, rig.half)
        rig.thaw()
        rig.run(0.2)
        stale = [frame for frame in rig.heard()[before:] if not stands(frame.motion)]
        assert len(stale) <= 2

    def test_nothing_moves_after_a_thaw_until_armed_again(self, rig: DriveRig) -> None:
        rig.go()
        rig.freeze()
        rig.ticks(0.5, rig.half)
        rig.thaw()
        for _ in range(25):
            rig.attempt(lambda: rig.drive.connect(rig.now_ns()))
            rig.tick(rig.half)
            assert stands(rig.wheels())
        rig.connect()
        assert rig.go().drive_mm_s > 0

    def test_an_unplugged_port_is_told_by_name_within_two_periods(self, rig: DriveRig) -> None:
        rig.go()
        rig.errors.clear()
        rig.unplug()
        rig.tick(rig.half)
        status = rig.tick(rig.half)
        assert not status.linked
        said = [*rig.errors, status.fault]
        assert any(rig.port in sentence for sentence in said if sentence), said

    def test_unplugged_the_controller_stops_by_itself(self, rig: DriveRig) -> None:
        rig.go()
        rig.unplug()
        rig.run(rig.silence_s + 0.015)
        assert stands(rig.wheels())

    def test_the_descriptor_of_a_lost_port_is_gone(self, rig: DriveRig) -> None:
        rig.go()
        rig.unplug()
        rig.ticks(0.1, rig.half)
        assert rig.drive.fileno() == -1

    def test_plugged_in_again_it_links_standing_and_not_armed(self, rig: DriveRig) -> None:
        rig.go()
        rig.unplug()
        rig.ticks(0.3, rig.half)
        rig.plug()
        status = rig.connect(5.0)
        assert not status.armed
        rig.ticks(0.3, rig.half)
        assert stands(rig.wheels())

    def test_plugged_in_again_and_armed_it_moves(self, rig: DriveRig) -> None:
        rig.go()
        rig.unplug()
        rig.ticks(0.3, rig.half)
        rig.plug()
        rig.connect(5.0)
        assert rig.go().drive_mm_s > 0

    def test_a_restarted_controller_is_noticed_and_does_not_move(self, rig: DriveRig) -> None:
        rig.go()
        rig.restart()
        noticed = False
        for _ in range(25):
            status = rig.tick(rig.half)
            noticed = noticed or not status.armed
            assert stands(rig.wheels())
        assert noticed

    def test_a_restarted_controller_moves_after_connect_and_arm(self, rig: DriveRig) -> None:
        rig.go()
        rig.restart()
        rig.ticks(0.4, rig.half)
        rig.connect(5.0)
        assert rig.go().drive_mm_s > 0

    def test_the_status_is_as_old_as_the_last_answer(self, rig: DriveRig) -> None:
        rig.go()
        alive = rig.tick(rig.half)
        assert rig.now_ns() - alive.at_ns <= 2 * rig.drive.period_ns
        rig.freeze()
        frozen = rig.ticks(0.15, rig.half)
        assert frozen.at_ns <= alive.at_ns + 2 * rig.drive.period_ns

    def test_no_call_blocks_even_when_nobody_reads(self, rig: DriveRig) -> None:
        rig.go()
        rig.freeze()
        slowest = 0.0
        for _ in range(100):
            for call in (
                lambda: rig.drive.command(rig.now_ns(), rig.half),
                lambda: rig.drive.poll(rig.now_ns()),
                lambda: rig.drive.connect(rig.now_ns()),
            ):
                start = time.perf_counter()
                rig.attempt(call)
                slowest = max(slowest, time.perf_counter() - start)
            rig.run(0.02)
        assert slowest < SLOW_CALL_S

    def test_the_descriptor_wakes_the_guard_when_the_controller_answers(self, rig: DriveRig) -> None:
        rig.connect()
        rig.ticks(0.1)
        rig.drive.command(rig.now_ns(), STILL)
        rig.run(rig.drive.period_ns / S)
        assert select.select([rig.drive.fileno()], [], [], 0.0)[0]

    @pytest.mark.parametrize("seed", range(3))
    def test_whatever_is_called_in_whatever_order_nothing_moves_unarmed(self, rig: DriveRig, seed: int) -> None:
        chance = random.Random(seed)
        armed_once = False
        for _ in range(60):
            step = chance.choice(["go", "go", "still", "hard", "connect", "disarm", "silence"])
            if step == "connect":
                rig.attempt(lambda: rig.drive.connect(rig.now_ns()))
            elif step == "disarm":
                rig.attempt(lambda: rig.drive.disarm(rig.now_ns()))
            elif step == "silence":
                rig.run(chance.choice([0.01, 0.3]))
            else:
                armed_once |= rig.tick(rig.half if step == "go" else STILL, hard_stop=step == "hard").armed
            assert stands(rig.wheels())
        assert not armed_once

"""R-Net: nothing stale ever gets on the bus."""

from __future__ import annotations

import random
from typing import Any

import pytest

from chairward.components import DriveError, Motion
from chairward_drive_can import rnet
from chairward_drive_can.frames import MS, Frame
from chairward_drive_can.settings import CanSettings
from chairward_drive_can.takeover import MODES

GO = Motion(250.0, 0.0)


@pytest.mark.parametrize("mode", ["follow", "jsm_error"])
def test_no_joystick_frame_is_ever_sent_later_than_50_ms_after_the_command_it_carries(
    new_bench: Any, mode: str
) -> None:
    carried = [late_guard(new_bench, mode, seed) for seed in range(40)]
    assert sum(carried) > 400


def late_guard(new_bench: Any, mode: str, seed: int) -> int:
    """A guard that is held up at random between reading its clock and calling; how many motion frames it sent."""
    chance = random.Random(seed)
    accepted = {"takeover": mode, "hazard_accepted": MODES[mode].accept, "settle_ms": 300}
    base = CanSettings.model_validate(
        {
            "dialect": "rnet",
            "channel": f"{mode}{seed}",
            "rnet": accepted,
            "watchdog_relay": "K1",
            "accel_mm_s2": 0,  # so that each frame carries the very command that it was made of
        }
    )
    bench = new_bench(base)
    bench.rest(0.5)
    bench.drive.arm(bench.now_ns)
    bench.rest(0.2, stick=(0, 0) if mode == "follow" else None)
    commanded: dict[int, int] = {}
    carried = 0
    chair = [rnet.joystick(1, 0, 0)] if mode == "follow" else [Frame(0x14300000, b"\0\0", True)]
    for number in range(120):
        if not bench.drive.poll(bench.now_ns).armed:
            bench.rest(0.5)
            bench.drive.arm(bench.now_ns)
            bench.rest(0.1, stick=(0, 0) if mode == "follow" else None)
            carried = len(bench.joystick_frames())
        taken_ns = bench.now_ns
        bench.now_ns += chance.choice([0, 0, 0, 0, 0, 30, 51, 70]) * MS
        bench.bus.to_hear += chair
        bench.drive.poll(taken_ns)
        if chance.random() < 0.5:
            y = 1 + number % 99
            commanded[y] = taken_ns
            bench.drive.command(taken_ns, Motion(y * 5.0 + 0.1, 0.0))
        for at_ns, event in bench.joystick_frames()[carried:]:
            carried += 1
            assert event.y == 0 or at_ns - commanded[event.y] <= 50 * MS
        bench.now_ns += chance.choice([1, 5]) * MS
    return sum(event.y != 0 for _, event in bench.joystick_frames())


def test_a_guard_that_only_polls_sends_nothing_after_50_ms(bench: Any) -> None:
    bench.armed().rest(0.2, motion=GO)
    last_ns = bench.now_ns
    for _ in range(100):
        bench.now_ns += 10 * MS
        bench.hear(rnet.joystick(1, 0, 0))
    assert bench.joystick_frames()[-1][0] <= last_ns + 50 * MS


def test_a_guard_held_up_between_its_clock_and_its_call_sends_nothing(locked: Any) -> None:
    locked.rest(0.5)
    locked.drive.arm(locked.now_ns)
    locked.rest(0.2, stick=None)
    before = len(locked.bus.sent)
    taken_ns, locked.now_ns = locked.now_ns, locked.now_ns + 51 * MS
    locked.drive.command(taken_ns, GO)
    assert len(locked.bus.sent) == before


def test_a_guard_that_comes_back_after_silence_must_arm_again(locked: Any) -> None:
    locked.rest(0.5)
    locked.drive.arm(locked.now_ns)
    locked.rest(0.2, stick=None)
    locked.rest(0.2, stick=None, motion=GO)
    locked.now_ns += 300 * MS
    before = len(locked.bus.sent)
    locked.rest(0.3, stick=None, motion=GO)
    assert {frame.data for _, frame in locked.bus.sent[before:]} <= {b"\0\0"}
    assert not locked.drive.poll(locked.now_ns).armed


def test_arming_in_the_middle_of_a_wish_moves_nothing_before_neutral(bench: Any) -> None:
    bench.rest(0.5, motion=GO)
    bench.drive.arm(bench.now_ns)
    bench.rest(0.5, motion=GO)
    assert bench.joystick_frames() == []
    assert not bench.drive.poll(bench.now_ns).armed
    bench.rest(0.02)
    bench.rest(0.1, motion=GO)
    assert bench.joystick_frames()


def test_behind_two_unanswered_frames_motion_waits_and_only_a_stop_may_queue(locked: Any) -> None:
    locked.rest(0.5)
    locked.drive.arm(locked.now_ns)
    locked.rest(0.2, stick=None)
    locked.rest(0.1, stick=None, motion=GO)
    locked.bus.unanswered = 2
    before = len(locked.bus.sent)
    locked.rest(0.1, stick=None, motion=GO)
    assert len(locked.bus.sent) == before
    locked.rest(0.01, stick=None)
    assert [frame for _, frame in locked.bus.sent[before:]] == [rnet.joystick(1, 0, 0)]


def test_frames_that_nobody_acknowledges_are_told_after_200_ms(locked: Any) -> None:
    locked.rest(0.5)
    locked.drive.arm(locked.now_ns)
    locked.rest(0.2, stick=None)
    locked.bus.unanswered = 4
    locked.rest(0.3, stick=None, motion=GO)
    assert "nothing acknowledges them" in locked.drive.poll(locked.now_ns).fault


def test_an_interface_that_acknowledges_nothing_for_a_second_is_opened_anew(locked: Any) -> None:
    locked.rest(0.5)
    locked.drive.arm(locked.now_ns)
    locked.rest(0.2, stick=None)
    locked.bus.unanswered = 4
    with pytest.raises(DriveError, match="was lost: no frame was acknowledged for 1000 ms"):
        locked.rest(1.5, stick=None, motion=GO)
    assert not locked.drive.poll(locked.now_ns).linked
    locked.bus.unanswered = 0
    locked.drive.connect(locked.now_ns + 20 * MS)
    locked.rest(0.5)
    assert locked.drive.poll(locked.now_ns).linked

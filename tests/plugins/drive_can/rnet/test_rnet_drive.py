"""R-Net: the user's own hand wins, and whatever the chair says against it ends a drive."""

from __future__ import annotations

from itertools import pairwise
from typing import Any

import pytest

from chairward.components import STILL, Motion
from chairward_drive_can import rnet
from chairward_drive_can.frames import MS, Frame

GO = Motion(250.0, 0.0)


# the user's own hand ------------------------------------------------------------------------------------------------
@pytest.mark.parametrize("stick", [b"\x00\x01", b"\x00\xff", b"\x01\x00", b"\x9c\x00", b"\x00\x7f", b"\x80\x80"])
def test_a_touched_joystick_ends_our_motion_with_that_very_frame(bench: Any, stick: bytes) -> None:
    bench.armed().rest(0.2, motion=GO)
    assert bench.joystick_frames()
    before = len(bench.bus.sent)
    bench.now_ns += 10 * MS
    status = bench.hear(Frame(0x02000100, stick, True))
    assert (status.armed, status.stopped_by_user) == (False, True)
    assert "own joystick was touched" in status.fault
    bench.rest(1.0, stick=(0, 1), motion=GO)
    bench.rest(1.0, motion=GO)
    assert len(bench.bus.sent) == before


def test_after_a_touch_arming_again_needs_the_stick_at_rest_and_then_works(bench: Any) -> None:
    bench.armed().rest(0.1, stick=(5, 5))
    assert "not centred" in bench.refusal()
    bench.armed().rest(0.1, motion=GO)
    assert bench.joystick_frames()


def test_another_joysticks_touch_counts_too(bench: Any) -> None:
    bench.armed()
    assert not bench.hear(rnet.joystick(3, 0, 40)).armed


def test_following_sends_one_frame_for_each_centred_one_and_none_by_itself(bench: Any) -> None:
    bench.armed().rest(0.8, motion=GO)
    before = len(bench.joystick_frames())
    bench.hear(*[rnet.joystick(1, 0, 0)] * 3)
    assert len(bench.joystick_frames()) == before + 3
    assert {(event.x, event.y) for _, event in bench.joystick_frames()[before:]} == {(0, 50)}
    for _ in range(5):
        bench.drive.command(bench.now_ns, GO)
    assert len(bench.joystick_frames()) == before + 3


def test_a_start_rises_frame_by_frame_and_softer_at_first(bench: Any) -> None:
    bench.armed().rest(0.8, motion=GO)
    rise = [event.y for _, event in bench.joystick_frames()]
    first, full = next(i for i, y in enumerate(rise) if y > 0), rise.index(50)
    slow, quick = rise[first + 2] - rise[first], rise[full - 2] - rise[full - 4]
    assert 0 < slow < 0.75 * quick
    assert rise[first:full] == sorted(rise[first:full])


def test_a_joystick_that_falls_silent_ends_following(bench: Any) -> None:
    bench.armed().rest(0.1, motion=GO)
    bench.rest(0.1, stick=None, motion=GO)
    status = bench.drive.poll(bench.now_ns)
    assert not status.armed
    assert "fallen silent" in status.fault


# what the chair says while we drive ---------------------------------------------------------------------------------
@pytest.mark.parametrize(
    ("frame", "sentence"),
    [
        (Frame(0x0A040100, b"\x32", True), "speed setting is now 50 %"),
        (Frame(0x051, b"\x00\x02\x00\x00"), "profile 2 was selected"),
        (Frame(0x0C140000, b"\x01", True), "reports trouble"),
        (Frame(0x1C200100, b"\x2c\x00\x00\x00\x00", True), "battery low"),
        (Frame(0x1C240101, b"", True), ""),
        (Frame(0x1C240100, b"", True), "powers down"),
        (Frame(0x000, b"", False, True), "sleep for all"),
        (Frame(0x00C), "switched on again"),
    ],
)
def test_what_ends_a_drive_is_told_in_words(bench: Any, frame: Frame, sentence: str) -> None:
    bench.armed()
    status = bench.hear(frame)
    assert status.armed == (not sentence)
    assert sentence in status.fault


def test_a_lower_speed_setting_is_slower_and_so_allowed(bench: Any) -> None:
    bench.armed()
    assert bench.hear(Frame(0x0A040100, b"\x0a", True)).armed


def test_battery_is_told_as_a_fraction(bench: Any) -> None:
    assert bench.hear(Frame(0x1C0C0100, b"\x37", True)).battery == pytest.approx(0.55)


# the joystick locked out --------------------------------------------------------------------------------------------
def test_jsm_error_sends_the_calibrated_speed_and_three_errors_then_a_frame_every_tick(locked: Any) -> None:
    locked.rest(0.5)
    locked.drive.arm(locked.now_ns)
    assert [frame for _, frame in locked.bus.sent] == [rnet.speed_setting(1, 20), *[rnet.network_error()] * 3]
    locked.rest(0.2, stick=None)
    locked.rest(0.8, stick=None, motion=GO)
    frames = locked.joystick_frames()
    gaps = [then - now for (now, _), (then, _) in pairwise(frames)]
    assert set(gaps) == {10 * MS}
    assert frames[-1][1] == rnet.Joystick(1, 0, 50)


def test_a_joystick_that_comes_back_ends_the_takeover(locked: Any) -> None:
    locked.rest(0.5)
    locked.drive.arm(locked.now_ns)
    locked.rest(0.3, stick=None, motion=STILL)
    locked.rest(0.1, stick=None, motion=GO)
    before = len(locked.bus.sent)
    status = locked.hear(rnet.joystick(1, 0, 0))
    assert not status.armed
    assert "back on the bus" in status.fault
    locked.rest(0.3, stick=None, motion=GO)
    assert len(locked.bus.sent) == before


def test_closing_while_driving_leaves_a_centred_frame_last(locked: Any) -> None:
    locked.rest(0.5)
    locked.drive.arm(locked.now_ns)
    locked.rest(0.2, stick=None)
    locked.rest(0.2, stick=None, motion=GO)
    locked.drive.close()
    assert locked.bus.sent[-1][1] == rnet.joystick(1, 0, 0)

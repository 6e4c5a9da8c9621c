"""The live pair: real VideoCapture objects, fed through named pipes in place of webcams."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator
from itertools import pairwise
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest

from chairward.components import DeviceLost
from chairward_cameras.live import LivePairs, device_path
from chairward_cameras.settings import CamerasSettings

Maker = Callable[..., Any]


def settings_for(left: object, right: object, **more: Any) -> CamerasSettings:
    return CamerasSettings(left=str(left), right=str(right), **more)


def read_on(source: LivePairs) -> None:
    for _ in range(50):
        source.read(0.1)


@pytest.fixture
def opened() -> Iterator[Callable[[CamerasSettings], LivePairs]]:
    made: list[LivePairs] = []

    def make(settings: CamerasSettings) -> LivePairs:
        made.append(LivePairs(settings))
        made[-1].open()
        return made[-1]

    yield make
    for source in made:
        source.close()


def test_pairs_are_fresh_in_order_and_close_in_time(pipe_camera: Maker, opened: Maker) -> None:
    source = opened(settings_for(pipe_camera("l").path, pipe_camera("r").path, max_skew_ms=30))
    frames = [source.read(1.0) for _ in range(12)]
    assert all(f is not None for f in frames)
    assert [f.seq for f in frames] == list(range(1, 13))
    stamps = [f.captured_ns for f in frames]
    assert stamps == sorted(set(stamps))
    assert all(f.skew_ns <= 30_000_000 for f in frames)
    assert all(f.left.shape == f.right.shape == (240, 320, 3) and f.geometry is None for f in frames)


def test_no_picture_is_given_twice(pipe_camera: Maker, opened: Maker) -> None:
    source = opened(settings_for(pipe_camera("l").path, pipe_camera("r").path, max_skew_ms=30))
    seen = [source.read(1.0).left.mean() for _ in range(10)]
    assert all(b > a for a, b in pairwise(seen))


def test_a_slow_reader_gets_the_newest_pair_not_the_oldest(pipe_camera: Maker, opened: Maker) -> None:
    source = opened(settings_for(pipe_camera("l").path, pipe_camera("r").path, max_skew_ms=30))
    source.read(1.0)
    time.sleep(0.5)  # the reader is busy: 15 pictures go by
    frame = source.read(1.0)
    assert time.monotonic_ns() - frame.captured_ns < 200_000_000


def test_read_never_waits_longer_than_it_was_told(pipe_camera: Maker, opened: Maker) -> None:
    left = pipe_camera("l")
    source = opened(settings_for(left.path, pipe_camera("r").path, lost_after_ms=5000))
    left.pause()
    time.sleep(0.1)
    while source.read(0.05) is not None:
        pass
    start = time.monotonic()
    assert source.read(0.1) is None
    assert 0.09 <= time.monotonic() - start < 0.3


def test_a_camera_that_falls_silent_is_named(pipe_camera: Maker, opened: Maker) -> None:
    right = pipe_camera("r")
    source = opened(settings_for(pipe_camera("l").path, right.path, lost_after_ms=300))
    right.pause()
    start = time.monotonic()
    with pytest.raises(DeviceLost, match=r"camera right \(.*r\.y4m\) has given no picture for \d+ ms"):
        read_on(source)
    assert time.monotonic() - start < 1.5


def test_an_unplugged_camera_is_named(pipe_camera: Maker, opened: Maker) -> None:
    left = pipe_camera("l")
    source = opened(settings_for(left.path, pipe_camera("r").path))
    left.stop()
    with pytest.raises(DeviceLost, match=r"camera left \(.*l\.y4m\) gives no more pictures"):
        read_on(source)


def test_a_pair_that_stays_too_far_apart_is_lost_and_the_lagging_camera_is_named(
    pipe_camera: Maker, opened: Maker
) -> None:
    left, right = pipe_camera("l", fps=10.0), pipe_camera("r", fps=10.0, phase_s=0.05)
    source = LivePairs(settings_for(left.path, right.path, max_skew_ms=1, lost_after_ms=400, camera_fps=10))
    source.open()
    try:
        with pytest.raises(
            DeviceLost, match=r"camera (left|right) \(.*\) lags \d+ ms behind the other camera, at most 1"
        ):
            read_on(source)
    finally:
        source.close()


def test_a_machine_with_one_camera_says_so(pipe_camera: Maker, opened: Maker, tmp_path: Path) -> None:
    with pytest.raises(DeviceLost, match=r"camera right \(/dev/video97\) cannot be opened: plug it in"):
        opened(settings_for(pipe_camera("l").path, "/dev/video97"))


def test_two_missing_cameras_are_told_in_one_sentence(opened: Maker) -> None:
    both = r"camera left \(/dev/video96\) cannot be opened: .*; camera right \(/dev/video97\) cannot be opened: "
    for _ in range(5):  # whichever thread is first
        with pytest.raises(DeviceLost, match=both):
            opened(settings_for("/dev/video96", "/dev/video97"))


def test_the_same_camera_twice_is_refused(tmp_path: Path, opened: Maker) -> None:
    link = tmp_path / "by-id"
    link.symlink_to("/dev/video0")
    for left, right in ((0, "/dev/video0"), ("0", str(link))):
        with pytest.raises(DeviceLost, match="are the same device, /dev/video0"):
            opened(CamerasSettings(left=left, right=right))
    assert device_path(3) == "/dev/video3"


def test_a_wrong_size_is_told_with_both_sizes(pipe_camera: Maker, opened: Maker) -> None:
    with pytest.raises(DeviceLost, match=r"camera right \(.*\) gives 160x120 pictures, but 320x240 are set"):
        opened(settings_for(pipe_camera("l").path, pipe_camera("r", width=160, height=120).path))


def test_closing_twice_and_after_a_failed_open_is_harmless(tmp_path: Path) -> None:
    source = LivePairs(settings_for(tmp_path / "none_l.avi", tmp_path / "none_r.avi"))
    source.close()
    with pytest.raises(DeviceLost, match="cannot be opened"):
        source.open()
    source.close()
    source.close()
    with pytest.raises(DeviceLost, match="not open"):
        source.read(0.0)


def test_a_recorded_video_can_stand_in_for_a_camera(tmp_path: Path, opened: Maker) -> None:
    for name in ("l", "r"):
        writer = cv2.VideoWriter(str(tmp_path / f"{name}.avi"), cv2.VideoWriter_fourcc(*"MJPG"), 30, (320, 240))
        for level in range(60):
            writer.write(np.full((240, 320, 3), level, np.uint8))
        writer.release()
    source = opened(settings_for(tmp_path / "l.avi", tmp_path / "r.avi", max_skew_ms=200))
    frame = source.read(1.0)
    assert frame is not None
    assert frame.left.shape == (240, 320, 3)

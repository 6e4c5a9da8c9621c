"""What is wrong with the cameras is named within half a second and counts as blind: on a real drive, in the stage."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest

from chairward.components import Bench, Context, Footprint, Pose
from chairward.stages import Image, StereoFrame
from chairward_stereo_range import manifest
from chairward_stereo_range.calibration_file import Calibration, Camera
from chairward_stereo_range.faults import FaultWatch, corner_shifts
from chairward_stereo_range.settings import StereoRangeSettings
from chairward_stereo_range.stage import StereoRange

WITHIN_FRAMES = 8
"""0.5 s at 15 frames a second."""
Pair = tuple[Image, Image]


@pytest.fixture(scope="module")
def real(shared: Callable[[str], Path]) -> list[Pair]:
    """Pairs of the real drive, row-aligned, in turn."""
    [drive] = [e for e in manifest.read(shared("stereo/manifest.csv")) if e.kind == "sequence"]
    frames = (manifest.pair(left, right, 240) for _, left, right in manifest.numbered(drive))
    return [(left, right) for _, (left, right, _) in zip(range(40), frames, strict=False)]


def named(pairs: list[Pair], skew_ns: int = 0) -> list[str]:
    watch = FaultWatch()
    return [watch.check(left, right, skew_ns) for left, right in pairs]


@pytest.mark.needs_shared
def test_a_healthy_real_drive_is_never_called_faulty(real: list[Pair]) -> None:
    assert set(named(real)) == {""}


def rolled(picture: Image, degrees: float) -> Image:
    h, w = picture.shape[:2]
    turn = cv2.getRotationMatrix2D((w / 2, h / 2), degrees, 1.0)
    return np.asarray(cv2.warpAffine(picture, turn, (w, h), borderMode=cv2.BORDER_REPLICATE), np.uint8)


SPOILS: dict[str, tuple[Callable[[int, Pair], Pair], str]] = {
    "swapped": (lambda _i, p: (p[1], p[0]), "swapped"),
    "rows apart": (lambda _i, p: (p[0], np.roll(p[1], 3, axis=0)), "calibrat"),
    "rows apart the other way": (lambda _i, p: (np.roll(p[0], 5, axis=0), p[1]), "calibrat"),
    "a camera turned in its mount": (lambda _i, p: (p[0], rolled(p[1], 3.0)), "calibrat"),
    "left covered": (lambda _i, p: (np.full_like(p[0], 90), p[1]), "left camera"),
    "right dead": (lambda _i, p: (p[0], np.zeros_like(p[1])), "right camera"),
    "right exposed twice": (lambda _i, p: (p[0], np.clip(p[1] * 2.0 + 20, 0, 255).astype(np.uint8)), "left camera"),
}


@pytest.mark.needs_shared
@pytest.mark.parametrize("what", SPOILS)
def test_a_fault_of_the_real_rig_is_named_within_half_a_second(real: list[Pair], what: str) -> None:
    spoil, word = SPOILS[what]
    assert word in named([spoil(i, pair) for i, pair in enumerate(real[:WITHIN_FRAMES])])[-1]


@pytest.mark.needs_shared
def test_a_frozen_camera_of_the_real_rig_is_named_within_half_a_second(real: list[Pair]) -> None:
    assert "left camera is frozen" in named([(real[0][0], right) for _, right in real[:WITHIN_FRAMES]])[-1]


@pytest.mark.needs_shared
def test_it_is_trusted_again_once_it_is_well(real: list[Pair]) -> None:
    assert named([*((b, a) for a, b in real[:WITHIN_FRAMES]), *real[WITHIN_FRAMES : 2 * WITHIN_FRAMES]])[-1] == ""


@pytest.mark.parametrize(("right_px", "down_px"), [(-6.0, 0.0), (-3.0, 2.0), (5.0, -1.0)])
def test_corners_tell_how_one_picture_is_moved_against_the_other(tools: Any, right_px: float, down_px: float) -> None:
    left = cv2.cvtColor(tools.render(tools.room((tools.board(900.0),)))[0], cv2.COLOR_BGR2GRAY)
    move = np.array([[1.0, 0.0, right_px], [0.0, 1.0, down_px]])
    right = np.asarray(cv2.warpAffine(left, move, left.shape[::-1], borderMode=cv2.BORDER_REFLECT), np.uint8)
    moved = corner_shifts(left, right)
    assert len(moved) >= 15
    assert np.median(moved, axis=0) == pytest.approx([right_px, down_px], abs=0.2)


def test_too_few_corners_say_nothing(tools: Any) -> None:
    blank = np.full((240, 320, 3), 120, np.uint8)
    assert set(named([(blank, blank)] * WITHIN_FRAMES)) == {""}


def calibration(tilt_deg: float = 0.0) -> Calibration:
    """Of a rig like the renderer's, whose right camera looks so far down."""
    eye = [[300.0, 0.0, 159.5], [0.0, 300.0, 119.5], [0.0, 0.0, 1.0]]
    camera = Camera(matrix=eye, distortion=[0.0] * 5, rms_px=0.1)
    return Calibration(
        made="2026-01-01", image_width_px=320, image_height_px=240, board="9x6", square_mm=25.0, left=camera,
        right=camera, rotation=cv2.Rodrigues(np.array([np.radians(tilt_deg), 0.0, 0.0]))[0].tolist(),
        translation_mm=[-50.0, 0.0, 0.0], rms_stereo_px=0.1, epipolar_mean_px=0.1, epipolar_p95_px=0.2,
        views_used=["a"], views_dropped={},
    )  # fmt: skip


def readings(tools: Any, tmp_path: Path, used: Calibration, pairs: list[Pair]) -> list[Any]:
    used.save(tmp_path / "rig.json")
    footprint = Footprint(front_mm=0.0, rear_mm=900.0, half_width_mm=320.0)
    pose = Pose(z_mm=400.0)
    context = Context(lane="front", run_dir=tmp_path, chair_dir=tmp_path, pose=pose, footprint=footprint)
    stage = StereoRange(StereoRangeSettings(calibration=Path("rig.json"), panes=False), context)
    out = []
    for i, (left, right) in enumerate(pairs, start=1):
        bench = Bench()
        bench.put(StereoFrame(left=left, right=right, captured_ns=i * 66_000_000, seq=i, geometry=None))
        out += list(stage.process(bench))
    return out


def drive(tools: Any) -> list[Pair]:
    box = tools.board(1500.0, left_mm=300.0, right_mm=-200.0)
    return [tools.render(tools.room((box,), driven_mm=20.0 * i, seed=i)) for i in range(WITHIN_FRAMES)]


def test_the_calibration_of_another_rig_is_named_within_half_a_second(tools: Any, tmp_path: Path) -> None:
    pairs = drive(tools)
    assert all(r.can_see for r in readings(tools, tmp_path, calibration(), pairs))
    last = readings(tools, tmp_path, calibration(tilt_deg=1.0), pairs)[-1]
    assert not last.can_see
    assert last.ahead_mm is None
    assert "this rig's calibration" in last.reason


def test_pictures_of_a_size_that_was_not_calibrated_are_named_and_blind(tools: Any, tmp_path: Path) -> None:
    left, right = drive(tools)[0]
    for pair in ((left[:200], right[:200]), (left, right[:, :300])):
        [reading] = readings(tools, tmp_path, calibration(), [pair])
        assert not reading.can_see
        assert "320x240" in reading.reason


def test_rectified_pictures_of_two_sizes_are_named_and_blind(tools: Any, tmp_path: Path) -> None:
    left, right = drive(tools)[0]
    context = Context(lane="front", run_dir=tmp_path, chair_dir=tmp_path, pose=Pose(z_mm=400.0))
    for pair in ((left, right[:, :300]), (left[:200], right[:200])):
        bench = Bench()
        item = StereoFrame(left=pair[0], right=pair[1], captured_ns=1, seq=1, geometry=tools.geometry())
        bench.put(item)
        [reading] = StereoRange(StereoRangeSettings(), context).process(bench)
        assert not reading.can_see
        assert "size" in reading.reason

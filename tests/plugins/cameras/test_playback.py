"""Recorded pairs: what is played, when, and what is said when a manifest is wrong."""

from __future__ import annotations

import json
import time
from dataclasses import replace
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from chairward.components import Context, DeviceLost, EndOfInput, Pose
from chairward.stages import StereoFrame
from chairward_cameras.pictures import TRUTH_PIXELS, navigation_region
from chairward_cameras.playback import FilePairs
from chairward_cameras.plugin import make
from chairward_cameras.settings import CamerasSettings
from chairward_cameras.shots import COLUMNS

SHARED = Path(__file__).resolve().parents[4] / "shared" / "data"


def picture(path: Path, level: int, width: int = 64, height: int = 48) -> str:
    path.parent.mkdir(exist_ok=True)
    assert cv2.imwrite(str(path), np.full((height, width, 3), level, np.uint8))
    return path.name


def manifest(tmp_path: Path, *rows: dict[str, Any]) -> Path:
    """A manifest of the rows given; the files that they name are the test's business."""
    path = tmp_path / "manifest.csv"
    lines = [",".join(COLUMNS)]
    lines += [",".join(str(row.get(c, "")) for c in COLUMNS) for row in rows]
    path.write_text("\n".join(lines) + "\n")
    return path


def still(tmp_path: Path, name: str, level: int = 10, **more: Any) -> dict[str, Any]:
    files = {side: picture(tmp_path / f"{name}_{side}.png", level + (side == "right")) for side in ("left", "right")}
    return {"name": name, "kind": "stereo_gt", "baseline_mm": 100, "focal_px": 500, **files, **more}


def sequence(tmp_path: Path, name: str, count: int, **more: Any) -> dict[str, Any]:
    for index in range(count):
        for side in ("l", "r"):
            picture(tmp_path / f"{name}_{side}{index:02d}.png", 10 + index)
    files = {"left": f"{name}_l%02d.png", "right": f"{name}_r%02d.png"}
    return {"name": name, "kind": "sequence", "baseline_mm": 50, "focal_px": 300, **files, **more}


def played(context: Context, **settings: Any) -> list[StereoFrame]:
    source = make(CamerasSettings(kind=settings.pop("kind", "manifest"), **settings), context)
    source.open()
    frames: list[StereoFrame] = []
    try:
        while True:
            frame = source.read(1.0)
            assert isinstance(frame, StereoFrame)
            frames.append(frame)
    except EndOfInput:
        return frames
    finally:
        source.close()


def truths(context: Context) -> list[dict[str, Any]]:
    return [json.loads(line) for line in (context.run_dir / "front-truth.jsonl").read_text().splitlines()]


def test_still_pairs_are_held_and_sequences_played_through(tmp_path: Path, context: Context) -> None:
    path = manifest(tmp_path, still(tmp_path, "a"), sequence(tmp_path, "s", 3))
    frames = played(context, manifest=path, playback_fps=0, hold_frames=4)
    assert [f.name for f in frames] == ["a"] * 4 + ["s/000", "s/001", "s/002"]
    assert [int(f.left[0, 0, 0]) for f in frames] == [10] * 4 + [10, 11, 12]
    assert int(frames[0].right[0, 0, 0]) == 11


def test_a_sequence_stands_still_for_its_lead_in(tmp_path: Path, context: Context) -> None:
    path = manifest(tmp_path, sequence(tmp_path, "s", 3, note="fps=10"))
    frames = played(context, manifest=path, lead_in_s=0.4, playback_fps=None)
    assert [f.name for f in frames] == ["s/000"] * 4 + ["s/001", "s/002"]


def test_kinds_and_names_choose_what_is_played(tmp_path: Path, context: Context) -> None:
    rows = [still(tmp_path, "cat"), still(tmp_path, "cow", kind="synthetic"), still(tmp_path, "dog")]
    path = manifest(tmp_path, *rows, {"name": "board", "kind": "chessboard"})
    one = {"manifest": path, "playback_fps": 0, "hold_frames": 1}
    assert [f.name for f in played(context, names="c*", **one)] == ["cat", "cow"]
    assert [f.name for f in played(context, kinds=("stereo_gt",), **one)] == ["cat", "dog"]
    with pytest.raises(DeviceLost, match=r"manifest.csv: nothing to play: no row of kinds .* 'x\*'"):
        played(context, names="x*", **one)


def test_pacing_does_not_drift_and_captured_is_the_moment_due(tmp_path: Path, context: Context) -> None:
    path = manifest(tmp_path, sequence(tmp_path, "s", 30))
    start = time.monotonic_ns()
    frames = played(context, manifest=path, playback_fps=60)
    took_s = (time.monotonic_ns() - start) / 1e9
    stamps = [f.captured_ns for f in frames]
    steps = [(s - stamps[0]) / (1e9 / 60) for s in stamps]
    assert all(abs(step - round(step)) < 1e-3 for step in steps), "stamps lie on the grid of the pace"
    assert steps == sorted(set(steps))
    assert 29 / 60 <= took_s < 29 / 60 + 1.0


def test_what_a_slow_reader_missed_is_skipped_as_with_a_camera(tmp_path: Path, context: Context) -> None:
    path = manifest(tmp_path, sequence(tmp_path, "s", 40))
    source = FilePairs(CamerasSettings(kind="manifest", manifest=path, playback_fps=40), context)
    source.open()
    first = source.read(1.0)
    time.sleep(0.3)
    second = source.read(1.0)
    source.close()
    assert first is not None
    assert second is not None
    assert int(second.left[0, 0, 0]) - int(first.left[0, 0, 0]) >= 11
    assert second.seq == 2
    assert time.monotonic_ns() - second.captured_ns < 200_000_000


def test_read_gives_nothing_before_its_time_and_does_not_wait_beyond_it(tmp_path: Path, context: Context) -> None:
    path = manifest(tmp_path, sequence(tmp_path, "s", 3))
    source = FilePairs(CamerasSettings(kind="manifest", manifest=path, playback_fps=1), context)
    source.open()
    assert source.read(0.0) is not None
    start = time.monotonic()
    assert source.read(0.1) is None
    assert 0.09 <= time.monotonic() - start < 0.4
    source.close()


def test_geometry_follows_the_manifest_and_the_size(tmp_path: Path, context: Context) -> None:
    path = manifest(tmp_path, still(tmp_path, "a", doffs=20))
    one = {"manifest": path, "playback_fps": 0, "hold_frames": 1}
    (full,), (half,) = played(context, **one), played(context, resize_px=128, **one)
    assert full.geometry is not None
    assert (full.geometry.focal_px, full.geometry.baseline_mm, full.geometry.doffs_px) == (500, 100, 20)
    assert (full.geometry.cx_px, full.geometry.cy_px) == (31.5, 23.5)
    assert half.left.shape == (96, 128, 3)
    assert half.geometry is not None
    assert (half.geometry.focal_px, half.geometry.doffs_px, half.geometry.width_px) == (1000, 40, 128)


def test_frames_tell_where_they_were_taken_from_as_far_as_the_note_does(tmp_path: Path, context: Context) -> None:
    rows = [
        still(tmp_path, "a", note="box mount=A"),
        still(tmp_path, "n", note="box"),
        sequence(tmp_path, "s", 2, note="mount=B"),
    ]
    chair = replace(context, pose=Pose(x_mm=450.0, z_mm=555.0, pitch_deg=3.0))
    frames = played(chair, manifest=manifest(tmp_path, *rows), playback_fps=0, hold_frames=1)
    a, b = Pose(x_mm=450.0, z_mm=400.0), Pose(x_mm=450.0, z_mm=700.0, pitch_deg=15.0)
    assert [f.pose for f in frames] == [a, None, b, b]


def test_every_pair_given_has_its_line_of_truth(tmp_path: Path, context: Context) -> None:
    (tmp_path / "truth.csv").write_text("frame,board_mm\n0,\n1,812.5\n")
    path = manifest(tmp_path, still(tmp_path, "a", nearest_in_roi_mm=640.5), sequence(tmp_path, "s", 3, gt="truth.csv"))
    frames = played(context, manifest=path, playback_fps=0, hold_frames=2)
    lines = truths(context)
    assert [line["truth_mm"] for line in lines] == [640.5, 640.5, None, 812.5, None]
    assert [(line["captured_ns"], line["seq"], line["name"]) for line in lines] == [
        (f.captured_ns, f.seq, f.name) for f in frames
    ]
    assert [line["kind"] for line in lines] == ["stereo_gt"] * 2 + ["sequence"] * 3


def test_the_truth_of_a_rendered_sequence_is_measured_in_its_depth_picture(tmp_path: Path, context: Context) -> None:
    row = sequence(tmp_path, "s", 2, gt="z%02d.png", note="fps=15 frames=2 id=i%02d.png")
    region = navigation_region(320, 240)
    for index, things in enumerate((TRUTH_PIXELS, TRUTH_PIXELS - 1)):
        depth, ids = np.full((240, 320), 300, np.uint16), np.ones((240, 320), np.uint8)
        rows, columns = (axis[:things] for axis in np.nonzero(region))
        depth[rows, columns] = 900 + np.arange(things)
        ids[rows, columns] = 10
        cv2.imwrite(str(tmp_path / f"z{index:02d}.png"), depth)
        cv2.imwrite(str(tmp_path / f"i{index:02d}.png"), ids)
    played(context, manifest=manifest(tmp_path, row), playback_fps=0)
    assert [line["truth_mm"] for line in truths(context)] == [900 + TRUTH_PIXELS - 1, None]


@given(st.sampled_from([(320, 240), (640, 480)]))
def test_the_navigation_region_is_the_trapezoid_of_the_thesis(size: tuple[int, int]) -> None:
    region, scale = navigation_region(*size), size[1] / 240
    for row in range(size[1]):
        k = row - 120 * scale
        for column in range(0, size[0], 7):
            inside = 120 * scale <= row < 210 * scale and 100 * scale - k <= column < 200 * scale + k
            assert region[row, column] == inside


@pytest.mark.parametrize(
    ("change", "sentence"),
    [
        ({"focal_px": "wide"}, r"line 2 \(a\): focal_px is 'wide', but a number above 0 is needed"),
        ({"focal_px": -3}, r"line 2 \(a\): focal_px is '-3'"),
        ({"baseline_mm": "nan"}, r"line 2 \(a\): baseline_mm is 'nan'"),
        ({"doffs": "inf"}, r"line 2 \(a\): doffs is 'inf', but a number is needed"),
        ({"note": "mount=C"}, r"line 2 \(a\): the note says mount=C, but only A or B is known"),
        ({"right": "gone.png"}, r"line 2 \(a\): right names 'gone.png', but there is no such file"),
        ({"left": ""}, r"line 2 \(a\): left is empty"),
        ({"kind": "sequence"}, r"line 2 \(a\): a sequence needs file patterns"),
        ({"kind": "sequence", "left": "x%03d.png", "right": "y%03d.png"}, r"there is no first file 'x000.png'"),
        ({"kind": "sequence", "left": "x%03d.png", "right": "y%03d.png", "note": "fps=0"}, r"numbers for fps"),
    ],
)
def test_a_wrong_row_is_told_in_one_sentence_with_file_and_line(
    tmp_path: Path, context: Context, change: dict[str, Any], sentence: str
) -> None:
    path = manifest(tmp_path, {**still(tmp_path, "a"), **change})
    with pytest.raises(DeviceLost, match=sentence) as caught:
        played(context, manifest=path, playback_fps=0)
    assert str(path) in str(caught.value)
    assert "\n" not in str(caught.value)


def test_a_missing_column_a_missing_manifest_and_none_at_all_are_told(tmp_path: Path, context: Context) -> None:
    path = tmp_path / "short.csv"
    path.write_text("name,kind,left,right\n")
    with pytest.raises(DeviceLost, match=r"short.csv, line 1: column\(s\) gt, baseline_mm, focal_px.* missing"):
        played(context, manifest=path)
    with pytest.raises(DeviceLost, match=r"none.csv: the manifest cannot be read"):
        played(context, manifest=tmp_path / "none.csv")
    with pytest.raises(DeviceLost, match=r"cameras\.manifest names no file"):
        played(context)


def test_a_row_without_geometry_is_left_out_and_logged(
    tmp_path: Path, context: Context, caplog: pytest.LogCaptureFixture
) -> None:
    path = manifest(tmp_path, still(tmp_path, "a"), still(tmp_path, "b", focal_px=""))
    assert {f.name for f in played(context, manifest=path, playback_fps=0)} == {"a"}
    assert "line 3 (b): left out" in caplog.text


def test_a_picture_that_cannot_be_read_is_named(tmp_path: Path, context: Context) -> None:
    row = still(tmp_path, "a")
    (tmp_path / row["right"]).write_bytes(b"not a picture")
    with pytest.raises(DeviceLost, match=r"a_right.png: this picture cannot be read"):
        played(context, manifest=manifest(tmp_path, row), playback_fps=0)


def test_pictures_of_two_sizes_are_refused(tmp_path: Path, context: Context) -> None:
    row = still(tmp_path, "a")
    picture(tmp_path / row["right"], 1, width=32)
    with pytest.raises(DeviceLost, match=r"a_right.png: the right picture is 32x48, but the left one .* is 64x48"):
        played(context, manifest=manifest(tmp_path, row), playback_fps=0)


def test_a_folder_is_played_in_the_order_of_its_names(tmp_path: Path, context: Context) -> None:
    for index in (2, 0, 1):
        picture(tmp_path / "pics" / f"left_{index}.png", index)
        picture(tmp_path / "pics" / f"right_{index}.png", index)
    one: dict[str, Any] = {"kind": "folder", "folder": tmp_path / "pics", "playback_fps": 0}
    raw = played(context, **one)
    assert [f.name for f in raw] == ["left_0", "left_1", "left_2"]
    assert all(f.geometry is None for f in raw), "raw pictures are left to the chair's calibration"
    assert played(context, **one, focal_px=300, baseline_mm=50)[0].geometry is not None
    with pytest.raises(DeviceLost, match="belong together"):
        played(context, **one, focal_px=300)
    (tmp_path / "pics" / "right_1.png").unlink()
    with pytest.raises(DeviceLost, match="3 pictures like 'left\\*' but 2 like 'right\\*'"):
        played(context, **one)
    with pytest.raises(DeviceLost, match="is not a folder"):
        played(context, kind="folder", folder=tmp_path / "nowhere")


def test_opening_again_starts_from_the_beginning(tmp_path: Path, context: Context) -> None:
    path = manifest(tmp_path, sequence(tmp_path, "s", 2))
    source = FilePairs(CamerasSettings(kind="manifest", manifest=path, playback_fps=0), context)
    names = []
    for _ in range(2):
        source.open()
        frame = source.read(0.0)
        assert frame is not None
        names.append(frame.name)
    source.close()
    source.close()
    assert names == ["s/000", "s/000"]
    with pytest.raises(DeviceLost, match="not open"):
        source.read(0.0)


@pytest.mark.needs_shared
def test_the_real_manifests_play_with_their_truth(context: Context) -> None:
    path = SHARED / "stereo" / "manifest.csv"
    if not path.is_file():
        pytest.skip("needs ../shared/data/stereo")
    names: dict[str, Any] = {"manifest": path, "playback_fps": 0, "hold_frames": 1}
    frames = played(context, names="robot_approach_1", **names)
    assert len(frames) == 200
    known = [line["truth_mm"] for line in truths(context) if line["truth_mm"] is not None]
    assert len(known) > 100
    assert 600 < min(known) < 800
    assert max(known) < 2300
    (motorcycle,) = played(context, names="midd14_Motorcycle", **names)
    assert motorcycle.geometry is not None
    assert motorcycle.geometry.doffs_px == 32.778


@pytest.mark.needs_shared
def test_the_truth_measured_in_a_photoreal_sequence_matches_its_manifest(context: Context) -> None:
    path = SHARED / "stereo_photoreal" / "manifest.csv"
    if not path.is_file():
        pytest.skip("needs ../shared/data/stereo_photoreal")
    played(context, manifest=path, names="seq_dev_0_box_tex", playback_fps=0)
    assert truths(context)[-1]["truth_mm"] == pytest.approx(580.0, abs=1.0)

"""Calibration: rendered boards with known cameras, the corner-order trap, bad views, files, real boards."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest
from typer.testing import CliRunner

from chairward_stereo_range import calibrate as work
from chairward_stereo_range.calibration_file import Calibration, CalibrationError, Rectifier, load
from chairward_stereo_range.cli import calibrate_app

BOARD, SQUARE = (9, 6), 30.0
SIZE = (640, 480)
K = np.array([[560.0, 0, 322.0], [0, 562.0, 238.0], [0, 0, 1]])
D = np.array([-0.12, 0.05, 0.001, -0.0005, 0.0])
TURN = cv2.Rodrigues(np.array([0.004, -0.012, 0.003]))[0]
SHIFT = np.array([-60.0, 0.6, 0.9])


def board_picture(rotation: Any, translation: Any) -> Any:
    """What a camera (K, D) sees of a board at a pose: its squares drawn three times too fine."""
    cols, rows = BOARD[0] + 1, BOARD[1] + 1
    scale = 3
    big = np.full((SIZE[1] * scale, SIZE[0] * scale), 200, np.uint8)
    for i in range(-1, rows + 1):
        for j in range(-1, cols + 1):
            corners = np.array([[j, i], [j + 1, i], [j + 1, i + 1], [j, i + 1]], float) * SQUARE - SQUARE
            points = np.concatenate([corners, np.zeros((4, 1))], axis=1)
            seen, _ = cv2.projectPoints(points, cv2.Rodrigues(rotation)[0], translation, K, D)
            inside = 0 <= i < rows and 0 <= j < cols
            level = 30 if inside and (i + j) % 2 == 0 else 230
            polygon = np.round((seen.reshape(-1, 2) + 0.5) * scale * 16 - 8).astype(np.int32)
            cv2.fillConvexPoly(big, polygon, level, cv2.LINE_AA, 4)
    small = cv2.resize(big, SIZE, interpolation=cv2.INTER_AREA)
    return cv2.GaussianBlur(small, (0, 0), 0.7)


@pytest.fixture(scope="module")
def boards(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Ten rendered board pairs."""
    folder = tmp_path_factory.mktemp("boards")
    rng = np.random.default_rng(8)
    for n in range(10):
        rotation = cv2.Rodrigues(rng.uniform(-0.45, 0.45, 3) * [1, 1, 0.5])[0]
        centre = np.array([rng.uniform(-60, 120), rng.uniform(-60, 60), rng.uniform(480, 700)])
        translation = centre - rotation @ np.array([SQUARE * 4, SQUARE * 2.5, 0])
        cv2.imwrite(str(folder / f"left{n:02d}.png"), board_picture(rotation, translation))
        cv2.imwrite(str(folder / f"right{n:02d}.png"), board_picture(TURN @ rotation, TURN @ translation + SHIFT))
    return folder


def run(folder: Path, out: Path, *more: str) -> Any:
    arguments = ["stereo", "--left", str(folder / "left*.png"), "--right", str(folder / "right*.png")]
    return CliRunner().invoke(
        calibrate_app, [*arguments, "--board", "9x6", "--square-mm", str(SQUARE), "--out", str(out), *more]
    )


@pytest.fixture(scope="module")
def made(boards: Path, tmp_path_factory: pytest.TempPathFactory) -> tuple[dict[str, Any], Calibration]:
    """The command's JSON and the file it wrote."""
    out = tmp_path_factory.mktemp("made") / "stereo.json"
    result = run(boards, out, "--json")
    assert result.exit_code == 0, result.output
    return json.loads(result.stdout), load(out)


def test_rendered_cameras_are_recovered(made: tuple[dict[str, Any], Calibration]) -> None:
    summary, calibration = made
    assert summary["views_used"] == 10
    assert summary["rms_stereo"] < 0.25
    assert summary["epipolar_p95"] < 0.25
    assert calibration.left.matrix[0][0] == pytest.approx(560.0, rel=0.01)
    assert np.linalg.norm(calibration.translation_mm) == pytest.approx(np.linalg.norm(SHIFT), rel=0.01)
    assert set(summary) >= {
        "views_used", "views_dropped", "rms_left", "rms_right", "rms_stereo", "epipolar_mean", "epipolar_p95",
    }  # fmt: skip


def test_rectified_boards_lie_on_the_same_rows(made: tuple[dict[str, Any], Calibration], boards: Path) -> None:
    rectify = Rectifier(made[1], 640, 480)
    assert rectify.geometry.baseline_mm == pytest.approx(60.0, rel=0.01)
    left, right = (cv2.imread(str(boards / f"{side}03.png")) for side in ("left", "right"))
    pair = [cv2.cvtColor(p, cv2.COLOR_BGR2GRAY) for p in rectify(left, right)]
    corners = [work.find_corners(p, BOARD) for p in pair]
    assert corners[0] is not None
    assert corners[1] is not None
    apart = (corners[0] - work.same_order(corners[0], corners[1]))[:, 0, 1]
    assert np.abs(apart).mean() < 0.3


def test_corners_found_from_the_other_end_are_turned_round() -> None:
    grid = np.stack(np.meshgrid(np.arange(9.0), np.arange(6.0)), axis=-1).reshape(-1, 1, 2).astype(np.float32) * 20
    right = grid - np.array([37.0, 1.5], np.float32)
    assert np.array_equal(work.same_order(grid, right), right)
    assert np.array_equal(work.same_order(grid, right[::-1]), right)


def test_a_bad_view_is_dropped_with_its_reason(boards: Path, tmp_path: Path) -> None:
    for path in boards.iterdir():
        (tmp_path / path.name).write_bytes(path.read_bytes())
    blank = np.full((SIZE[1], SIZE[0]), 128, np.uint8)
    cv2.imwrite(str(tmp_path / "left02.png"), blank)
    moved = cv2.imread(str(tmp_path / "right05.png"), 0)
    cv2.imwrite(str(tmp_path / "right05.png"), np.roll(moved, 9, axis=0))
    out = tmp_path / "c.json"
    result = run(tmp_path, out, "--json")
    assert result.exit_code == 0, result.output
    dropped = json.loads(result.stdout)["dropped"]
    assert "board not found in the left" in dropped["left02.png"]
    assert "error" in dropped["left05.png"]
    assert load(out).rms_stereo_px < 0.25


def test_too_few_views_are_refused_in_one_sentence(boards: Path, tmp_path: Path) -> None:
    for name in ("left00.png", "right00.png", "left01.png", "right01.png"):
        (tmp_path / name).write_bytes((boards / name).read_bytes())
    result = run(tmp_path, tmp_path / "c.json")
    assert result.exit_code == 2
    assert "only 2 usable views" in result.stderr
    assert not (tmp_path / "c.json").exists()


def test_a_pattern_that_matches_nothing_is_named(tmp_path: Path) -> None:
    result = run(tmp_path, tmp_path / "c.json")
    assert result.exit_code == 2
    assert "--left" in result.stderr
    assert "matches no file" in result.stderr


@pytest.mark.parametrize("spoil", ["", "{", '{"version": 9}', "[]"])
def test_a_broken_file_is_refused_by_name(tmp_path: Path, spoil: str) -> None:
    path = tmp_path / "rig.json"
    path.write_text(spoil, encoding="utf-8")
    with pytest.raises(CalibrationError, match=r"rig\.json"):
        load(path)
    with pytest.raises(CalibrationError, match=r"missing\.json.*calibrate stereo"):
        load(tmp_path / "missing.json")


def test_a_picture_of_another_size_and_swapped_cameras_are_refused(made: tuple[dict[str, Any], Calibration]) -> None:
    rectify = Rectifier(made[1], 320, 240, "rig.json")
    with pytest.raises(CalibrationError, match="made for 640x480, but the left camera gives 320x240"):
        rectify(np.zeros((240, 320, 3), np.uint8), np.zeros((240, 320, 3), np.uint8))
    swapped = made[1].model_copy(update={"translation_mm": [60.0, 0.0, 0.0]})
    with pytest.raises(CalibrationError, match="right camera stands left"):
        Rectifier(swapped, 320, 240, "rig.json")


def test_a_file_that_is_saved_is_read_back_the_same(made: tuple[dict[str, Any], Calibration], tmp_path: Path) -> None:
    made[1].save(tmp_path / "deep" / "rig.json")
    assert load(tmp_path / "deep" / "rig.json") == made[1]
    assert [p.name for p in (tmp_path / "deep").iterdir()] == ["rig.json"]


@pytest.mark.needs_shared
def test_real_boards_reach_a_fifth_of_a_pixel(shared: Callable[[str], Path], tmp_path: Path) -> None:
    folder = shared("stereo/chess_opencv")
    result = CliRunner().invoke(
        calibrate_app,
        [
            "stereo",
            "--left",
            str(folder / "left*.jpg"),
            "--right",
            str(folder / "right*.jpg"),
            "--json",
            "--board",
            "9x6",
            "--square-mm",
            "25",
            "--out",
            str(tmp_path / "c.json"),
        ],
    )
    assert result.exit_code == 0, result.output
    summary = json.loads(result.stdout)
    assert summary["views_used"] + summary["views_dropped"] == 13
    assert summary["rms_stereo"] <= 0.21
    assert summary["epipolar_p95"] <= 0.29

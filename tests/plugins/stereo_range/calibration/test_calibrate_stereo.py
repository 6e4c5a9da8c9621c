"""`calibrate stereo`: rendered boards with known cameras, the corner-order trap, bad views, files, real boards."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest
from typer.testing import CliRunner

from chairward_stereo_range.calibration import boards as finding
from chairward_stereo_range.calibration.cli import app
from chairward_stereo_range.calibration.solve import solve
from chairward_stereo_range.calibration_file import Calibration, CalibrationError, Rectifier, load


def run(folder: Path, out: Path, *more: str, square_mm: float = 30.0, kind: str = "png") -> Any:
    patterns = ["--left", str(folder / f"left*.{kind}"), "--right", str(folder / f"right*.{kind}")]
    return CliRunner().invoke(
        app, ["stereo", *patterns, "--board", "9x6", "--square-mm", str(square_mm), "--out", str(out), *more]
    )


@pytest.fixture(scope="module")
def made(boards: Path, tmp_path_factory: pytest.TempPathFactory) -> tuple[dict[str, Any], Calibration]:
    """The command's JSON and the file it wrote."""
    out = tmp_path_factory.mktemp("made") / "stereo.json"
    result = run(boards, out, "--json")
    assert result.exit_code == 0, result.output
    return json.loads(result.stdout), load(out)


@pytest.fixture(scope="module")
def bent(rig: Any, tmp_path_factory: pytest.TempPathFactory) -> Calibration:
    """The calibration from a board that is bent by 0.03 squares, 0.9 mm."""
    folder = rig.rendered(tmp_path_factory.mktemp("bent"), 12, bend=0.03)
    result = run(folder, folder / "stereo.json")
    assert result.exit_code == 0, result.output
    return load(folder / "stereo.json")


def true_errors(rig: Any, calibration: Calibration) -> tuple[float, float]:
    """(95 % of rows apart, px; median error of depth, per cent) of points that the true cameras see at 0.5 to 1.3 m."""
    rng = np.random.default_rng(1)
    points = rng.uniform([-0.35, -0.25, 500], [0.35, 0.25, 1300], (3000, 3))
    points[:, :2] *= points[:, 2:]
    seen = [camera.pixels(points) for camera in (rig.left, rig.right)]
    inside = np.all([(s > 5) & (s < np.array(rig.size) - 5) for s in seen], axis=(0, 2))
    c = calibration
    k1, d1, k2, d2 = (np.array(a) for a in (c.left.matrix, c.left.distortion, c.right.matrix, c.right.distortion))
    shift = np.array(c.translation_mm).reshape(3, 1)
    r1, r2, p1, p2 = cv2.stereoRectify(k1, d1, k2, d2, rig.size, np.array(c.rotation), shift, alpha=0)[:4]
    left = cv2.undistortPoints(seen[0][inside, None], k1, d1, R=r1, P=p1)[:, 0]
    right = cv2.undistortPoints(seen[1][inside, None], k2, d2, R=r2, P=p2)[:, 0]
    depth = -p2[0, 3] / (left - right)[:, 0]
    truth = (points[inside] @ r1.T)[:, 2]
    rows = np.quantile(np.abs(left - right)[:, 1], 0.95)
    return float(rows), float(100 * np.median(np.abs(depth / truth - 1)))


def test_rendered_cameras_are_recovered(rig: Any, made: tuple[dict[str, Any], Calibration]) -> None:
    summary, calibration = made
    assert summary["views_used"] == 12
    assert summary["rms_stereo"] < 0.12
    assert summary["epipolar_p95"] < 0.2
    assert summary["epipolar_p95_unseen"] < 0.2
    assert set(summary) >= {
        "views_used", "views_dropped", "rms_left", "rms_right", "rms_stereo", "epipolar_mean", "epipolar_p95",
    }  # fmt: skip
    rows_px, depth_pct = true_errors(rig, calibration)
    assert rows_px < 0.2
    assert depth_pct < 0.4
    assert calibration.board_bend_mm == 0.0


def test_a_bent_board_is_noticed_and_does_not_spoil_the_distances(rig: Any, bent: Calibration) -> None:
    assert 0.5 < bent.board_bend_mm < 1.3
    rows_px, depth_pct = true_errors(rig, bent)
    assert rows_px < 0.2
    assert depth_pct < 0.5  # taken for flat: 1.5


def test_straightened_corners_lie_where_they_are(rig: Any, boards: Path) -> None:
    pairs = [(boards / f"left{n:02d}.png", boards / f"right{n:02d}.png") for n in range(6)]
    views, _ = finding.read_views(pairs, rig.board)
    solved = solve(views, finding.flat_board(rig.board))
    better = [finding.straightened(view, rig.board, (solved.left, solved.right)) for view in views]
    rng = np.random.default_rng(8)
    for view in better:
        pose = rig.random_pose(rng)
        for camera, corners in ((rig.left, view.left), (rig.right, view.right)):
            truth = camera.pixels(pose.corners())
            apart = min(float(np.abs(corners[::step, 0] - truth).mean()) for step in (1, -1))
            assert apart < 0.12
            rig.picture(camera, pose, rng)  # draws the same random numbers as the renderer did


def test_rectified_boards_lie_on_the_same_rows(
    rig: Any, made: tuple[dict[str, Any], Calibration], boards: Path
) -> None:
    rectify = Rectifier(made[1], *rig.size)
    assert rectify.geometry.baseline_mm == pytest.approx(60.0, rel=0.01)
    left, right = (cv2.imread(str(boards / f"{side}03.png"), cv2.IMREAD_GRAYSCALE) for side in ("left", "right"))
    found = finding.find_view("3", rectify(left, right), rig.board)
    assert isinstance(found, finding.View)
    assert np.abs((found.left - found.right)[:, 0, 1]).mean() < 0.3


def test_corners_found_from_the_other_end_are_turned_round() -> None:
    grid = np.stack(np.meshgrid(np.arange(9.0), np.arange(6.0)), axis=-1).reshape(-1, 1, 2).astype(np.float32) * 20
    right = grid - np.array([37.0, 1.5], np.float32)
    assert np.array_equal(finding.same_order(grid, right), right)
    assert np.array_equal(finding.same_order(grid, right[::-1]), right)


def test_bad_views_are_dropped_with_their_reasons(rig: Any, tmp_path: Path) -> None:
    rig.rendered(tmp_path, 10, moved={5: 4.0})
    cv2.imwrite(str(tmp_path / "left02.png"), np.full(rig.size[::-1], 128, np.uint8))
    out = tmp_path / "c.json"
    result = run(tmp_path, out, "--json")
    assert result.exit_code == 0, result.output
    dropped = json.loads(result.stdout)["dropped"]
    assert set(dropped) == {"left02.png", "left05.png"}
    assert "board not found in the left" in dropped["left02.png"]
    assert "moving" in dropped["left05.png"]
    assert load(out).rms_stereo_px < 0.15


def test_over_half_a_pixel_is_refused_and_nothing_is_written(rig: Any, tmp_path: Path) -> None:
    rng = np.random.default_rng(2)
    rig.rendered(tmp_path, 8, moved={n: float(rng.uniform(-8, 8)) for n in range(8)})
    result = run(tmp_path, tmp_path / "c.json")
    assert result.exit_code == 2
    assert "over 0.5 px" in result.stderr or "usable views" in result.stderr
    assert not (tmp_path / "c.json").exists()


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


def test_the_report_shows_the_rectified_pair_the_residuals_and_every_view(boards: Path, tmp_path: Path) -> None:
    for path in boards.iterdir():
        (tmp_path / path.name).write_bytes(path.read_bytes())
    cv2.imwrite(str(tmp_path / "left04.png"), np.full((360, 480), 128, np.uint8))
    result = run(tmp_path, tmp_path / "c.json", "--report", str(tmp_path / "out" / "report.html"))
    assert result.exit_code == 0, result.output
    page = (tmp_path / "out" / "report.html").read_text(encoding="utf-8")
    assert "data:image/jpeg;base64," in page
    assert page.count("<svg") == 3
    assert all(f"left{n:02d}.png" in page for n in range(12))
    assert "board not found in the left picture" in page


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
    with pytest.raises(CalibrationError, match="made for 480x360, but the left camera gives 320x240"):
        rectify(np.zeros((240, 320, 3), np.uint8), np.zeros((240, 320, 3), np.uint8))
    swapped = made[1].model_copy(update={"translation_mm": [60.0, 0.0, 0.0]})
    with pytest.raises(CalibrationError, match="right camera stands left"):
        Rectifier(swapped, 320, 240, "rig.json")


def test_a_file_that_is_saved_is_read_back_the_same(made: tuple[dict[str, Any], Calibration], tmp_path: Path) -> None:
    made[1].save(tmp_path / "deep" / "rig.json")
    assert load(tmp_path / "deep" / "rig.json") == made[1]
    assert [p.name for p in (tmp_path / "deep").iterdir()] == ["rig.json"]


@pytest.mark.needs_shared
def test_real_boards_stay_below_a_fifth_and_a_quarter_of_a_pixel(shared: Callable[[str], Path], tmp_path: Path) -> None:
    result = run(shared("stereo/chess_opencv"), tmp_path / "c.json", "--json", square_mm=25.0, kind="jpg")
    assert result.exit_code == 0, result.output
    summary = json.loads(result.stdout)
    assert summary["views_used"] + summary["views_dropped"] == 13
    assert summary["views_used"] >= 12
    assert summary["rms_stereo"] <= 0.20
    assert summary["epipolar_p95"] <= 0.25

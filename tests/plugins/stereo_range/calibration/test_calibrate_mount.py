"""`calibrate mount`: the pose of a rendered camera is found from its floor, and goes into the chair file."""

from __future__ import annotations

import json
import shutil
import tomllib
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest
from typer.testing import CliRunner

from chairward import profile
from chairward.components import Pose
from chairward_simulator.home import Home
from chairward_simulator.scene import StereoCamera
from chairward_stereo_range.calibration.cli import app

FOLDER = ("--set", "cameras.kind=folder", "--set", "cameras.playback_fps=0", "--pictures", "4")
RECTIFIED = ("--set", "cameras.focal_px=300", "--set", "cameras.baseline_mm=50")


def floor_pictures(folder: Path, pose: Pose) -> Path:
    """Four pairs over a carpet, from somewhere else each time."""
    home = Home.model_validate(
        {
            "name": "room",
            "start": {"x_mm": 0, "y_mm": 0, "heading_deg": 0},
            "floor": [{"name": "floor", "x": [-2000, 9000], "y": [-2500, 2500], "texture": "carpet"}],
            "wall": [{"name": "end", "from": [6000, -2500], "to": [6000, 2500], "texture": "brick"}],
        }
    )
    camera = StereoCamera(home, pose)
    folder.mkdir()
    for n in range(4):
        left, right = camera.pair(200.0 * n, 30.0 * n, 3.0 * n)
        cv2.imwrite(str(folder / f"left{n}.png"), left)
        cv2.imwrite(str(folder / f"right{n}.png"), right)
    return folder


def run(*more: str) -> Any:
    return CliRunner().invoke(app, ["mount", *more])


@pytest.mark.parametrize(
    "pose",
    [
        Pose(z_mm=400.0),
        Pose(z_mm=700.0, pitch_deg=15.0),
        Pose(z_mm=550.0, pitch_deg=8.0, roll_deg=2.0),
        Pose(z_mm=850.0, pitch_deg=25.0, roll_deg=-1.5),
    ],
    ids=str,
)
def test_height_pitch_and_roll_are_found(pose: Pose, tmp_path: Path) -> None:
    folder = floor_pictures(tmp_path / "floor", pose)
    result = run("--chair", "prototype", *FOLDER, "--set", f"cameras.folder={folder}", *RECTIFIED, "--json")
    assert result.exit_code == 0, result.output
    found = json.loads(result.stdout)
    assert found["z_mm"] == pytest.approx(pose.z_mm, rel=0.02)
    assert found["pitch_deg"] == pytest.approx(pose.pitch_deg, abs=0.6)
    assert found["roll_deg"] == pytest.approx(pose.roll_deg, abs=0.6)
    assert found["line"].startswith("pose = { x_mm = 200, z_mm = ")
    assert found["written"] is False


def test_the_pose_is_written_into_the_chair_file_and_nothing_else_changes(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    folder = floor_pictures(tmp_path / "floor", Pose(z_mm=320.0, pitch_deg=5.0))
    profiles = tmp_path / "profiles"
    shutil.copytree(profile.files.directory(None), profiles)
    monkeypatch.setenv("CHAIRWARD_PROFILES", str(profiles))
    chair = profiles / "chairs" / "prototype.toml"
    before = chair.read_text("utf-8").splitlines()
    result = run(
        "--chair", "prototype", *FOLDER, "--set", f"cameras.folder={folder}", *RECTIFIED, "--write"
    )  # fmt: skip
    assert result.exit_code == 0, result.output
    after = chair.read_text("utf-8").splitlines()
    changed = [(a, b) for a, b in zip(before, after, strict=True) if a != b]
    assert len(changed) == 1
    pose = tomllib.loads("\n".join(after))["lane"]["front"]["pose"]
    assert pose["x_mm"] == 200
    assert pose["z_mm"] == pytest.approx(320, rel=0.03)
    assert pose["pitch_deg"] == pytest.approx(5, abs=0.6)


def test_where_there_is_no_floor_it_says_so(tmp_path: Path) -> None:
    rng = np.random.default_rng(4)
    (tmp_path / "wall").mkdir()
    wall = rng.integers(0, 255, (240, 360, 3), dtype=np.uint8)
    for n in range(4):  # a facing wall: one disparity everywhere
        cv2.imwrite(str(tmp_path / "wall" / f"left{n}.png"), wall[:, 20:340])
        cv2.imwrite(str(tmp_path / "wall" / f"right{n}.png"), wall[:, 32:352])
    result = run("--chair", "prototype", *FOLDER, "--set", f"cameras.folder={tmp_path / 'wall'}", *RECTIFIED)
    assert result.exit_code == 2
    assert "no floor was found" in result.stderr


def test_raw_pictures_need_the_calibration_first(tmp_path: Path) -> None:
    folder = floor_pictures(tmp_path / "floor", Pose(z_mm=400.0))
    result = run("--chair", "prototype", *FOLDER, "--set", f"cameras.folder={folder}")
    assert result.exit_code == 2
    assert "make the file first with `chairward calibrate stereo`" in result.stderr

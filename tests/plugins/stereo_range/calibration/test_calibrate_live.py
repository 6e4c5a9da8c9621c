"""Live calibration: whoever does what it asks for gets done; boards fed as pictures; the lines that a page reads."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from typer.testing import CliRunner

from chairward_stereo_range.calibration.cli import app
from chairward_stereo_range.calibration.coverage import (
    COLUMNS,
    ENOUGH_CELLS,
    ENOUGH_VIEWS,
    ROWS,
    Ask,
    Coverage,
    Seen,
    ask,
    moved,
    seen,
)
from chairward_stereo_range.calibration.live import Session, preview

SIDES = {"left": (-1, 0), "right": (1, 0), "up": (0, -1), "down": (0, 1)}


class Holder:
    """Somebody who holds a board at x, y with a width (parts of the picture) and does as told, a step at a time."""

    def __init__(self, x: float, y: float, width: float) -> None:
        self.x, self.y, self.width = x, y, width
        self.turned: str | None = None

    def board(self, shift: float) -> Seen | None:
        """What a camera sees whose picture shows everything `shift` farther left; None when it does not fit."""
        x, height = self.x - shift, self.width * 0.8
        edges = (x - self.width / 2, x + self.width / 2, self.y - height / 2, self.y + height / 2)
        if min(edges) < 0 or max(edges) > 1:
            return None
        columns = {min(COLUMNS - 1, int(u * COLUMNS)) for u in np.linspace(edges[0], edges[1], 9)}
        rows = {min(ROWS - 1, int(v * ROWS)) for v in np.linspace(edges[2], edges[3], 6)}
        cells = frozenset((c, r) for c in columns for r in rows)
        return Seen(x, self.y, self.width, height, self.turned, cells)  # type: ignore[arg-type]

    def obey(self, wanted: Ask) -> None:
        for word in wanted.direction.split() if wanted.what == "move" else ():
            self.x += 0.05 * SIDES[word][0]
            self.y += 0.05 * SIDES[word][1]
        if wanted.what == "turn":
            self.turned = wanted.direction
        if wanted.what in ("nearer", "farther"):
            self.width = float(np.clip(self.width * (1.15 if wanted.what == "nearer" else 0.87), 0.1, 0.9))
        if wanted.what == "vary":
            self.x, self.width = 0.3 + (self.x + 0.09) % 0.4, 0.3 + (self.width + 0.03) % 0.3
            self.y = 0.35 + (self.y + 0.13) % 0.3
        if wanted.what == "show":
            self.x, self.y, self.width = 0.5, 0.5, 0.3


@settings(max_examples=60, deadline=None)
@given(st.floats(-0.2, 1.2), st.floats(-0.2, 1.2), st.floats(0.15, 0.8), st.floats(0.0, 0.12))
def test_whoever_does_what_is_asked_for_gets_done(x: float, y: float, width: float, shift: float) -> None:
    holder, coverage = Holder(x, y, width), Coverage()
    for _ in range(400):
        left, right = holder.board(0.0), holder.board(shift)
        wanted = ask(coverage, left, right)
        if wanted.what == "done":
            break
        if wanted.what == "hold" and left is not None and right is not None:
            coverage = coverage.with_view(left, right)
        else:
            holder.obey(wanted)
    assert wanted.what == "done", (wanted, holder.x, holder.y, holder.width, coverage.share, coverage.views)
    assert coverage.views >= ENOUGH_VIEWS
    assert coverage.share >= ENOUGH_CELLS


def test_the_board_is_sent_to_what_is_missing() -> None:
    everything = frozenset((c, r) for c in range(COLUMNS) for r in range(ROWS))
    board = Holder(0.75, 0.75, 0.4).board(0.0)
    assert board is not None
    gone = frozenset((c, r) for c in (0, 1) for r in range(ROWS))
    wanted = ask(Coverage(9, (everything - gone, everything - gone), taken=(board,)), board, board)
    assert wanted.what == "move"
    assert "left" in wanted.direction
    top = frozenset((c, r) for c in range(COLUMNS) for r in (0, 1))
    wanted = ask(Coverage(9, (everything - top, everything - top), taken=(board,)), board, board)
    assert wanted.text == "move the board up"


def test_a_board_that_one_camera_misses_is_sent_towards_the_middle() -> None:
    board = Holder(0.2, 0.8, 0.3).board(0.0)
    assert ask(Coverage(), board, None).text == "the right camera does not see the board: move it up right"
    assert ask(Coverage(), None, board).text == "the left camera does not see the board: move it up right"
    assert ask(Coverage(), None, None).what == "show"


def test_the_side_that_looks_longer_is_the_nearer_one() -> None:
    x, y = (a.ravel().astype(float) for a in np.meshgrid(np.arange(9), np.arange(6)))
    for turned, depth in (("left", 10 + x), ("right", 20 - x), ("top", 10 + y), ("bottom", 20 - y), (None, 15 + 0 * x)):
        corners = np.stack([(x - 4) / depth * 300 + 320, (y - 2.5) / depth * 300 + 240], axis=1)
        found = seen(corners.astype(np.float32).reshape(-1, 1, 2), (9, 6), (640, 480))
        assert found.turned == turned
        back = seen(corners[::-1].astype(np.float32).reshape(-1, 1, 2), (9, 6), (640, 480))
        assert back.turned == turned


def test_a_board_is_still_when_its_corners_stay() -> None:
    corners = np.zeros((54, 1, 2), np.float32)
    assert moved(None, corners, (640, 480))
    assert not moved(corners, corners + np.float32(0.5), (640, 480))
    assert moved(corners, corners + np.float32(5), (640, 480))


def test_a_view_is_taken_once_and_only_while_the_board_is_still(rig: Any) -> None:
    rng = np.random.default_rng(3)
    poses = [rig.random_pose(rng) for _ in range(3)]
    pictures = [[rig.picture(c, pose, rng) for c in (rig.left, rig.right)] for pose in poses]
    session = Session(rig.board, still=2)
    moving = [session.look(*pictures[n % 3]) for n in range(6)]
    assert not any(p.taken for p in moving)
    assert all(p.ask.text == "hold the board still" for p in moving)
    held = [session.look(*pictures[0]) for _ in range(6)]
    assert [p.taken for p in held].count(True) == 1
    assert len(session.views) == 1
    assert preview(held[-1]).shape == (360, 960, 3)


def command(*more: str) -> Any:
    return CliRunner().invoke(app, ["stereo", "--live", "--square-mm", "30", *more])


def test_a_folder_of_pictures_is_a_camera_and_every_picture_is_one_line(boards: Path, tmp_path: Path) -> None:
    shown = tmp_path / "shown" / "now.jpg"
    result = command(
        "--chair", "prototype", "--set", "cameras.kind=folder", "--set", f"cameras.folder={boards}",
        "--set", "cameras.playback_fps=0", "--still", "0", "--json-lines", "--preview", str(shown),
        "--keep", str(tmp_path / "kept"), "--out", str(tmp_path / "rig.json"),
    )  # fmt: skip
    assert result.exit_code == 0, result.output
    lines = [json.loads(line) for line in result.stdout.splitlines()]
    assert len(lines) == 13
    for number, line in enumerate(lines[:-1], start=1):
        assert line["picture"] == number
        assert set(line) == {
            "picture", "board", "views", "coverage", "cells", "turned", "near", "far",
            "ask", "direction", "text", "taken", "done",
        }  # fmt: skip
    assert [line["coverage"] for line in lines[:-1]] == sorted(line["coverage"] for line in lines[:-1])
    views = lines[-2]["views"]
    final = lines[-1]["result"]
    assert final["views_used"] + final["views_dropped"] == views >= 6
    assert final["rms_stereo"] < 0.2
    assert (tmp_path / "rig.json").is_file()
    assert cv2.imread(str(shown)).shape == (360, 960, 3)
    assert len(list((tmp_path / "kept").iterdir())) == 2 * views


def test_the_terminal_form_ends_with_the_same_figures(boards: Path, tmp_path: Path) -> None:
    result = command(
        "--chair", "prototype", "--set", "cameras.kind=folder", "--set", f"cameras.folder={boards}",
        "--set", "cameras.playback_fps=0", "--still", "0", "--out", str(tmp_path / "rig.json"),
    )  # fmt: skip
    assert result.exit_code == 0, result.output
    assert "of 15 pictures" in result.stdout
    assert "rms_stereo" in result.stdout


def test_pictures_that_are_rectified_already_are_refused(boards: Path, tmp_path: Path) -> None:
    result = command(
        "--chair", "prototype", "--set", "cameras.kind=folder", "--set", f"cameras.folder={boards}",
        "--set", "cameras.focal_px=300", "--set", "cameras.baseline_mm=50", "--json-lines",
        "--out", str(tmp_path / "rig.json"),
    )  # fmt: skip
    assert result.exit_code == 2
    assert "rectified already" in json.loads(result.stdout.splitlines()[-1])["error"]


@pytest.mark.parametrize(
    ("arguments", "says"),
    [
        ((), "--chair NAME"),
        (("--left", "0"), "--left and --right"),
        (("--left", "0", "--right", "1", "--size", "big"), "WIDTHxHEIGHT"),
        (("--chair", "nowhere"), "nowhere"),
        (("--chair", "prototype", "--lane", "voice"), "has no camera lane 'voice' (it has: front)"),
        (("--left", "/dev/none0", "--right", "/dev/none1"), "/dev/none"),
    ],
)
def test_a_camera_pair_that_is_not_there_is_said_in_one_sentence(
    arguments: tuple[str, ...], says: str, tmp_path: Path
) -> None:
    result = command(*arguments, "--json-lines", "--out", str(tmp_path / "rig.json"))
    assert result.exit_code == 2
    assert says in result.stderr

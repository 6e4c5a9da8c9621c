"""Rendered chessboards: exact cameras, lens distortion, a bent board, blur and noise; so the truth is known."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import numpy.typing as npt
import pytest

Array = npt.NDArray[np.float64]
Grey = npt.NDArray[np.uint8]

BOARD, SQUARE = (9, 6), 30.0
SIZE = (480, 360)
FINER = 3


@dataclass
class Camera:
    """matrix, distortion (k1 k2 p1 p2 k3); turn, shift: from the left camera's frame to this one's, mm."""

    matrix: Array
    distortion: Array
    turn: Array = field(default_factory=lambda: np.eye(3))
    shift: Array = field(default_factory=lambda: np.zeros(3))

    def __post_init__(self) -> None:
        at = [(np.arange(n * FINER) + 0.5) / FINER - 0.5 for n in SIZE]
        columns, rows = (a.ravel() for a in np.meshgrid(*at))
        seen_x = (columns - self.matrix[0, 2]) / self.matrix[0, 0]
        seen_y = (rows - self.matrix[1, 2]) / self.matrix[1, 1]
        k1, k2, p1, p2, k3 = self.distortion
        x, y = seen_x, seen_y
        for _ in range(15):  # Brown's model undone by fixed point iteration
            r2 = x * x + y * y
            radial = 1 + r2 * (k1 + r2 * (k2 + r2 * k3))
            sideways, down = 2 * p1 * x * y + p2 * (r2 + 2 * x * x), p1 * (r2 + 2 * y * y) + 2 * p2 * x * y
            x, y = (seen_x - sideways) / radial, (seen_y - down) / radial
        rays = np.stack([x, y, np.ones(x.shape)], axis=1).astype(np.float32)
        self.rays = rays.reshape(SIZE[1] * FINER, SIZE[0] * FINER, 3)

    def pixels(self, points: Array) -> Array:
        """Where points (n x 3, left camera's frame) are seen, n x 2 px."""
        there = points @ self.turn.T + self.shift
        return np.asarray(cv2.projectPoints(there, np.zeros(3), np.zeros(3), self.matrix, self.distortion)[0][:, 0])


LEFT = Camera(np.array([[420.0, 0, 241.5], [0, 421.5, 178.5], [0, 0, 1]]), np.array([-0.12, 0.05, 0.001, -0.0005, 0.0]))
RIGHT = Camera(
    np.array([[424.0, 0, 238.0], [0, 424.5, 181.0], [0, 0, 1]]),
    np.array([-0.11, 0.04, -0.0005, 0.0008, 0.0]),
    cv2.Rodrigues(np.array([0.004, -0.012, 0.003]))[0],
    np.array([-60.0, 0.6, 0.9]),
)


def height(x: Any, y: Any, bend: float) -> Any:
    """How far a bent board lies behind its plane at x, y (squares from its first corner), in squares."""
    u, v = (x - (BOARD[0] - 1) / 2) / 4, (y - (BOARD[1] - 1) / 2) / 4
    return bend * (u * u - 0.5 * u * v)


@dataclass
class Pose:
    """Where the board is: its first corner at `shift` mm, its axes the columns of `turn` (left camera's frame)."""

    turn: Array
    shift: Array
    bend: float = 0.0

    def corners(self) -> Array:
        """The inner corners as they really are, n x 3 mm."""
        x, y = (a.ravel().astype(np.float64) for a in np.meshgrid(np.arange(BOARD[0]), np.arange(BOARD[1])))
        flat = np.stack([x, y, height(x, y, self.bend)], axis=1) * SQUARE
        return np.asarray(flat @ self.turn.T + self.shift)


def picture(camera: Camera, pose: Pose, rng: np.random.Generator, noise: float = 2.0, moved_px: float = 0.0) -> Grey:
    """What a camera sees of the board. moved_px: the board went on so far before this camera's shutter."""
    turn = (camera.turn @ pose.turn).astype(np.float32)
    shift = (camera.turn @ pose.shift + camera.shift).astype(np.float32)
    shift[1] += moved_px * shift[2] / camera.matrix[1, 1]
    level = np.full((SIZE[1] * FINER, SIZE[0] * FINER), 120, np.float32)
    rim = np.array([(x, y, 0) for x in (-3, BOARD[0] + 2) for y in (-3, BOARD[1] + 2)]) * SQUARE
    seen = camera.pixels(rim @ pose.turn.T + pose.shift)
    low, high = (np.clip(edge * FINER, 0, None).astype(int) for edge in (seen.min(axis=0), seen.max(axis=0)))
    there = slice(low[1], high[1]), slice(low[0], high[0])
    rays, normal = camera.rays[there], turn[:, 2]
    x, y = np.float32(0), np.float32(0)
    for _ in range(3 if pose.bend else 1):  # the ray's hit moves with the height that the board has there
        depth = (normal @ shift + height(x, y, pose.bend) * SQUARE) / (rays @ normal)
        at = (rays * depth[..., None] - shift) @ turn / np.float32(SQUARE)
        x, y = at[..., 0], at[..., 1]
    on_paper = (np.abs(x - (BOARD[0] - 1) / 2) < BOARD[0] / 2 + 1) & (np.abs(y - (BOARD[1] - 1) / 2) < BOARD[1] / 2 + 1)
    squares = (x > -1) & (x < BOARD[0]) & (y > -1) & (y < BOARD[1])
    dark = squares & ((np.floor(x) + np.floor(y)) % 2 == 0)
    level[there] = np.where(dark, 40, np.where(on_paper, 210, 120))
    small = cv2.GaussianBlur(cv2.resize(level, SIZE, interpolation=cv2.INTER_AREA), (0, 0), 0.6)
    return np.asarray(np.clip(small + rng.normal(0, noise, small.shape), 0, 255), np.uint8)


def random_pose(rng: np.random.Generator, bend: float = 0.0) -> Pose:
    """A board that both cameras see, somewhere in the picture, tilted by up to 30 degrees."""
    while True:
        turn = cv2.Rodrigues(rng.uniform(-0.5, 0.5, 3) * [1, 1, 0.5])[0]
        depth = rng.uniform(420, 800)
        middle = np.array([rng.uniform(-0.25, 0.3) * depth, rng.uniform(-0.25, 0.25) * depth, depth])
        pose = Pose(turn, middle - turn @ np.array([SQUARE * 4, SQUARE * 2.5, 0]), bend)
        seen = np.concatenate([camera.pixels(pose.corners()) for camera in (LEFT, RIGHT)])
        if (seen > 14).all() and (seen < np.array(SIZE) - 14).all():
            return pose


def rendered(folder: Path, views: int, seed: int = 8, bend: float = 0.0, moved: dict[int, float] | None = None) -> Path:
    """Pictures leftNN.png, rightNN.png in a folder. moved: view -> px that the board moved between the shutters."""
    folder.mkdir(parents=True, exist_ok=True)
    rng = np.random.default_rng(seed)
    for n in range(views):
        pose = random_pose(rng, bend)
        cv2.imwrite(str(folder / f"left{n:02d}.png"), picture(LEFT, pose, rng))
        cv2.imwrite(str(folder / f"right{n:02d}.png"), picture(RIGHT, pose, rng, moved_px=(moved or {}).get(n, 0.0)))
    return folder


@dataclass
class Rig:
    """What the tests of this folder share (importlib mode has no importable test modules)."""

    board: tuple[int, int] = BOARD
    square_mm: float = SQUARE
    size: tuple[int, int] = SIZE
    left: Camera = field(default_factory=lambda: LEFT)
    right: Camera = field(default_factory=lambda: RIGHT)
    pose: type[Pose] = Pose
    picture: Callable[..., Grey] = staticmethod(picture)
    random_pose: Callable[..., Pose] = staticmethod(random_pose)
    rendered: Callable[..., Path] = staticmethod(rendered)


@pytest.fixture(scope="session")
def rig() -> Rig:
    return Rig()


@pytest.fixture(scope="session")
def boards(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Twelve rendered board pairs."""
    return rendered(tmp_path_factory.mktemp("boards"), 12)

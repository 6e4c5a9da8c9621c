"""A tiny exact renderer of textured planes, and the places of the shared data."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from math import cos, inf, radians, sin
from pathlib import Path

import cv2
import numpy as np
import numpy.typing as npt
import pytest

from chairward.components import Footprint, Pose
from chairward.stages import Image, StereoGeometry
from chairward_stereo_range.finder import Options, RangeFinder
from chairward_stereo_range.geometry import make_view

SHARED = Path(__file__).resolve().parents[4] / "shared" / "data"
FOOTPRINT = Footprint(front_mm=0.0, rear_mm=1000.0, half_width_mm=320.0)
MOUNT_A = Pose(z_mm=400.0)
MOUNT_B = Pose(z_mm=700.0, pitch_deg=15.0)


@dataclass(frozen=True)
class Board:
    """An upright rectangle facing the chair: forward distance, left and right edge (x left positive), height range."""

    ahead_mm: float
    left_mm: float = 4000.0
    right_mm: float = -4000.0
    bottom_mm: float = 0.0
    top_mm: float = 3000.0
    texture: str = "rough"
    level: float = 120.0


@dataclass(frozen=True)
class Room:
    """A floor (ending at floor_to_mm) and boards on it; what is beyond everything is a rough wall at 6 m."""

    boards: tuple[Board, ...] = ()
    floor: str = "rough"
    floor_to_mm: float = inf
    floor_below_mm: float = 400.0
    driven_mm: float = 0.0
    noise: float = 1.5
    seed: int = 1


def _texture(seed: int) -> npt.NDArray[np.float32]:
    rng = np.random.default_rng(seed)
    out = np.zeros((512, 512), np.float32)
    for size, weight in ((512, 12.0), (256, 16.0), (128, 20.0)):
        coarse = rng.normal(0, 1, (size, size)).astype(np.float32)
        out += weight * cv2.resize(coarse, (512, 512), interpolation=cv2.INTER_CUBIC)
    return out


_TEXTURES = [_texture(seed) for seed in range(4)]


def _paint(kind: str, which: int, u: npt.NDArray[np.float32], v: npt.NDArray[np.float32]) -> npt.NDArray[np.float32]:
    if kind == "plain":
        return np.zeros(u.shape, np.float32)
    if kind == "stripes":
        return np.where(np.floor(u / 20.0) % 2 == 0, 40.0, -40.0).astype(np.float32)
    x, y = (np.mod(a / 4.0, 510.0).astype(np.float32) for a in (u, v))
    return np.asarray(cv2.remap(_TEXTURES[which % 4], x, y, cv2.INTER_LINEAR), np.float32)


def _camera(room: Room, geometry: StereoGeometry, pose: Pose, shift_mm: float) -> npt.NDArray[np.float32]:
    """One grey picture; the camera stands shift_mm to the right of the left one and room.driven_mm ahead."""
    x = (np.arange(geometry.width_px) - geometry.cx_px) / geometry.focal_px
    y = (np.arange(geometry.height_px) - geometry.cy_px) / geometry.focal_px
    right, down = np.meshgrid(x, y)
    p = radians(pose.pitch_deg)
    forward, up = cos(p) - down * sin(p), -sin(p) - down * cos(p)
    picture = np.full(right.shape, 120.0, np.float32)
    best = np.full(right.shape, inf)
    with np.errstate(divide="ignore", invalid="ignore"):
        for level, start, end, texture, which in (
            (0.0, -inf, room.floor_to_mm, room.floor, 0),
            (-room.floor_below_mm, room.floor_to_mm, inf, room.floor, 1),
        ):
            z = np.where(up < -1e-9, (pose.z_mm - level) / -up, inf)
            ahead = z * forward + room.driven_mm
            hit = (z < best) & (z > 0) & (ahead >= start) & (ahead < end) & (ahead < 6000)
            u, v = (shift_mm + z * right).astype(np.float32), ahead.astype(np.float32)
            picture[hit] = (110.0 + _paint(texture, which, np.where(hit, u, 0), np.where(hit, v, 0)))[hit]
            best[hit] = z[hit]
        for which, board in enumerate((*room.boards, Board(6000.0)), start=2):
            z = np.where(forward > 1e-9, (board.ahead_mm - room.driven_mm) / forward, inf)
            height, leftward = pose.z_mm + z * up, -(shift_mm + z * right)
            hit = (z < best) & (z > 0) & (leftward <= board.left_mm) & (leftward >= board.right_mm)
            hit &= (height >= board.bottom_mm) & (height <= board.top_mm)
            u, v = leftward.astype(np.float32), height.astype(np.float32)
            shade = board.level + _paint(board.texture, which, np.where(hit, u, 0), np.where(hit, v, 0))
            picture[hit] = shade[hit]
            best[hit] = z[hit]
    return picture


def geometry_of(width: int = 320, height: int = 240, focal: float = 300.0, baseline: float = 50.0) -> StereoGeometry:
    """Principal point in the middle, no doffs."""
    return StereoGeometry(
        focal_px=focal,
        baseline_mm=baseline,
        cx_px=(width - 1) / 2,
        cy_px=(height - 1) / 2,
        width_px=width,
        height_px=height,
    )


def render(room: Room, geometry: StereoGeometry | None = None, pose: Pose = MOUNT_A) -> tuple[Image, Image]:
    """The rectified pair of a room, BGR."""
    geometry = geometry or geometry_of()
    rng = np.random.default_rng(room.seed)
    pair = []
    for shift in (0.0, geometry.baseline_mm):
        grey = _camera(room, geometry, pose, shift)
        grey = grey + rng.normal(0, room.noise, grey.shape).astype(np.float32)
        pair.append(np.repeat(np.clip(grey, 0, 255).astype(np.uint8)[:, :, None], 3, axis=2))
    return pair[0], pair[1]


def finder_of(pose: Pose = MOUNT_A, geometry: StereoGeometry | None = None, **options: object) -> RangeFinder:
    """A finder of a rig on the test footprint (distances from the lens)."""
    return RangeFinder(make_view(geometry or geometry_of(), pose, FOOTPRINT), Options(**options))  # type: ignore[arg-type]


@pytest.fixture(scope="session")
def shared() -> Callable[[str], Path]:
    """A path inside the shared data, or a skip that names it."""

    def find(inside: str) -> Path:
        path = SHARED / inside
        if not path.exists():
            pytest.skip(f"needs ../shared/data/{inside}")
        return path

    return find


@dataclass
class Tools:
    """What the tests of this folder share (importlib mode has no importable test modules)."""

    board: type[Board] = Board
    room: type[Room] = Room
    mount_a: Pose = field(default_factory=lambda: MOUNT_A)
    mount_b: Pose = field(default_factory=lambda: MOUNT_B)
    footprint: Footprint = field(default_factory=lambda: FOOTPRINT)
    render: Callable[..., tuple[Image, Image]] = staticmethod(render)
    geometry: Callable[..., StereoGeometry] = staticmethod(geometry_of)
    finder: Callable[..., RangeFinder] = staticmethod(finder_of)


@pytest.fixture(scope="session")
def tools() -> Tools:
    """Renderer and builders."""
    return Tools()

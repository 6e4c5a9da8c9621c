"""The home as the renderer's rectangles and cylinders, and the stereo camera that looks at them."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from math import cos, hypot, radians, sin
from zlib import crc32

import numpy as np
import numpy.typing as npt

from chairward.components import Pose
from chairward.stages import Image, StereoGeometry
from chairward_simulator import render, textures
from chairward_simulator.home import PERSON_RADIUS_MM, Box, Home, Point, corners, wall_as_box

GEOMETRY = StereoGeometry(
    focal_px=300.0, baseline_mm=50.0, cx_px=159.5, cy_px=119.5, width_px=320, height_px=240, doffs_px=0.0
)
"""The thesis' pair (section 3): 320 x 240, f 300 px, 50 mm apart: Z = 15 000 / d."""

UP = (0.0, 0.0, 1.0)
Vector = tuple[float, float, float]
AddFace = Callable[[str, Vector, Vector, float, Vector, float, str], None]
"""name, corner, first edge and length, second edge and length, texture."""


@dataclass(slots=True)
class Scene:
    """Arrays as `render` wants them; names[id] tells which thing a face or cylinder belongs to."""

    faces: render.Array
    cylinders: render.Array
    lamps: render.Array
    names: list[str] = field(default_factory=list)


def build(home: Home) -> Scene:
    """Rectangles of all floors, ceilings, walls and boxes; cylinders; a lamp above the middle of each floor."""
    rooms = [floor for floor in home.floor if floor.z >= 0]
    lamps = [[sum(f.x) / 2, sum(f.y) / 2, home.ceiling_mm - 250.0, 0.34, 0.95] for f in rooms]
    scene = Scene(np.empty((0, 0)), np.empty((0, 0)), np.array(lamps))
    rows: list[list[float]] = []

    def face(name: str, at: Vector, e1: Vector, length: float, e2: Vector, height: float, texture: str) -> None:
        normal = np.cross(e1, e2)
        middle = np.array(at) + np.array(e1) * length / 2 + np.array(e2) * height / 2 + normal * 200.0
        lamp = int(np.argmin([hypot(middle[0] - lx, middle[1] - ly) for lx, ly, *_ in lamps]))
        seed = crc32(f"{name} {len(rows)}".encode())
        origin = (seed % 512 * textures.TEXEL_MM, 0.0) if e2 == UP else (0.0, 0.0)
        rows.append(
            [*at, *e1, *e2, *normal, length, height, textures.index_of(texture), *origin, lamp, _id(scene, name)]
        )

    for floor in home.floor:
        (x0, x1), (y0, y1) = floor.x, floor.y
        face(floor.name, (x0, y0, floor.z), (1, 0, 0), x1 - x0, (0, 1, 0), y1 - y0, floor.texture)
        face("ceiling", (x1, y0, home.ceiling_mm), (-1, 0, 0), x1 - x0, (0, 1, 0), y1 - y0, "ceiling")
        if floor.z < 0:
            ring: list[Point] = [(x0, y0), (x0, y1), (x1, y1), (x1, y0)]
            for (ax, ay), (bx, by) in zip(ring, ring[1:] + ring[:1], strict=True):
                length = hypot(bx - ax, by - ay)
                along = ((bx - ax) / length, (by - ay) / length, 0.0)
                face(floor.name, (ax, ay, floor.z), along, length, UP, -floor.z, floor.texture)
    for box in [*home.box, *(wall_as_box(wall, home.ceiling_mm) for wall in home.wall)]:
        _box_faces(box, face)
    scene.faces = np.array(rows, dtype=np.float64).reshape(-1, render.FACE_COLUMNS)
    scene.cylinders = np.array(
        [
            [*c.at, c.radius, c.bottom, c.bottom + c.height, textures.index_of(c.texture), 0.0, 0, _id(scene, c.name)]
            for c in home.cylinder
        ],
        dtype=np.float64,
    ).reshape(-1, render.CYLINDER_COLUMNS)
    for row in scene.cylinders:
        row[7] = int(np.argmin([hypot(row[0] - lx, row[1] - ly) for lx, ly, *_ in lamps]))
    return scene


def _id(scene: Scene, name: str) -> int:
    """Number of a name, new or known."""
    if name not in scene.names:
        scene.names.append(name)
    return scene.names.index(name)


def _box_faces(box: Box, face: AddFace) -> None:
    """Four sides, the top, and the underside of what hangs."""
    ring = corners(box)
    top = box.bottom + box.size[2]
    for (ax, ay), (bx, by) in zip(ring, ring[1:] + ring[:1], strict=True):
        length = hypot(bx - ax, by - ay)
        along = ((bx - ax) / length, (by - ay) / length, 0.0)
        face(box.name, (ax, ay, box.bottom), along, length, UP, box.size[2], box.texture)
    c, s = cos(radians(box.turned_deg)), sin(radians(box.turned_deg))
    w, d, _ = box.size
    face(box.name, (*ring[0], top), (c, s, 0.0), w, (-s, c, 0.0), d, box.texture)
    if box.bottom > 0:
        face(box.name, (*ring[1], box.bottom), (-c, -s, 0.0), w, (-s, c, 0.0), d, box.texture)


def person_cylinders(scene: Scene, x_mm: float, y_mm: float, facing_deg: float, walked_mm: float) -> render.Array:
    """A person in a long coat: two legs that stride, coat, chest, head."""
    c, s = cos(radians(facing_deg)), sin(radians(facing_deg))
    stride = 140.0 * sin(walked_mm / 230.0)
    name = _id(scene, "person")
    lamp = int(np.argmin([hypot(x_mm - lx, y_mm - ly) for lx, ly, *_ in scene.lamps]))

    def part(along: float, left: float, radius: float, bottom: float, top: float, texture: str) -> list[float]:
        at = (x_mm + c * along - s * left, y_mm + s * along + c * left)
        return [*at, radius, bottom, top, textures.index_of(texture), 100.0 + left, lamp, name]

    coat = PERSON_RADIUS_MM
    parts = [
        part(stride, 90.0, 70.0, 0.0, 320.0, "clothes"),
        part(-stride, -90.0, 70.0, 0.0, 320.0, "clothes"),
        part(0.0, 0.0, coat, 250.0, 900.0, "clothes"),
        part(0.0, 0.0, coat - 30.0, 900.0, 1420.0, "shirt"),
        part(0.0, 0.0, 95.0, 1420.0, 1730.0, "skin"),
    ]
    return np.array(parts, dtype=np.float64)


def axes_of(heading_deg: float, pose: Pose) -> render.Array:
    """Rows: the camera's forward, right and down in the home's frame."""
    yaw, pitch, roll = radians(heading_deg + pose.yaw_deg), radians(pose.pitch_deg), radians(pose.roll_deg)
    forward = np.array([cos(yaw) * cos(pitch), sin(yaw) * cos(pitch), -sin(pitch)])
    right = np.array([sin(yaw), -cos(yaw), 0.0])
    down = np.cross(forward, right)
    return np.array([forward, cos(roll) * right + sin(roll) * down, cos(roll) * down - sin(roll) * right])


class StereoCamera:
    """A rectified pair. `pose` is the *left* camera's, the one in whose picture disparities are measured."""

    def __init__(self, home: Home, pose: Pose, noise: float = 2.0, seed: int = 1) -> None:
        self.scene = build(home)
        self.pose = pose
        self.geometry = GEOMETRY
        self._rng = np.random.default_rng(seed)
        bank = self._rng.normal(0.0, noise, 1_000_003)
        self._noise: npt.NDArray[np.int8] = np.clip(np.rint(bank), -100, 100).astype(np.int8)
        self._texels, self._offsets = textures.atlas()
        shape = (GEOMETRY.height_px, GEOMETRY.width_px)
        self._inverse = np.zeros(shape)
        self._ids = np.full(shape, -1, dtype=np.int32)

    def pair(
        self, x_mm: float, y_mm: float, heading_deg: float, people: Sequence[render.Array] = ()
    ) -> tuple[Image, Image]:
        """Left and right picture (240 x 320 x 3 BGR) from the chair's pose in the home."""
        return (
            self._picture(x_mm, y_mm, heading_deg, people, 0.0),
            self._picture(x_mm, y_mm, heading_deg, people, self.geometry.baseline_mm),
        )

    def truth(
        self, x_mm: float, y_mm: float, heading_deg: float, people: Sequence[render.Array] = ()
    ) -> tuple[npt.NDArray[np.float64], npt.NDArray[np.int32], list[str]]:
        """Of the left picture: depth along the optical axis in mm (inf: nothing), number of the thing seen, names."""
        cylinders = self._see(x_mm, y_mm, heading_deg, people, 0.0)[0]
        all_ids = np.concatenate([self.scene.faces[:, 18], cylinders[:, 8], [-1.0]]).astype(np.int32)
        depth = np.full_like(self._inverse, np.inf)
        np.divide(1.0, self._inverse, out=depth, where=self._inverse > 0)
        return depth, all_ids[self._ids], list(self.scene.names)

    def _see(
        self, x_mm: float, y_mm: float, heading_deg: float, people: Sequence[render.Array], right_mm: float
    ) -> tuple[render.Array, render.Array, render.Array]:
        """Visibility into the buffers; gives the cylinders, the camera's place and its axes."""
        axes = axes_of(heading_deg, self.pose)
        c, s = cos(radians(heading_deg)), sin(radians(heading_deg))
        at = np.array(
            [
                x_mm + c * self.pose.x_mm - s * self.pose.y_mm,
                y_mm + s * self.pose.x_mm + c * self.pose.y_mm,
                self.pose.z_mm,
            ]
        )
        at = at + right_mm * axes[1]
        cylinders = np.concatenate([self.scene.cylinders, *people])
        self._inverse.fill(0.0)
        self._ids.fill(-1)
        g = self.geometry
        render.see_faces(self.scene.faces, at, axes, g.focal_px, g.cx_px, g.cy_px, self._inverse, self._ids)
        n = len(self.scene.faces)
        render.see_cylinders(cylinders, n, at, axes, g.focal_px, g.cx_px, g.cy_px, self._inverse, self._ids)
        return cylinders, at, axes

    def _picture(
        self, x_mm: float, y_mm: float, heading_deg: float, people: Sequence[render.Array], right_mm: float
    ) -> Image:
        cylinders, at, axes = self._see(x_mm, y_mm, heading_deg, people, right_mm)
        g = self.geometry
        out = np.empty((g.height_px, g.width_px, 3), dtype=np.uint8)
        noise_at = int(self._rng.integers(0, len(self._noise)))
        render.shade(
            self.scene.faces, cylinders, self.scene.lamps, at, axes, g.focal_px, g.cx_px, g.cy_px,
            self._inverse, self._ids, self._texels, self._offsets, textures.TEXEL_MM, textures.SIZE,
            1.0, 0.25, self._noise, noise_at, out,
        )  # fmt: skip
        return out

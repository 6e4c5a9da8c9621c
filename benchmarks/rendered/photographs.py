"""Stereo pairs of a room with exact truth: the simulator's rasteriser, then shadows, gloss and a sensor."""

from __future__ import annotations

from dataclasses import dataclass, replace

import cv2
import numpy as np
import numpy.typing as npt
from rooms import BELOW, FLOOR, Patch, Room
from surfaces import SIZE, TEXEL_MM, Atlas

from chairward.components import Pose
from chairward.stages import Image, StereoGeometry
from chairward_simulator.render import see_cylinders, see_faces, shade
from chairward_simulator.scene import axes_of

Floats = npt.NDArray[np.float64]
NO_NOISE = np.zeros(8, np.int8)


@dataclass(frozen=True, slots=True)
class Sensor:
    """A pair of real cameras: exposure of each, noise (grey levels), blur (px), JPEG quality, misrotation (degrees)."""

    exposure: tuple[float, float]
    tint: tuple[float, float, float]
    noise: float
    blur_px: float
    jpeg: int
    misrotation_deg: tuple[float, float, float]


def sensor(rng: np.random.Generator) -> Sensor:
    """Good, ordinary or bad cameras, in good or dim light. Misrotation: what calibration leaves, 0.25 px and less."""
    bad = rng.choice([0.4, 1.0, 1.6])
    dim = rng.random() < 0.25
    exposure = float(rng.uniform(0.35, 0.55) if dim else rng.uniform(0.75, 1.15))
    rest = rng.uniform(-1, 1, 3) * np.array([0.02, 0.02, 0.02]) * bad
    return Sensor(
        (exposure, exposure * float(1 + rng.uniform(-0.08, 0.08) * bad)),
        (1.0, float(1 + rng.uniform(-0.04, 0.04) * bad), float(1 + rng.uniform(-0.04, 0.04) * bad)),
        float(rng.uniform(1.0, 2.5) * bad * (1.4 if dim else 1.0)),
        float(rng.uniform(0.3, 0.6)),
        int(rng.choice([95, 85, 75] if bad < 1.5 else [75, 65])),
        (float(rest[0]), float(rest[1]), float(rest[2])),
    )


class Photographer:
    """Takes pictures of one room with one atlas. finer: samples a pixel along each side."""

    def __init__(self, room: Room, atlas: Atlas, finer: int = 2) -> None:
        self._room, self._atlas, self._finer = room, atlas, finer
        self._faces = np.array(room.faces, np.float64)
        self._cylinders = np.array(room.cylinders, np.float64).reshape(-1, 9)
        self._lamps = np.array([room.lamp], np.float64)
        mirrored = self._faces[self._faces[:, 18] > BELOW].copy()
        self._mirrored = mirrored if len(mirrored) else self._faces[:1].copy()

    def pair(
        self, geometry: StereoGeometry, pose: Pose, heading_deg: float, cameras: Sensor, rng: np.random.Generator
    ) -> tuple[Image, Image]:
        """Left and right picture, h x w x 3 BGR; pose: the left camera's, in the room (x, y, z)."""
        pictures = []
        axes = axes_of(heading_deg, pose)
        at = np.array([pose.x_mm, pose.y_mm, pose.z_mm])
        yaw, pitch, roll = cameras.misrotation_deg
        turned = replace(pose, pitch_deg=pose.pitch_deg + pitch, roll_deg=pose.roll_deg + roll)
        looks = ((at, axes), (at + geometry.baseline_mm * axes[1], axes_of(heading_deg + yaw, turned)))
        for (where, how), exposure, tint in zip(looks, cameras.exposure, ((1, 1, 1), cameras.tint), strict=True):
            pictures.append(_exposed(self._look(geometry, where, how) * exposure * tint, cameras, rng))
        return pictures[0], pictures[1]

    def truth(self, geometry: StereoGeometry, pose: Pose, heading_deg: float) -> tuple[Floats, npt.NDArray[np.int32]]:
        """Depth along the optical axis (mm) and id of every pixel of the left picture."""
        at = np.array([pose.x_mm, pose.y_mm, pose.z_mm])
        inverse, which = self._see(self._faces, geometry, at, axes_of(heading_deg, pose), 1)
        ids = np.concatenate([self._faces[:, 18], self._cylinders[:, 8], [-1.0]]).astype(np.int32)
        depth = np.full_like(inverse, np.inf)
        np.divide(1.0, inverse, out=depth, where=inverse > 0)
        return depth, ids[which]

    def _see(
        self, faces: Floats, geometry: StereoGeometry, at: Floats, axes: Floats, finer: int
    ) -> tuple[Floats, npt.NDArray[np.int32]]:
        shape = (geometry.height_px * finer, geometry.width_px * finer)
        inverse, which = np.zeros(shape), np.full(shape, -1, np.int32)
        f, cx, cy = _fine(geometry, finer)
        see_faces(faces, at, axes, f, cx, cy, inverse, which)
        see_cylinders(self._cylinders, len(faces), at, axes, f, cx, cy, inverse, which)
        return inverse, which

    def _shaded(
        self, faces: Floats, geometry: StereoGeometry, at: Floats, axes: Floats
    ) -> tuple[npt.NDArray[np.float32], Floats, npt.NDArray[np.int32]]:
        inverse, which = self._see(faces, geometry, at, axes, self._finer)
        f, cx, cy = _fine(geometry, self._finer)
        out = np.empty((*inverse.shape, 3), np.uint8)
        shade(
            faces, self._cylinders, self._lamps, at, axes, f, cx, cy, inverse, which, self._atlas.texels,
            self._atlas.offsets, TEXEL_MM, SIZE, 1.0, 0.2, NO_NOISE, 0, out,
        )  # fmt: skip
        return out.astype(np.float32), inverse, which

    def _look(self, geometry: StereoGeometry, at: Floats, axes: Floats) -> npt.NDArray[np.float32]:
        """One picture without a sensor, h x w x 3, levels 0..255."""
        picture, inverse, which = self._shaded(self._faces, geometry, at, axes)
        ids = np.concatenate([self._faces[:, 18], np.full(len(self._cylinders) + 1, 99)])
        floor = ids[which] == FLOOR
        if self._room.patches:
            lens = _fine(geometry, self._finer)
            picture[floor] *= _light(self._room.patches, lens, at, axes, inverse, floor)[:, None]
        if self._room.gloss:
            below = np.array([1.0, 1.0, -1.0])
            mirror, _, _ = self._shaded(self._mirrored, geometry, at * below, axes * below)
            rows = np.nonzero(floor)[0] / floor.shape[0]
            share = self._room.gloss * (0.4 + 0.9 * (1 - rows))[:, None].astype(np.float32)  # more at grazing angles
            picture[floor] = picture[floor] * (1 - share) + mirror[floor] * share
        size = (geometry.width_px, geometry.height_px)
        return np.asarray(cv2.resize(picture, size, interpolation=cv2.INTER_AREA), np.float32)


def _fine(geometry: StereoGeometry, finer: int) -> tuple[float, float, float]:
    """Focal length and principal point (x, y) in samples."""
    return geometry.focal_px * finer, (geometry.cx_px + 0.5) * finer - 0.5, (geometry.cy_px + 0.5) * finer - 0.5


def _light(
    patches: list[Patch], lens: tuple[float, float, float], at: Floats, axes: Floats, inverse: Floats,
    floor: npt.NDArray[np.bool_],
) -> npt.NDArray[np.float32]:  # fmt: skip
    """What the floor's pixels are multiplied with: soft convex patches of light and shadow."""
    rows, cols = np.nonzero(floor)
    depth = 1.0 / inverse[rows, cols]
    right, down = (cols - lens[1]) / lens[0], (rows - lens[2]) / lens[0]
    x, y = (at[k] + depth * (axes[0, k] + right * axes[1, k] + down * axes[2, k]) for k in (0, 1))
    out = np.ones(rows.size, np.float32)
    for patch in patches:
        inside = np.full(rows.size, np.inf)
        for a, b in zip(patch.corners, np.roll(patch.corners, -1, axis=0), strict=True):
            along = (b - a) / np.linalg.norm(b - a)
            inside = np.minimum(inside, along[0] * (y - a[1]) - along[1] * (x - a[0]))
        share = np.clip(inside / patch.rim_mm + 1.0, 0.0, 1.0)
        out *= (1.0 + (patch.factor - 1.0) * share).astype(np.float32)
    return out


def _exposed(linear: npt.NDArray[np.float32], cameras: Sensor, rng: np.random.Generator) -> Image:
    blurred = cv2.GaussianBlur(linear.astype(np.float32), (0, 0), cameras.blur_px)
    noisy = blurred + rng.standard_normal(blurred.shape, np.float32) * np.float32(cameras.noise)
    exposed = np.clip(noisy + 0.5, 0, 255).astype(np.uint8)
    coded = cv2.imencode(".jpg", exposed, [cv2.IMWRITE_JPEG_QUALITY, cameras.jpeg])[1]
    return np.asarray(cv2.imdecode(coded, cv2.IMREAD_COLOR), np.uint8)

"""Rasterising the home: flat rectangles and upright cylinders, exact depth, textures, one lamp a room.

A rectangle with corner P, unit edges e1 e2 and normal n is hit by the ray C + t d where 1/t = (n.d) / (n.(P-C)), and
the hit lies inside where four more functions are positive; all five are *linear* in the pixel's column and row
(homogeneous rasterisation, Olano and Greer 1997). So visibility is exact without clipping and costs one comparison a
pixel; texture and light are worked out once, for the nearest surface only. t is the depth along the optical axis.
"""

from __future__ import annotations

from math import floor, sqrt
from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt
from numba import njit

if TYPE_CHECKING:
    from collections.abc import Callable

Array = npt.NDArray[np.float64]

FACE_COLUMNS = 19
"""0-2 corner P, 3-5 e1, 6-8 e2, 9-11 normal, 12 length, 13 height, 14 texture, 15-16 texture origin, 17 lamp, 18 id."""
CYLINDER_COLUMNS = 9
"""0-1 middle, 2 radius, 3 bottom, 4 top, 5 texture, 6 texture origin, 7 lamp, 8 id."""
NEAR_MM = 20.0

if TYPE_CHECKING:

    def _jit(function: Callable[..., Any]) -> Callable[..., Any]: ...

else:
    _jit = njit(cache=True, fastmath=True, error_model="numpy", nogil=True)


@_jit
def _limit(a: float, b: float, first: float, last: float) -> tuple[float, float]:
    """Narrow first..last to where a * x + b >= 0."""
    if a > 1e-15:
        return max(first, -b / a), last
    if a < -1e-15:
        return first, min(last, -b / a)
    if b < 0.0:
        return 1.0, 0.0
    return first, last


@_jit
def see_faces(faces: Array, c: Array, axes: Array, f: float, cx: float, cy: float, inverse: Array, ids: Any) -> None:
    """Fill 1/depth and the face number of the nearest rectangle. axes: rows forward, right, down."""
    height, width = inverse.shape
    for k in range(faces.shape[0]):
        qx = faces[k, 0] - c[0]
        qy = faces[k, 1] - c[1]
        qz = faces[k, 2] - c[2]
        away = faces[k, 9] * qx + faces[k, 10] * qy + faces[k, 11] * qz
        if away > -1e-6:
            continue  # seen from behind
        g = np.empty((5, 3))  # rows: 1/t, u >= 0, u <= length, v >= 0, v <= height; as x * col + y * row + 1 * const
        for axis in range(3):  # forward (constant), right (column), down (row)
            n = faces[k, 9] * axes[axis, 0] + faces[k, 10] * axes[axis, 1] + faces[k, 11] * axes[axis, 2]
            u = faces[k, 3] * axes[axis, 0] + faces[k, 4] * axes[axis, 1] + faces[k, 5] * axes[axis, 2]
            v = faces[k, 6] * axes[axis, 0] + faces[k, 7] * axes[axis, 1] + faces[k, 8] * axes[axis, 2]
            at_u = faces[k, 3] * qx + faces[k, 4] * qy + faces[k, 5] * qz
            at_v = faces[k, 6] * qx + faces[k, 7] * qy + faces[k, 8] * qz
            g[0, axis] = n / away
            g[1, axis] = u - at_u * g[0, axis]
            g[2, axis] = (at_u + faces[k, 12]) * g[0, axis] - u
            g[3, axis] = v - at_v * g[0, axis]
            g[4, axis] = (at_v + faces[k, 13]) * g[0, axis] - v
        for i in range(5):
            g[i, 1] /= f
            g[i, 2] /= f
            g[i, 0] -= cx * g[i, 1] + cy * g[i, 2]
        # Whole picture outside one edge: skip (the functions are linear, so the corners tell).
        hidden = False
        for i in range(5):
            best = g[i, 0] + max(0.0, g[i, 1] * (width - 1)) + max(0.0, g[i, 2] * (height - 1))
            if best < 0.0:
                hidden = True
        if hidden:
            continue
        for row in range(height):
            first = 0.0
            last = width - 1.0
            for i in range(5):
                first, last = _limit(g[i, 1], g[i, 0] + g[i, 2] * row, first, last)
            if first > last:
                continue
            start = int(np.ceil(first))
            base = g[0, 0] + g[0, 2] * row
            for column in range(start, int(last) + 1):
                near = base + g[0, 1] * column
                if near > inverse[row, column] and near < 1.0 / NEAR_MM:
                    inverse[row, column] = near
                    ids[row, column] = k


@_jit
def see_cylinders(
    cylinders: Array, first_id: int, c: Array, axes: Array, f: float, cx: float, cy: float, inverse: Array, ids: Any
) -> None:
    """The same for upright cylinders (their sides; nobody looks at them from above)."""
    height, width = inverse.shape
    for k in range(cylinders.shape[0]):
        ox = c[0] - cylinders[k, 0]
        oy = c[1] - cylinders[k, 1]
        radius = cylinders[k, 2]
        depth = -(axes[0, 0] * ox + axes[0, 1] * oy)
        if depth < -radius - 2000.0:
            continue
        constant = ox * ox + oy * oy - radius * radius
        if constant <= 0.0:
            continue
        first, last = 0, width - 1
        if depth > radius + 200.0 and axes[0, 2] == 0.0:
            across = -(axes[1, 0] * ox + axes[1, 1] * oy)
            first = max(
                0, int(cx + f * min((across - radius) / (depth - radius), (across - radius) / (depth + radius))) - 1
            )
            last = min(
                width - 1,
                int(cx + f * max((across + radius) / (depth - radius), (across + radius) / (depth + radius))) + 2,
            )
        for row in range(height):
            py = (row - cy) / f
            for column in range(first, last + 1):
                px = (column - cx) / f
                dx = axes[0, 0] + px * axes[1, 0] + py * axes[2, 0]
                dy = axes[0, 1] + px * axes[1, 1] + py * axes[2, 1]
                a = dx * dx + dy * dy
                b = ox * dx + oy * dy
                root = b * b - a * constant
                if root <= 0.0 or b >= 0.0:
                    continue
                t = (-b - sqrt(root)) / a
                z = c[2] + t * (axes[0, 2] + px * axes[1, 2] + py * axes[2, 2])
                if t > NEAR_MM and cylinders[k, 3] <= z <= cylinders[k, 4] and 1.0 / t > inverse[row, column]:
                    inverse[row, column] = 1.0 / t
                    ids[row, column] = first_id + k


@_jit
def shade(
    faces: Array,
    cylinders: Array,
    lamps: Array,
    c: Array,
    axes: Array,
    f: float,
    cx: float,
    cy: float,
    inverse: Array,
    ids: Any,
    texels: Any,
    offsets: Any,
    texel_mm: float,
    size0: int,
    gain: float,
    vignette: float,
    noise: Any,
    noise_at: int,
    out: Any,
) -> None:
    """Colour each pixel: bilinear texel of the fitting mip level x lamp x vignetting + sensor noise."""
    height, width = inverse.shape
    n_faces = faces.shape[0]
    levels = offsets.shape[0]
    for row in range(height):
        py = (row - cy) / f
        for column in range(width):
            where = (noise_at + (row * width + column) * 3) % (noise.shape[0] - 3)
            k = ids[row, column]
            if k < 0:
                for channel in range(3):
                    out[row, column, channel] = 128 + noise[where + channel]
                continue
            px = (column - cx) / f
            t = 1.0 / inverse[row, column]
            dx = axes[0, 0] + px * axes[1, 0] + py * axes[2, 0]
            dy = axes[0, 1] + px * axes[1, 1] + py * axes[2, 1]
            dz = axes[0, 2] + px * axes[1, 2] + py * axes[2, 2]
            x = c[0] + t * dx
            y = c[1] + t * dy
            z = c[2] + t * dz
            if k < n_faces:
                rx = x - faces[k, 0]
                ry = y - faces[k, 1]
                rz = z - faces[k, 2]
                u = rx * faces[k, 3] + ry * faces[k, 4] + rz * faces[k, 5] + faces[k, 15]
                v = rx * faces[k, 6] + ry * faces[k, 7] + rz * faces[k, 8] + faces[k, 16]
                nx, ny, nz = faces[k, 9], faces[k, 10], faces[k, 11]
                texture = int(faces[k, 14])
                lamp = int(faces[k, 17])
            else:
                j = k - n_faces
                nx = (x - cylinders[j, 0]) / cylinders[j, 2]
                ny = (y - cylinders[j, 1]) / cylinders[j, 2]
                nz = 0.0
                u = np.arctan2(ny, nx) * cylinders[j, 2] + cylinders[j, 6]
                v = z
                texture = int(cylinders[j, 5])
                lamp = int(cylinders[j, 7])
            slant = abs(nx * dx + ny * dy + nz * dz)
            level = 0
            span = t / (f * texel_mm * sqrt(max(slant, 0.04)))
            while span > 1.5 and level < levels - 1:
                span *= 0.5
                level += 1
            size = size0 >> level
            step = texel_mm * (1 << level)
            su = u / step - 0.5
            sv = -v / step - 0.5
            u0 = floor(su)
            v0 = floor(sv)
            fu = su - u0
            fv = sv - v0
            iu = int(u0) & (size - 1)
            iv = int(v0) & (size - 1)
            ju = (iu + 1) & (size - 1)
            jv = (iv + 1) & (size - 1)
            base = offsets[level] + texture * size * size
            p00 = texels[base + iv * size + iu]
            p01 = texels[base + iv * size + ju]
            p10 = texels[base + jv * size + iu]
            p11 = texels[base + jv * size + ju]
            lx = lamps[lamp, 0] - x
            ly = lamps[lamp, 1] - y
            lz = lamps[lamp, 2] - z
            square = lx * lx + ly * ly + lz * lz
            facing = max(0.0, (nx * lx + ny * ly + nz * lz) / sqrt(square))
            light = lamps[lamp, 3] + lamps[lamp, 4] * (0.35 + 0.65 * facing) / (1.0 + square / 1.6e7)
            light *= gain * (1.0 - vignette * (px * px + py * py))
            w00 = (1.0 - fu) * (1.0 - fv) * light
            w01 = fu * (1.0 - fv) * light
            w10 = (1.0 - fu) * fv * light
            w11 = fu * fv * light
            for channel in range(3):
                shift = 8 * channel
                value = (
                    ((p00 >> shift) & 255) * w00
                    + ((p01 >> shift) & 255) * w01
                    + ((p10 >> shift) & 255) * w10
                    + ((p11 >> shift) & 255) * w11
                    + noise[where + channel]
                    + 0.5
                )
                out[row, column, channel] = np.uint8(min(255.0, max(0.0, value)))

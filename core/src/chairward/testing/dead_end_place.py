"""Random dead ends: a pocket off a room, of walls that are segments, which rays and footprints can meet.

Distances mm, angles rad; the pocket lies along +x from its mouth at x = 0.
"""

from __future__ import annotations

from dataclasses import dataclass
from math import cos, inf, radians, sin
from random import Random

import numpy as np
from numpy.typing import NDArray

FRONT_MM, REAR_MM, HALF_MM = 450.0, 450.0, 300.0
MARGIN_MM = 50.0

Segments = NDArray[np.float64]
"""(n, 4): x1, y1, x2, y2."""


@dataclass(frozen=True, slots=True, kw_only=True)
class DeadEnd:
    """walls: everything solid. low: the walls that the camera loses nearer than lost_mm (they are under its view).

    plain_mm: the camera is blind to whatever is nearer than this (no texture); 0: it sees everything.
    behind: walls that appear behind the chair once it was stopped (somebody has put something there).
    """

    walls: Segments
    low: Segments
    lost_mm: float
    plain_mm: float
    behind: Segments
    length_mm: float
    width_mm: float
    start: tuple[float, float, float]


def box(x: float, y: float, half_x: float, half_y: float) -> list[tuple[float, float, float, float]]:
    """Four walls."""
    a, b, c, d = x - half_x, y - half_y, x + half_x, y + half_y
    return [(a, b, c, b), (c, b, c, d), (c, d, a, d), (a, d, a, b)]


def some_dead_end(rng: Random) -> DeadEnd:
    """A pocket of 0.9 to 2.4 m width and 1.2 to 4.5 m length with things in it, off a room of 5 m."""
    width, length = rng.uniform(900, 2_400), rng.uniform(1_200, 4_500)
    slant = rng.uniform(-400, 400)
    w, room = width / 2, 2_500.0
    walls = [
        (0.0, w, length + slant, w),
        (0.0, -w, length - slant, -w),
        (length + slant, w, length - slant, -w),
        (0.0, w, 0.0, room),
        (0.0, -w, 0.0, -room),
        (-2 * room, room, 0.0, room),
        (-2 * room, -room, 0.0, -room),
        (-2 * room, -room, -2 * room, room),
    ]
    if width > 1_500 and rng.random() < 0.6:  # something beside the way in, inside the pocket
        side = rng.choice((-1, 1))
        walls += box(rng.uniform(500, length - 300), side * (w - 150), 150, 150)
    for _ in range(rng.choice((0, 1, 2))):  # furniture in the room, off the way in
        walls += box(rng.uniform(-4_200, -2_400), rng.choice((-1, 1)) * rng.uniform(1_300, 2_000), 250, 250)
    low: list[tuple[float, float, float, float]] = []
    if rng.random() < 0.25:
        low = box(rng.uniform(0.5, 0.9) * length, 0.0, 100, w * 0.8)
    behind = [(0.0, 0.0, 0.0, 0.0)]  # replaced where the chair stops
    return DeadEnd(
        walls=np.array(walls),
        low=np.array(low).reshape(-1, 4),
        lost_mm=rng.uniform(620, 780),
        plain_mm=rng.choice((0.0, 0.0, 0.0, 700.0, 900.0)),
        behind=np.array(behind if rng.random() < 0.05 else []).reshape(-1, 4),
        length_mm=length,
        width_mm=width,
        start=(-1_400.0, rng.uniform(-0.3, 0.3) * max(0.0, w - HALF_MM - MARGIN_MM), radians(rng.uniform(-4, 4))),
    )


def rays(segments: Segments, x: float, y: float, angles: NDArray[np.float64]) -> NDArray[np.float64]:
    """How far each ray from (x, y) goes until it meets a segment, mm; inf where it meets none."""
    if not len(segments):
        return np.full(len(angles), inf)
    dx, dy = np.cos(angles)[:, None], np.sin(angles)[:, None]
    ax, ay = segments[:, 0] - x, segments[:, 1] - y
    ex, ey = segments[:, 2] - segments[:, 0], segments[:, 3] - segments[:, 1]
    cross = dx * ey - dy * ex
    with np.errstate(divide="ignore", invalid="ignore"):
        along = (ax * ey - ay * ex) / cross
        where = (ax * dy - ay * dx) / cross
    hit = (along > 0.0) & (where >= 0.0) & (where <= 1.0)
    return np.asarray(np.where(hit, along, inf).min(axis=1))


def touches(segments: Segments, x: float, y: float, heading: float) -> bool:
    """Whether the footprint meets a wall: clip each segment against the rectangle, in the chair's frame."""
    c, s = cos(heading), sin(heading)
    ends = segments.reshape(-1, 2) - (x, y)
    local = np.stack([ends[:, 0] * c + ends[:, 1] * s, -ends[:, 0] * s + ends[:, 1] * c], axis=1).reshape(-1, 2, 2)
    start, way = local[:, 0], local[:, 1] - local[:, 0]
    low, high = np.array([-REAR_MM, -HALF_MM]), np.array([FRONT_MM, HALF_MM])
    with np.errstate(divide="ignore", invalid="ignore"):
        t1, t2 = (low - start) / way, (high - start) / way
    inside = (start >= low) & (start <= high)
    enter = np.where(way == 0.0, np.where(inside, -inf, inf), np.minimum(t1, t2)).max(axis=1)
    leave = np.where(way == 0.0, np.where(inside, inf, -inf), np.maximum(t1, t2)).min(axis=1)
    return bool(np.any((enter <= leave) & (leave >= 0.0) & (enter <= 1.0)))

"""The chair seen from above among obstacles: what is ahead, how near, and what touches. Pure; millimetres."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from math import cos, hypot, radians, sin, sqrt

from chairward.components import Footprint
from chairward_simulator.home import Obstacle, Point

FAR_MM = 20_000.0

Pose = tuple[float, float, float]
"""x_mm, y_mm, heading_deg of the middle of the axle, in the home."""


def to_chair(point: Point, x_mm: float, y_mm: float, heading_deg: float) -> Point:
    """A point of the home in the chair's frame."""
    c, s = cos(radians(heading_deg)), sin(radians(heading_deg))
    dx, dy = point[0] - x_mm, point[1] - y_mm
    return c * dx + s * dy, c * dy - s * dx


def clip(polygon: Sequence[Point], axis: int, bound: float, *, above: bool) -> list[Point]:
    """The part of a convex polygon on one side of coordinate `axis` == bound (Sutherland and Hodgman 1974)."""
    kept: list[Point] = []
    for a, b in zip(polygon, [*polygon[1:], *polygon[:1]], strict=True):
        da, db = (a[axis] - bound, b[axis] - bound) if above else (bound - a[axis], bound - b[axis])
        if da >= 0:
            kept.append(a)
        if (da > 0 > db) or (da < 0 < db):
            t = da / (da - db)
            kept.append((a[0] + t * (b[0] - a[0]), a[1] + t * (b[1] - a[1])))
    return kept


def _window(obstacle: Obstacle, pose: Pose, x0: float, x1: float, half_width: float) -> float | None:
    """Least x (chair's frame) of what lies in x0..x1, -half_width..half_width; None: nothing there."""
    local = [to_chair(p, *pose) for p in obstacle.points]
    if obstacle.radius_mm > 0:
        cx, cy = local[0]
        off = max(0.0, abs(cy) - half_width)
        if off >= obstacle.radius_mm:
            return None
        reach = sqrt(obstacle.radius_mm**2 - off**2)
        return max(cx - reach, x0) if cx + reach >= x0 and cx - reach <= x1 else None
    for axis, bound, above in ((0, x0, True), (0, x1, False), (1, -half_width, True), (1, half_width, False)):
        local = clip(local, axis, bound, above=above)
        if len(local) < 3:
            return None
    return min(x for x, _ in local)


def ahead(
    obstacles: Iterable[Obstacle], pose: Pose, footprint: Footprint, *, backward: bool = False
) -> tuple[float, str]:
    """(distance from the footprint's front to the nearest thing in the swept way, its name); (FAR_MM, "") for none."""
    nearest, name = FAR_MM, ""
    x, y, heading = pose
    view = (x, y, heading + 180.0) if backward else pose
    edge = footprint.rear_mm if backward else footprint.front_mm
    for obstacle in obstacles:
        found = _window(obstacle, view, edge, edge + FAR_MM, footprint.half_width_mm)
        if found is not None and found - edge < nearest:
            nearest, name = found - edge, obstacle.name
    return nearest, name


def touching(obstacles: Iterable[Obstacle], pose: Pose, footprint: Footprint) -> str:
    """Name of the first thing inside the footprint, or ""."""
    for obstacle in obstacles:
        if _window(obstacle, pose, -footprint.rear_mm, footprint.front_mm, footprint.half_width_mm) is not None:
            return obstacle.name
    return ""


def close_by(obstacles: Iterable[Obstacle], x_mm: float, y_mm: float, within_mm: float) -> list[Obstacle]:
    """Those that may come within `within_mm` of a point (a quick sort-out before the exact questions)."""
    near = []
    for obstacle in obstacles:
        xs, ys = [p[0] for p in obstacle.points], [p[1] for p in obstacle.points]
        dx = max(min(xs) - x_mm, 0.0, x_mm - max(xs))
        dy = max(min(ys) - y_mm, 0.0, y_mm - max(ys))
        if hypot(dx, dy) - obstacle.radius_mm <= within_mm:
            near.append(obstacle)
    return near

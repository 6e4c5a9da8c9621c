"""What is ahead and what touches, against a slow sampling of the same shapes."""

from __future__ import annotations

from math import cos, hypot, radians, sin

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from chairward.components import Footprint
from chairward_simulator.home import Box, Obstacle, corners
from chairward_simulator.nearness import FAR_MM, ahead, close_by, to_chair, touching

CHAIR = Footprint(front_mm=450.0, rear_mm=400.0, half_width_mm=320.0)
places = st.floats(-2500.0, 2500.0)
angles = st.floats(-180.0, 180.0)


def inside(obstacle: Obstacle, x: float, y: float) -> bool:
    if obstacle.radius_mm:
        return hypot(x - obstacle.points[0][0], y - obstacle.points[0][1]) <= obstacle.radius_mm
    pairs = zip(obstacle.points, [*obstacle.points[1:], obstacle.points[0]], strict=True)
    return all((bx - ax) * (y - ay) - (by - ay) * (x - ax) >= 0 for (ax, ay), (bx, by) in pairs)


def sampled(obstacle: Obstacle, pose, x0: float, x1: float) -> float | None:
    """Least x in the chair's frame on a 20 mm grid."""
    c, s = cos(radians(pose[2])), sin(radians(pose[2]))
    for step in range(int((x1 - x0) / 20.0) + 1):
        x = x0 + 20.0 * step
        for side in range(33):
            y = -320.0 + 20.0 * side
            if inside(obstacle, pose[0] + c * x - s * y, pose[1] + s * x + c * y):
                return x
    return None


shapes = st.one_of(
    st.builds(
        lambda x, y, w, d, a: Obstacle(
            "box", corners(Box(name="box", at=(x, y), size=(w, d, 100.0), turned_deg=a, texture="wood"))
        ),
        places,
        places,
        st.floats(60.0, 1500.0),
        st.floats(60.0, 1500.0),
        angles,
    ),
    st.builds(lambda x, y, r: Obstacle("post", ((x, y),), r), places, places, st.floats(40.0, 400.0)),
)


@settings(deadline=None)
@given(shape=shapes, x=places, y=places, heading=angles)
def test_distance_ahead_is_that_of_a_fine_sampling(shape, x, y, heading) -> None:
    pose = (x, y, heading)
    distance, name = ahead([shape], pose, CHAIR)
    slow = sampled(shape, pose, 450.0, 450.0 + 3000.0)
    if slow is not None:
        assert name == shape.name
        assert slow - 450.0 - 3000.0 <= distance <= slow - 450.0 + 1e-6
        assert inside_somewhere_at(shape, pose, distance + 450.0)
    elif distance < 2900.0:
        assert inside_somewhere_at(shape, pose, distance + 450.0)


def inside_somewhere_at(shape: Obstacle, pose, x: float) -> bool:
    """The shape really reaches to x within the swept way."""
    c, s = cos(radians(pose[2])), sin(radians(pose[2]))
    grown = x + 1e-3
    if shape.radius_mm:
        cx, cy = to_chair(shape.points[0], *pose)
        y = max(-320.0, min(320.0, cy))
        return hypot(grown - cx, y - cy) <= shape.radius_mm + 2e-3
    for step in range(4001):
        y = -320.0 + 0.16 * step
        if inside(shape, pose[0] + c * grown - s * y, pose[1] + s * grown + c * y):
            return True
    ends = [to_chair(p, *pose) for p in shape.points]
    return any(abs(px - x) < 2.0 for px, _ in ends) or _on_edge(ends, x)


def _on_edge(ends, x: float) -> bool:
    """A sharp corner or the strip's very edge: narrower than the sampling."""
    for (ax, ay), (bx, by) in zip(ends, [*ends[1:], ends[0]], strict=True):
        for bound in (-320.0, 320.0):
            if (ay - bound) * (by - bound) <= 0.0 and ay != by:
                t = (bound - ay) / (by - ay)
                if abs(ax + t * (bx - ax) - x) < 1.0:
                    return True
    return False


@settings(deadline=None)
@given(shape=shapes, x=places, y=places, heading=angles)
def test_touching_is_never_missed_by_a_sampling(shape, x, y, heading) -> None:
    slow = sampled(shape, (x, y, heading), -400.0, 450.0)
    if slow is not None:
        assert touching([shape], (x, y, heading), CHAIR) == shape.name


def test_behind_is_the_mirror_of_ahead() -> None:
    wall = Obstacle("wall", ((1000.0, -500.0), (1100.0, -500.0), (1100.0, 500.0), (1000.0, 500.0)))
    assert ahead([wall], (0.0, 0.0, 0.0), CHAIR) == (pytest.approx(550.0), "wall")
    assert ahead([wall], (0.0, 0.0, 180.0), CHAIR) == (FAR_MM, "")
    assert ahead([wall], (0.0, 0.0, 180.0), CHAIR, backward=True) == (pytest.approx(600.0), "wall")


@settings(deadline=None)
@given(shape=shapes, x=places, y=places)
def test_the_quick_sorting_out_drops_nothing_near(shape, x, y) -> None:
    if not close_by([shape], x, y, 900.0):
        assert all(not inside(shape, x + dx, y + dy) for dx in (-600, 0, 600) for dy in (-600, 0, 600))

"""Ground plane, view from above, free path and thin things."""

from __future__ import annotations

from math import radians, tan
from types import SimpleNamespace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra import numpy as arrays

from chairward.components import Footprint, Pose
from chairward.messages import NOTHING_NEAR_MM
from chairward.stages import StereoGeometry
from chairward_vision_obstacle.birdseye import CELL_MM, BirdsEye
from chairward_vision_obstacle.cables import thin_things
from chairward_vision_obstacle.ground import make_ground
from chairward_vision_obstacle.heading import HEADINGS_DEG, free_path
from chairward_vision_obstacle.learned import between

FOOTPRINT = Footprint(front_mm=450, rear_mm=450, half_width_mm=300)
GEOMETRY = StereoGeometry(focal_px=300, baseline_mm=50, cx_px=159.5, cy_px=119.5, width_px=320, height_px=240)


@given(st.floats(300, 1200), st.floats(0, 40), st.integers(0, 239))
def test_a_row_lies_on_the_floor_where_its_angle_says(height_mm: float, pitch_deg: float, row: int) -> None:
    pose = Pose(x_mm=450, z_mm=height_mm, pitch_deg=pitch_deg)
    ground = make_ground(GEOMETRY, pose, FOOTPRINT, (320, 240), 0.0)
    angle = radians(pitch_deg) + np.arctan((row - 119.5) / 300)
    if angle > 0.01:
        assert ground.forward_mm[row, 160] == pytest.approx(height_mm / tan(angle), rel=1e-3)
    elif angle < -0.01:
        assert np.isinf(ground.forward_mm[row, 160])


@settings(max_examples=40, deadline=None)
@given(
    st.floats(-10, 10),
    st.floats(5, 30),
    st.floats(-8, 8),
    st.floats(-150, 150),
    st.integers(150, 239),
    st.integers(0, 319),
)
def test_from_above_and_from_the_camera_the_same_place_is_the_same(
    yaw: float, pitch: float, roll: float, left_mm: float, row: int, column: int
) -> None:
    from chairward_vision_obstacle.birdseye import _pixel

    pose = Pose(x_mm=450, y_mm=left_mm, z_mm=600, yaw_deg=yaw, pitch_deg=pitch, roll_deg=roll)
    ground = make_ground(GEOMETRY, pose, FOOTPRINT, (320, 240), 0.0)
    if np.isfinite(ground.forward_mm[row, column]) and ground.forward_mm[row, column] < 5000:
        seen = _pixel(GEOMETRY, pose, float(ground.forward_mm[row, column]), float(ground.left_mm[row, column]))
        assert seen == (pytest.approx(column, abs=0.05), pytest.approx(row, abs=0.05))


def test_a_small_picture_of_the_same_view_says_the_same_places() -> None:
    pose = Pose(x_mm=500, z_mm=700, pitch_deg=15)
    big = make_ground(GEOMETRY, pose, FOOTPRINT, (320, 240), 20.0)
    small = make_ground(GEOMETRY, pose, FOOTPRINT, (160, 120), 20.0)
    assert small.nearest_mm == pytest.approx(big.nearest_mm, rel=0.02)
    assert big.forward_mm[200:202, 160].mean() == pytest.approx(float(small.forward_mm[100, 80]), rel=0.01)
    assert big.offset_mm == 50


def test_a_camera_of_unknown_height_is_refused() -> None:
    with pytest.raises(ValueError, match=r"pose\.z_mm"):
        make_ground(GEOMETRY, Pose(), FOOTPRINT, (320, 240), 0.0)


@pytest.mark.parametrize("step_mm", [-60, -20, 0, 15, 33, 60])
def test_driving_is_measured_by_how_the_floor_moves(worlds: SimpleNamespace, step_mm: int) -> None:
    world = worlds.World()
    above = BirdsEye(worlds.geometry, worlds.pose, 935.0, 380.0)
    everywhere = np.ones((above.rows, above.columns), np.bool_)
    found = []
    for number in range(7):
        image = world.see(float(number * step_mm)).get(_pair()).left
        found.append(above.shift(above.look(image), everywhere))
    assert found[0] is None
    assert np.median([s.forward_mm for s in found[1:] if s]) == pytest.approx(step_mm, abs=8)
    assert np.median([s.left_mm for s in found[1:] if s]) == pytest.approx(0, abs=8)


def test_a_plain_floor_does_not_say_how_it_moves(worlds: SimpleNamespace) -> None:
    world = worlds.World(pattern=0.0)
    above = BirdsEye(worlds.geometry, worlds.pose, 935.0, 380.0)
    everywhere = np.ones((above.rows, above.columns), np.bool_)
    assert [above.shift(above.look(world.see(33.0 * n).get(_pair()).left), everywhere) for n in range(4)] == [None] * 4


def _pair() -> type:
    from chairward.stages import RectifiedPair

    return RectifiedPair


points = st.lists(st.tuples(st.floats(0, 3999), st.floats(-3000, 3000)), max_size=12)


def slow_free(where: list[tuple[float, float]], heading_deg: int, half_width_mm: float) -> float:
    best = float(NOTHING_NEAR_MM)
    c, s = np.cos(np.radians(heading_deg)), np.sin(np.radians(heading_deg))
    for x, y in where:
        along, across = c * x + s * y, c * y - s * x
        if along >= 0 and abs(across) <= half_width_mm and along < 4000:
            best = min(best, along)
    return best


@given(points)
def test_each_heading_is_free_up_to_the_first_thing_in_its_way(where: list[tuple[float, float]]) -> None:
    found = free_path([x for x, _ in where], [y for _, y in where], 320.0)
    for heading, free in zip(HEADINGS_DEG, found.free_mm, strict=True):
        assert free == int(slow_free(where, heading, 320.0))
    assert found.free_mm[HEADINGS_DEG.index(found.best_deg)] >= 0.95 * max(found.free_mm)
    assert found.left_mm == max(f for d, f in zip(HEADINGS_DEG, found.free_mm, strict=True) if d >= 15)


@given(points)
def test_a_mirrored_room_has_the_mirrored_sides(where: list[tuple[float, float]]) -> None:
    one = free_path([x for x, _ in where], [y for _, y in where], 320.0)
    other = free_path([x for x, _ in where], [-y for _, y in where], 320.0)
    assert (one.left_mm, one.right_mm) == (other.right_mm, other.left_mm)


@given(arrays.arrays(np.bool_, (4, 12)), arrays.arrays(np.bool_, (4, 12)))
def test_only_what_lies_between_two_floor_pixels_without_a_raised_one_is_filled(
    flat: np.ndarray, raised: np.ndarray
) -> None:
    raised = raised & ~flat
    got = between(flat, raised)
    for row in range(4):
        for column in range(12):
            left = [c for c in range(column, -1, -1) if flat[row, c] or raised[row, c]]
            right = [c for c in range(column, 12) if flat[row, c] or raised[row, c]]
            filled = bool(left and right and flat[row, left[0]] and flat[row, right[0]])
            assert got[row, column] == (flat[row, column] or filled)


def grid(level: int = 120, noise: float = 2.0) -> np.ndarray:
    rng = np.random.default_rng(1)
    return np.clip(rng.normal(level, noise, (60, 76)), 0, 255).astype(np.uint8)


EVERYWHERE = np.ones((60, 76), np.bool_)


@pytest.mark.parametrize("level", [20, 230])
def test_a_line_across_the_way_is_a_thin_thing(level: int) -> None:
    grey = grid()
    grey[30:32, 5:70] = level
    found = thin_things(grey, EVERYWHERE)
    assert found[29:33, 10:65].any(axis=0).mean() > 0.9
    assert not found[:26].any()
    assert not found[36:].any()


def test_lines_along_the_way_short_ones_wide_ones_and_patterns_are_not() -> None:
    along, short, wide, pattern = grid(), grid(), grid(), grid()
    along[:, 30:32] = 20
    short[30:32, 30 : 30 + int(200 / CELL_MM)] = 20
    wide[20:32, :] = 20
    pattern[::8] = 20
    for grey in (along, short, wide, pattern, grid(noise=12)):
        assert not thin_things(grey, EVERYWHERE).any()


def test_nothing_is_looked_for_where_things_stand_up() -> None:
    grey = grid()
    grey[30:32, 5:70] = 20
    floor = EVERYWHERE.copy()
    floor[20:40] = False
    assert not thin_things(grey, floor).any()

"""The renderer: depth is exact, the pair obeys the disparity law, every picture is reproducible and quick."""

from __future__ import annotations

from dataclasses import replace
from math import hypot, inf, sqrt
from time import process_time

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st

from chairward.components import Pose
from chairward_simulator import scene, textures
from chairward_simulator.home import PERSON_RADIUS_MM, Home, obstacles, wall_as_box
from chairward_simulator.nearness import touching
from chairward_simulator.render import NEAR_MM

POSE = Pose(x_mm=450.0, z_mm=400.0)


def cast(home: Home, people, at, ray) -> float:
    """Slow, obvious: the least t > 0 at which at + t * ray meets anything (slabs and quadratics, one ray at a time)."""
    best = inf
    for box in [*home.box, *(wall_as_box(wall, home.ceiling_mm) for wall in home.wall)]:
        turn = np.radians(box.turned_deg)
        c, s = np.cos(turn), np.sin(turn)
        o = np.array([at[0] - box.at[0], at[1] - box.at[1], at[2] - box.bottom])
        low = np.array([-box.size[0] / 2, -box.size[1] / 2, 0.0])
        high = np.array([box.size[0] / 2, box.size[1] / 2, box.size[2]])
        o = np.array([c * o[0] + s * o[1], c * o[1] - s * o[0], o[2]])
        d = np.array([c * ray[0] + s * ray[1], c * ray[1] - s * ray[0], ray[2]])
        first, last = -inf, inf
        for axis in range(3):
            if abs(d[axis]) < 1e-12:
                if not low[axis] <= o[axis] <= high[axis]:
                    last = -inf
                continue
            a, b = sorted(((low[axis] - o[axis]) / d[axis], (high[axis] - o[axis]) / d[axis]))
            first, last = max(first, a), min(last, b)
        if 0.0 < first <= last:
            best = min(best, first)
    for floor in home.floor:
        for z, down in ((floor.z, True), (home.ceiling_mm, False)):
            if ray[2] != 0.0 and (ray[2] < 0.0) == down:
                t = (z - at[2]) / ray[2]
                x, y = at[0] + t * ray[0], at[1] + t * ray[1]
                if t > 0.0 and floor.x[0] <= x <= floor.x[1] and floor.y[0] <= y <= floor.y[1]:
                    best = min(best, t)
    cylinders = [(*c.at, c.radius, c.bottom, c.bottom + c.height) for c in home.cylinder]
    for x, y, radius, bottom, top in [*cylinders, *(tuple(row[:5]) for row in people)]:
        ox, oy = at[0] - x, at[1] - y
        a, b, q = ray[0] ** 2 + ray[1] ** 2, ox * ray[0] + oy * ray[1], ox * ox + oy * oy - radius * radius
        if q > 0.0 and b < 0.0 and b * b > a * q:
            t = (-b - sqrt(b * b - a * q)) / a
            if bottom <= at[2] + t * ray[2] <= top:
                best = min(best, t)
    return best


def rays_of(camera: scene.StereoCamera, pose: Pose, x: float, y: float, heading: float):
    axes = scene.axes_of(heading, pose)
    turn = np.radians(heading)
    at = np.array(
        [
            x + np.cos(turn) * pose.x_mm - np.sin(turn) * pose.y_mm,
            y + np.sin(turn) * pose.x_mm + np.cos(turn) * pose.y_mm,
            pose.z_mm,
        ]
    )
    g = camera.geometry
    return (
        at,
        lambda row, column: (
            axes[0] + (column - g.cx_px) / g.focal_px * axes[1] + (row - g.cy_px) / g.focal_px * axes[2]
        ),
    )


@settings(max_examples=25, deadline=None)
@given(
    x=st.floats(1200.0, 8000.0),
    y=st.floats(2000.0, 2500.0),
    heading=st.floats(-180.0, 180.0),
    pitch=st.floats(-5.0, 30.0),
    roll=st.floats(-5.0, 5.0),
    seed=st.integers(0, 2**16),
)
def test_depth_of_any_pixel_from_any_pose_is_the_analytic_ray(home, x, y, heading, pitch, roll, seed) -> None:
    pose = replace(POSE, pitch_deg=pitch, roll_deg=roll)
    camera = CAMERA
    camera.pose = pose
    person = scene.person_cylinders(camera.scene, 7000.0, 2250.0, 90.0, 100.0)
    depth, _, _ = camera.truth(x, y, heading, [person])
    at, ray = rays_of(camera, pose, x, y, heading)
    assume(hypot(at[0] - 7000.0, at[1] - 2250.0) > 400.0)  # nobody stands inside the lens
    rng = np.random.default_rng(seed)
    for row, column in zip(rng.integers(0, 240, 40), rng.integers(0, 320, 40), strict=True):
        expected = cast(home, person, at, ray(row, column))
        if expected < 2.0 * NEAR_MM:
            continue  # the lens is at the wall: nearer than the renderer draws, and than any chair's feet let it come
        if abs(depth[row, column] - expected) > 1e-6 * expected:  # on an edge either side is right
            near = [cast(home, person, at, ray(row + dr, column + dc)) for dr in (-1e-6, 1e-6) for dc in (-1e-6, 1e-6)]
            assert min(near) - 1e-3 <= depth[row, column] <= max(near) + 1e-3


@pytest.fixture(scope="module", autouse=True)
def _camera(home):
    global CAMERA
    CAMERA = scene.StereoCamera(home, POSE, noise=0.0)
    return CAMERA


def test_no_ray_leaves_the_home_from_wherever_the_chair_can_be(home, footprint) -> None:
    rng = np.random.default_rng(3)
    CAMERA.pose = POSE
    things = obstacles(home)
    poses = [(rng.uniform(600, 8200), rng.uniform(1300, 3000), rng.uniform(-180, 180)) for _ in range(60)]
    free = [pose for pose in poses if not touching(things, pose, footprint)]
    assert len(free) > 20
    for x, y, heading in free:
        depth, _, _ = CAMERA.truth(x, y, heading)
        assert np.isfinite(depth).all(), (x, y, heading)


@pytest.mark.parametrize("pose", [(2806.0, 2256.0, 0.0), (7680.0, 2256.0, 35.0), (8200.0, 2250.0, 0.0)])
def test_right_picture_is_the_left_one_shifted_by_focal_length_times_baseline_over_depth(pose) -> None:
    CAMERA.pose = POSE
    left, right = CAMERA.pair(*pose)
    depth, _, _ = CAMERA.truth(*pose)
    rows, columns = np.mgrid[0:240, 80:310]
    shifted = columns - 15_000.0 / depth[rows, columns]
    low = np.floor(shifted).astype(int)
    share = (shifted - low)[..., None]
    matched = right[rows, low] * (1.0 - share) + right[rows, low + 1] * share
    here = left[rows, columns].astype(float)
    good = np.abs(matched - here).mean()
    wrong = np.abs(right[rows, low - 4].astype(float) - here).mean()
    assert good < 4.0
    assert wrong > 2.0 * good


def test_same_pose_same_picture_and_noise_only_where_asked(home) -> None:
    first = scene.StereoCamera(home, POSE, noise=2.0, seed=5).pair(2000.0, 2000.0, 10.0)
    again = scene.StereoCamera(home, POSE, noise=2.0, seed=5).pair(2000.0, 2000.0, 10.0)
    other = scene.StereoCamera(home, POSE, noise=2.0, seed=6).pair(2000.0, 2000.0, 10.0)
    assert np.array_equal(first, again)
    difference = np.array(first, dtype=float) - np.array(other, dtype=float)
    assert 1.5 < difference.std() / sqrt(2.0) < 2.5


def test_walls_have_structure_at_every_distance_and_the_plain_one_has_none() -> None:
    CAMERA.pose = POSE

    def contrast(x: float, y: float, heading: float) -> float:
        grey = CAMERA.pair(x, y, heading)[0][60:180].astype(float).mean(axis=2)
        blocks = grey.reshape(12, 10, 32, 10).std(axis=(1, 3))
        return float(np.median(blocks))

    assert contrast(2450.0, 2400.0, 90.0) < 1.0  # plain wall, 1.6 m
    assert contrast(1800.0, 2000.0, 180.0) > 4.0  # wallpaper, 1.4 m
    assert contrast(4200.0, 2800.0, 180.0) > 4.0  # the same, 3.8 m
    assert contrast(7680.0, 2256.0, 32.0) > 4.0  # corner wall, 1.3 m


def test_step_down_is_deeper_than_the_floor_around_it(home) -> None:
    CAMERA.pose = POSE
    depth, things, names = CAMERA.truth(7000.0, 2200.0, -90.0)
    pit = things == names.index("step down")
    assert pit.sum() > 500
    level = 300.0 * 400.0 / (np.arange(240)[:, None] - 119.5) + np.zeros((1, 320))
    below = (np.arange(240)[:, None] > 130) & pit
    assert (depth[below] > level[below] + 10.0).all()
    assert np.max(depth[below] / level[below]) == pytest.approx(560.0 / 400.0, abs=1e-6)


def test_a_person_in_the_way_is_seen_at_the_true_depth() -> None:
    CAMERA.pose = POSE
    person = scene.person_cylinders(CAMERA.scene, 3000.0, 2000.0, 90.0, 0.0)
    depth, things, names = CAMERA.truth(1000.0, 2000.0, 0.0, [person])
    assert things[119, 160] == names.index("person")
    assert depth[119, 160] == pytest.approx(3000.0 - PERSON_RADIUS_MM - 1450.0, abs=0.5)


def test_a_pair_is_far_quicker_than_camera_rate() -> None:
    CAMERA.pose = POSE
    people = [scene.person_cylinders(CAMERA.scene, 7000.0, 2250.0, 90.0, 0.0)]
    CAMERA.pair(4300.0, 2250.0, 0.0, people)
    spent = []
    for _ in range(15):
        begin = process_time()
        CAMERA.pair(4300.0, 2250.0, 0.0, people)
        spent.append(process_time() - begin)
    assert np.median(spent) < 0.033  # half a core at 15 a second; measured 9 ms


def test_textures_are_seamless_and_never_clipped() -> None:
    for name, make in textures.MAKERS.items():
        image = make()
        assert image.shape == (textures.SIZE, textures.SIZE, 3), name
        assert image.min() >= 2.0, name
        assert image.max() <= 250.0, name
    with pytest.raises(KeyError, match="no texture is named 'velvet'"):
        textures.index_of("velvet")

"""Where pixels look: the floor law, scaling, mount from the floor, the search range."""

from __future__ import annotations

from math import cos, radians, sin
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from chairward.components import Footprint, Pose
from chairward.stages import StereoGeometry
from chairward_stereo_range.floor import fit_floor
from chairward_stereo_range.geometry import disparity_range, make_view, scaled, working_size
from chairward_stereo_range.matching import whole_frame_disparity
from chairward_stereo_range.mount import estimate_mount

FOOT = Footprint(front_mm=400.0, rear_mm=500.0, half_width_mm=320.0)


def rig(doffs: float = 0.0) -> StereoGeometry:
    return StereoGeometry(
        focal_px=300.0, baseline_mm=50.0, cx_px=159.5, cy_px=119.5, width_px=320, height_px=240, doffs_px=doffs
    )


@settings(max_examples=40, deadline=None)
@given(
    z=st.floats(250, 1200),
    pitch=st.floats(-5, 30),
    ahead=st.floats(600, 3000),
    left=st.floats(-800, 800),
    doffs=st.floats(-10, 20),
)
def test_a_floor_point_has_the_disparity_of_the_floor_law(
    z: float, pitch: float, ahead: float, left: float, doffs: float
) -> None:
    view = make_view(rig(doffs), Pose(x_mm=300.0, z_mm=z, pitch_deg=pitch), FOOT)
    p = radians(pitch)
    depth, down = ahead * cos(p) + z * sin(p), z * cos(p) - ahead * sin(p)
    row, col = 119.5 + 300 * down / depth, 159.5 - 300 * left / depth
    if not (1 < row < 238 and 1 < col < 318):
        return
    r, c = round(row), round(col)
    by_law = 300 * 50 / depth - doffs
    slope = 50 / z
    assert view.d_floor[r, c] == pytest.approx(by_law, abs=slope * 0.6 + 1e-3)
    found = float(view.depth_mm(by_law))
    assert found * view.forward[r, c] == pytest.approx(ahead, rel=0.02)
    assert found * view.left[r, c] == pytest.approx(left, abs=0.02 * depth)


def test_a_camera_at_the_front_edge_measures_from_the_footprint() -> None:
    assert make_view(rig(), Pose(x_mm=400.0, z_mm=400.0), FOOT).ahead_offset_mm() == 0.0
    assert make_view(rig(), Pose(x_mm=250.0, z_mm=400.0), FOOT).ahead_offset_mm() == -150.0


@settings(max_examples=40, deadline=None)
@given(k=st.sampled_from([0.5, 2.0, 3.0]), d=st.floats(1, 60), doffs=st.floats(0, 30))
def test_scaling_pictures_keeps_depths(k: float, d: float, doffs: float) -> None:
    small = rig(doffs)
    large = scaled(small, int(320 * k), int(240 * k))
    near = make_view(small, Pose(), FOOT).depth_mm(d)
    assert make_view(large, Pose(), FOOT).depth_mm(d * k) == pytest.approx(near, rel=1e-5)


def test_working_pictures_keep_the_aspect_and_are_even() -> None:
    assert working_size(640, 480, 240) == (320, 240)
    assert working_size(707, 481, 240)[1] == 240
    assert working_size(707, 481, 240)[0] % 2 == 0


@settings(max_examples=60, deadline=None)
@given(focal=st.floats(200, 800), baseline=st.floats(30, 120), doffs=st.floats(0, 40), nearest=st.floats(200, 500))
def test_the_search_reaches_the_nearest_depth(focal: float, baseline: float, doffs: float, nearest: float) -> None:
    g = StereoGeometry(
        focal_px=focal, baseline_mm=baseline, cx_px=320, cy_px=240, width_px=640, height_px=480, doffs_px=doffs
    )
    first, count = disparity_range(g, nearest)
    assert count % 16 == 0
    assert first <= -doffs + 1e-9
    assert first + count >= min(focal * baseline / nearest - doffs, first + 0.4 * 640) - 1e-6


def test_the_floor_fit_finds_a_tilt_and_never_follows_a_wall() -> None:
    nominal = np.tile(np.linspace(4, 14, 50, dtype=np.float32)[:, None], (1, 100))
    rng = np.random.default_rng(0)
    tilted = (nominal * 1.03 + 0.3 + rng.normal(0, 0.1, nominal.shape)).astype(np.float32)
    assert np.abs(fit_floor(tilted, nominal, 1.0).apply(nominal) - tilted).mean() < 0.15
    wall = np.full_like(nominal, 12.0)
    fitted = fit_floor(wall, nominal, 1.0).apply(nominal)
    assert np.abs(fitted - nominal).max() < 1.5


@pytest.mark.parametrize(("z", "pitch"), [(400.0, 0.0), (700.0, 15.0), (550.0, 8.0)])
def test_the_mount_is_found_from_the_floor(tools: Any, z: float, pitch: float) -> None:
    pose = Pose(z_mm=z, pitch_deg=pitch)
    box = tools.board(1800.0, left_mm=300.0, right_mm=-100.0, top_mm=500.0)
    left, right = tools.render(tools.room((box,)), pose=pose)
    found = estimate_mount([whole_frame_disparity(left, right, tools.geometry())], tools.geometry())
    assert found is not None
    assert found.z_mm == pytest.approx(z, rel=0.03)
    assert found.pitch_deg == pytest.approx(pitch, abs=0.7)
    assert found.roll_deg == pytest.approx(0.0, abs=0.5)


def test_a_wall_alone_is_no_floor(tools: Any) -> None:
    left, right = tools.render(tools.room((tools.board(600.0),)))
    assert estimate_mount([whole_frame_disparity(left, right, tools.geometry())], tools.geometry()) is None

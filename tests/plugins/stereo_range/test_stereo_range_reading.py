"""Readings on rendered rooms with exact truth: distance, floor, sides, drops, doorway, other rigs."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from chairward_stereo_range.drops import DropWatch

PEERS = ["pyramid", "zncc", "ncc", "sad", "ssd", "bm", "sgbm", "sgbm_3way", "sgbm_hh"]


@pytest.mark.parametrize("distance", [350.0, 450.0, 600.0, 830.0, 1300.0])
@pytest.mark.parametrize("mount", ["a", "b"])
def test_a_textured_wall_is_read_to_two_per_cent(tools: Any, distance: float, mount: str) -> None:
    pose = tools.mount_a if mount == "a" else tools.mount_b
    left, right = tools.render(tools.room((tools.board(distance),)), pose=pose)
    found = tools.finder(pose).measure(left, right)
    assert found.can_see, found.reason
    assert found.ahead is not None
    assert found.ahead.ahead_mm == pytest.approx(distance, rel=0.02)


@pytest.mark.parametrize("distance", [600.0, 830.0, 1000.0, 1300.0])
def test_a_flat_wall_is_read_without_bias(tools: Any, distance: float) -> None:
    """Within 0.06 px: the near side of what has none is noise."""
    left, right = tools.render(tools.room((tools.board(distance),)))
    found = tools.finder(region="trapezoid").measure(left, right)
    assert found.ahead is not None
    assert abs(15_000 / found.ahead.depth_mm - 15_000 / distance) <= 0.06


@pytest.mark.parametrize("method", PEERS)
def test_every_method_reads_a_textured_wall(tools: Any, method: str) -> None:
    left, right = tools.render(tools.room((tools.board(800.0),)))
    found = tools.finder(method=method).measure(left, right)
    assert found.ahead is not None
    assert found.ahead.ahead_mm == pytest.approx(800.0, rel=0.03)


@pytest.mark.parametrize("mount", ["a", "b"])
def test_an_empty_floor_is_clear_and_seen(tools: Any, mount: str) -> None:
    pose = tools.mount_a if mount == "a" else tools.mount_b
    left, right = tools.render(tools.room(), pose=pose)
    found = tools.finder(pose).measure(left, right)
    assert found.can_see, found.reason
    assert found.ahead is None
    assert found.drop is None
    rows = np.nonzero(found.floor)[0]
    assert rows.size > 5000
    assert rows.min() >= tools.finder(pose).horizon_row
    assert (found.floor & found.obstacle).sum() == 0


def test_disparities_of_a_wall_are_right_to_a_tenth_of_a_pixel(tools: Any) -> None:
    for distance in (600.0, 830.0, 1300.0):
        left, right = tools.render(tools.room((tools.board(distance),)))
        disparity = tools.finder(region="trapezoid").measure(left, right).disparity[130:200, 60:260]
        errors = np.abs(disparity - 15000.0 / distance)[np.isfinite(disparity)]
        assert errors.size > 0.5 * disparity.size
        assert np.median(errors) < 0.1
        assert np.mean(errors > 1.0) < 0.01


def test_a_box_counts_when_it_stands_in_the_way_and_not_beside_it(tools: Any) -> None:
    in_the_way = tools.board(700.0, left_mm=100.0, right_mm=-150.0, top_mm=700.0)
    beside = tools.board(700.0, left_mm=-360.0, right_mm=-600.0, top_mm=700.0)
    finder = tools.finder()
    ahead = finder.measure(*tools.render(tools.room((in_the_way,)))).ahead
    assert ahead is not None
    assert ahead.ahead_mm == pytest.approx(700.0, rel=0.02)
    found = finder.measure(*tools.render(tools.room((beside,))))
    assert found.ahead is None
    assert found.can_see


def test_a_doorway_of_81_cm_is_passed_without_a_stop(tools: Any) -> None:
    finder = tools.finder()
    for gap in range(1600, 300, -100):
        posts = (tools.board(float(gap), 1500.0, 405.0), tools.board(float(gap), -405.0, -1500.0))
        found = finder.measure(*tools.render(tools.room(posts)))
        assert found.can_see, f"{gap} mm before the door: {found.reason}"
        assert found.ahead is None or found.ahead.ahead_mm > 1500.0, f"{gap} mm before the door: {found.ahead}"


def test_the_freer_side_is_told(tools: Any) -> None:
    cupboard = tools.board(800.0, left_mm=900.0, right_mm=200.0)
    found = tools.finder().measure(*tools.render(tools.room((cupboard,))))
    assert found.left is not None
    assert found.left.ahead_mm == pytest.approx(800.0, rel=0.05)
    assert found.right is None or found.right.ahead_mm > 1200.0
    assert found.sides_seen == (True, True)


@pytest.mark.parametrize("mount", ["a", "b"])
def test_a_missing_floor_is_a_drop_where_it_ends(tools: Any, mount: str) -> None:
    pose = tools.mount_a if mount == "a" else tools.mount_b
    for edge in (1500.0, 1700.0):
        left, right = tools.render(tools.room(floor_to_mm=edge, floor_below_mm=600.0), pose=pose)
        found = tools.finder(pose).measure(left, right)
        assert found.drop is not None
        assert found.drop.ahead_mm == pytest.approx(edge, rel=0.12)


def seen_below_a_plain_floor(tools: Any, edge_mm: float, what: str) -> float | None:
    """Where the floor's end is found when the floor is too plain to be measured and beyond it lies what is named."""
    view = tools.finder(tools.mount_a).view
    grid = (slice(0, 240, 2), slice(0, 320, 2))
    line = view.d_floor[grid]
    disparity = {
        "lower floor": line * 0.6,
        "mirrored wall": np.full_like(line, view.fb / 4000.0),
        "ceiling": line * 0.15,
    }
    beyond = (line > 0) & (line < view.fb / edge_mm)
    seen = np.where(beyond, disparity[what], np.nan).astype(np.float32)
    found = DropWatch(view, grid, 320.0, 1.0).edge_mm(np.zeros_like(beyond), beyond, seen, line)
    return None if found is None else found[0]


@given(edge_mm=st.floats(1250, 1600))
def test_a_lower_floor_beyond_a_plain_one_is_a_drop(tools: Any, edge_mm: float) -> None:
    assert seen_below_a_plain_floor(tools, edge_mm, "lower floor") == pytest.approx(edge_mm, rel=0.06)


@pytest.mark.parametrize("what", ["mirrored wall", "ceiling"])
def test_what_a_plain_glossy_floor_mirrors_is_no_drop(tools: Any, what: str) -> None:
    assert seen_below_a_plain_floor(tools, 1500.0, what) is None


def test_a_floor_that_lies_too_low_from_the_chair_on_is_a_wrong_mount_and_no_drop(tools: Any) -> None:
    assert seen_below_a_plain_floor(tools, 1.0, "lower floor") is None


def test_a_table_top_in_the_view_counts_though_the_floor_below_it_is_free(tools: Any) -> None:
    table = tools.board(900.0, left_mm=400.0, right_mm=-400.0, bottom_mm=450.0, top_mm=620.0)
    found = tools.finder().measure(*tools.render(tools.room((table,))))
    assert found.ahead is not None
    assert found.ahead.ahead_mm == pytest.approx(900.0, rel=0.05)


@pytest.mark.parametrize(
    ("width", "height", "focal", "baseline"),
    [(640, 480, 600.0, 60.0), (320, 240, 283.0, 92.0), (450, 240, 500.0, 120.0)],
)
def test_other_sizes_focal_lengths_and_baselines_work(
    tools: Any, width: int, height: int, focal: float, baseline: float
) -> None:
    geometry = tools.geometry(width, height, focal, baseline)
    left, right = tools.render(tools.room((tools.board(700.0),)), geometry)
    found = tools.finder(geometry=geometry).measure(left, right)
    assert found.ahead is not None
    assert found.ahead.ahead_mm == pytest.approx(700.0, rel=0.02)


def test_a_standing_scene_is_read_steadily_through_noise(tools: Any) -> None:
    finder = tools.finder()
    box = tools.board(650.0, left_mm=150.0, right_mm=-150.0, top_mm=600.0)
    readings = []
    for seed in range(8):
        ahead = finder.measure(*tools.render(tools.room((box,), seed=seed, noise=3.0))).ahead
        assert ahead is not None
        readings.append(ahead.ahead_mm)
    assert max(readings) - min(readings) < 25.0


def test_a_thing_of_which_little_stands_in_the_region_counts_by_its_whole_size(tools: Any) -> None:
    """A shelf whose lower edge reaches one row into the region, 450 mm ahead; a scrap of that size does not count."""
    shelf = tools.board(450.0, bottom_mm=398.0, top_mm=600.0)
    scrap = tools.board(450.0, left_mm=12.0, right_mm=-12.0, bottom_mm=390.0, top_mm=410.0)
    finder = tools.finder(region="trapezoid")
    found = finder.measure(*tools.render(tools.room((shelf,))))
    assert found.ahead is not None
    assert found.ahead.depth_mm == pytest.approx(450.0, rel=0.03)
    assert finder.measure(*tools.render(tools.room((scrap,)))).ahead is None

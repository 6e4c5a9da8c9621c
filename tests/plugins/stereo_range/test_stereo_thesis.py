"""The thesis' stereo, held against loops that say literally what the thesis says (section 4)."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from chairward_stereo_range import thesis
from chairward_stereo_range.geometry import thesis_trapezoid


def loop(left: Any, right: Any, mask: Any, limit: int, half: int = 4) -> Any:
    """Right is the template, left is scanned at +d, ties take the smaller d."""
    h, w = left.shape
    out = np.zeros((h, w), np.uint8)
    a, b = left.astype(float), right.astype(float)
    for y, x in zip(*np.nonzero(mask), strict=True):
        if y < half or y >= h - half or x < half or x >= w - half:
            continue
        template = b[y - half : y + half + 1, x - half : x + half + 1]
        best = -1.0
        for d in range(limit + 1):
            if x + d + half >= w:
                break
            window = a[y - half : y + half + 1, x + d - half : x + d + half + 1]
            score = (template * window).sum() / np.sqrt((template**2).sum() * (window**2).sum() + 1e-12)
            if score > best + 1e-12:
                best, out[y, x] = score, d
    return out


@settings(max_examples=8, deadline=None)
@given(seed=st.integers(0, 10_000), shift=st.integers(0, 9))
def test_fast_ncc_is_the_loop_of_the_thesis(seed: int, shift: int) -> None:
    rng = np.random.default_rng(seed)
    left = rng.integers(1, 255, (22, 48), dtype=np.uint8)
    right = np.roll(left, -shift, axis=1)
    mask = rng.random((22, 48)) < 0.7
    assert np.array_equal(thesis.ncc_disparity(left, right, mask, 12), loop(left, right, mask, 12))


def test_constant_pictures_tie_and_take_the_smallest_disparity() -> None:
    flat = np.full((20, 60), 90, np.uint8)
    assert not thesis.ncc_disparity(flat, flat, np.ones(flat.shape, bool), 25).any()


def test_the_nearest_needs_more_than_75_pixels() -> None:
    d = np.zeros((40, 40), np.uint8)
    d.flat[:75] = 20
    d.flat[100:190] = 9
    assert thesis.nearest_disparity(d) == 9
    d.flat[75] = 20
    assert thesis.nearest_disparity(d) == 20
    assert thesis.nearest_disparity(np.zeros((40, 40), np.uint8)) == 0


@pytest.mark.parametrize(("d", "shown"), [(25, 600), (20, 750), (18, 833), (15, 1000), (8, 1875), (6, 2500), (0, 5000)])
def test_the_distances_of_the_thesis_come_from_its_grid(d: int, shown: int) -> None:
    assert round(thesis.distance_mm(d, 300.0, 50.0)) == shown


def test_the_navigation_region_is_the_thesis_trapezoid() -> None:
    mask = thesis_trapezoid(320, 240)
    assert not mask[:120].any()
    assert not mask[210:].any()
    for row in range(120, 210):
        k = row - 120
        assert np.array_equal(np.nonzero(mask[row])[0], np.arange(100 - k, 200 + k))


@pytest.mark.parametrize("method", ["thesis_code", "thesis_text"])
def test_thesis_methods_read_a_wall_within_their_grid_and_use_the_mask(tools: Any, method: str) -> None:
    left, right = tools.render(tools.room((tools.board(750.0),)))
    finder = tools.finder(method=method, region="trapezoid")
    found = finder.measure(left, right)
    assert found.ahead is not None
    assert found.ahead.depth_mm == pytest.approx(750.0, abs=1.0)
    assert finder.measure(left, right, np.zeros((240, 320), bool)).ahead is None


def test_thesis_code_cannot_report_less_than_600_mm(tools: Any) -> None:
    left, right = tools.render(tools.room((tools.board(450.0),)))
    found = tools.finder(method="thesis_code", region="trapezoid").measure(left, right)
    assert found.ahead is None or found.ahead.depth_mm >= 600.0

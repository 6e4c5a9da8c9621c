"""Block matching against loops that compute each measure from its definition."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from chairward_stereo_range.matching import BLOCK_METHODS, block_match, cost_volume, make_matcher
from chairward_stereo_range.pyramid import bridged, islands, mean_of_four
from chairward_stereo_range.texture import noise_sigma, periodic, textured

HALF = 2


def cost(a: Any, b: Any, measure: str) -> float:
    a, b = a.astype(float), b.astype(float)
    if measure == "sad":
        return float(np.abs(a - b).mean())
    if measure == "ssd":
        return float(((a - b) ** 2).mean())
    if measure == "zncc":
        a, b = a - a.mean(), b - b.mean()
    return 1.0 - float((a * b).sum() / np.sqrt((a * a).sum() * (b * b).sum()))


@pytest.mark.parametrize("measure", BLOCK_METHODS)
def test_cost_volumes_are_the_measures_by_definition(measure: str) -> None:
    rng = np.random.default_rng(3)
    left, right = (rng.integers(0, 255, (11, 24), dtype=np.uint8) for _ in range(2))
    volume = cost_volume(left, right, measure, -2, 8, HALF)
    for i in range(8):
        d = i - 2
        for y in range(HALF, 11 - HALF):
            for x in range(HALF, 24 - HALF):
                if not HALF <= x - d < 24 - HALF:
                    assert np.isinf(volume[i, y, x])
                    continue
                a = left[y - HALF : y + HALF + 1, x - HALF : x + HALF + 1]
                b = right[y - HALF : y + HALF + 1, x - d - HALF : x - d + HALF + 1]
                assert volume[i, y, x] == pytest.approx(cost(a, b, measure), rel=2e-3, abs=2e-3)


@pytest.mark.parametrize("measure", BLOCK_METHODS)
@pytest.mark.parametrize("shift", [3, 7])
def test_block_matching_finds_a_known_shift(measure: str, shift: int) -> None:
    rng = np.random.default_rng(5)
    left = rng.integers(20, 235, (40, 90), dtype=np.uint8)
    right = np.roll(left, -shift, axis=1)
    found = block_match(left, right, measure, 0, 16)
    inner = found[8:-8, 24:-12]
    known = np.isfinite(inner)
    assert known.mean() > 0.8
    assert np.median(inner[known]) == pytest.approx(shift, abs=0.2)
    assert np.mean(np.abs(inner[known] - shift) > 1) < 0.01


def test_negative_disparities_are_searched_for_toed_in_cameras() -> None:
    rng = np.random.default_rng(6)
    left = rng.integers(20, 235, (60, 120), dtype=np.uint8)
    right = np.roll(left, 4, axis=1)
    for method in ("bm", "sgbm_3way", "zncc"):
        found = make_matcher(method, -16, 32)(left, right)
        assert np.nanmedian(found) == pytest.approx(-4.0, abs=0.2), method


def test_an_unknown_method_is_refused_by_name() -> None:
    with pytest.raises(ValueError, match=r"stereo_range\.method = 'magic'"):
        make_matcher("magic", 0, 16)  # type: ignore[arg-type]


def test_mean_of_four_is_the_mean_of_what_is_known() -> None:
    rng = np.random.default_rng(1)
    values = rng.normal(10, 3, (8, 12)).astype(np.float32)
    values[rng.random((8, 12)) < 0.5] = np.nan
    got = mean_of_four(values)
    for y in range(4):
        for x in range(6):
            block = values[2 * y : 2 * y + 2, 2 * x : 2 * x + 2]
            if np.isfinite(block).any():
                assert got[y, x] == pytest.approx(np.nanmean(block), rel=1e-5)
            else:
                assert np.isnan(got[y, x])


def test_only_values_on_the_line_between_both_rims_bridge_a_gap() -> None:
    trusted = np.zeros((4, 9), bool)
    trusted[:, [1, 7]] = True
    raw = np.tile(np.arange(3.0, 12.0, dtype=np.float32), (4, 1))
    raw[1, 4], raw[3, 5] = 20.0, np.nan
    trusted[2, 7] = False  # row 2 has no right rim: the next row's left one is not its own
    on_line = np.zeros((4, 9), bool)
    on_line[[0, 1, 3], 2:7] = True
    on_line[1, 4] = on_line[3, 5] = False
    assert np.array_equal(bridged(raw, trusted, 0.5), on_line)


def test_islands_are_what_neighbours_hold_together_and_small_ones_are_left_out() -> None:
    disparity = np.zeros((6, 8), np.float32)
    disparity[:, 4:] = 10.0
    known = np.ones((6, 8), bool)
    known[:, 3] = known[4:, :4] = False
    known[5, 0] = True
    large = known.copy()
    large[5, 0] = False
    assert np.array_equal(islands(disparity, known, 4, 1.0), large)
    assert np.array_equal(islands(disparity, known, 12, 1.0), known & (disparity > 0))


def test_noise_is_measured_and_is_not_texture() -> None:
    rng = np.random.default_rng(2)
    for sigma in (2.0, 4.0, 8.0):
        grain = np.clip(rng.normal(128, sigma, (120, 160)), 0, 255).astype(np.uint8)
        assert noise_sigma(grain) == pytest.approx(sigma, rel=0.2)
        assert textured(grain, noise_sigma(grain)).mean() < 0.02


def test_stripes_repeat_and_grain_does_not() -> None:
    rng = np.random.default_rng(4)
    stripes = np.tile(np.where(np.arange(160) % 12 < 6, 90, 160).astype(np.uint8), (48, 1))
    assert periodic(stripes, 32, 1.0)[:, 20:110].mean() > 0.9
    grain = rng.integers(0, 255, (48, 160), dtype=np.uint8)
    assert periodic(grain, 32, 1.0).mean() < 0.02

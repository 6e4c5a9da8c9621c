"""The thesis' obstacle picture against slow, obvious loops that follow its steps pixel by pixel."""

from __future__ import annotations

from math import acos, pi, sqrt
from typing import Any, Literal

import cv2
import numpy as np
import numpy.typing as npt
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra import numpy as arrays

from chairward_vision_obstacle.thesis import choose_side, obstacle_mask

Method = Literal["thesis_text", "thesis_code"]
METHODS: tuple[Method, ...] = ("thesis_text", "thesis_code")


def hsi(b: int, g: int, r: int) -> tuple[float, float, float]:
    intensity = (r + g + b) / 765
    saturation = 1 - 3 * min(r, g, b) / (r + g + b) if r + g + b else 0.0
    under = 2 * sqrt((r - g) ** 2 + (r - b) * (g - b))
    angle = acos(max(-1.0, min(1.0, (2 * r - g - b) / under))) / (2 * pi) if under else 0.0
    return (1 - angle if b > g else angle), saturation, intensity


def hsv(b: int, g: int, r: int) -> tuple[float, float, float]:
    top, low = max(r, g, b), min(r, g, b)
    if top == low:
        hue = 0.0
    elif top == r:
        hue = ((g - b) / (top - low)) % 6 / 6
    elif top == g:
        hue = (2 + (b - r) / (top - low)) / 6
    else:
        hue = (4 + (r - g) / (top - low)) / 6
    return hue, ((top - low) / top if top else 0.0), top / 255


def loop_mask(image: npt.NDArray[np.uint8], method: Method) -> npt.NDArray[np.bool_]:
    text = method == "thesis_text"
    if text:
        image = np.asarray(cv2.GaussianBlur(image, (5, 5), 0), np.uint8)
    height, width = 240, 320
    hues, levels = [0.0] * 5, [0.0] * 5
    pixels: list[list[tuple[int, int, bool]]] = []
    for y in range(height):
        row = []
        for x in range(width):
            h, s, i = (hsi if text else hsv)(*(int(c) for c in image[y, x]))
            eps = 1e-9  # limits of whole-number colours are met exactly on paper
            valid = s >= 0.1 - eps and (i >= 0.05 - eps if text else i > 0.05)
            if text:
                bins = min(int(h * 5), 4), min(int(i * 5 + eps), 4)
            else:
                edges = (0.2001, 0.4001, 0.6001, 0.8001)
                bins = sum(h >= e for e in edges), sum(i >= e for e in edges)
            row.append((*bins, valid))
            if text:
                inside = y >= 180 and 50 - (y - 180) // 2 <= x < 270 + (y - 180) // 2
            else:
                inside = y >= 180 and 20 <= x < 300
            if inside:
                levels[bins[1]] += 1
                hues[bins[0]] += valid
        pixels.append(row)
    if text:
        hues = [(hues[i - 1] + hues[i] + hues[(i + 1) % 5]) / 3 for i in range(5)]
        levels = [(levels[max(i - 1, 0)] + levels[i] + levels[min(i + 1, 4)]) / 3 for i in range(5)]
    hue_top, level_top = (max(hues), max(levels)) if text else (max(levels), max(hues))
    rare = [
        [(hues[h] * 50 <= hue_top and (valid or not text)) or levels[i] * 50 <= level_top for h, i, valid in row]
        for row in pixels
    ]
    padded = np.pad(np.array(rare), 4, mode="edge")
    out = np.zeros((height, width), np.bool_)
    for y in range(height):
        for x in range(width):
            out[y, x] = padded[y : y + 9, x : x + 9].sum() > 40
    return out


def scene(seed: int) -> npt.NDArray[np.uint8]:
    """A floor, a wall, boxes and noise in random colours; also the limits of every bin and of validity."""
    rng = np.random.default_rng(seed)
    image = np.empty((240, 320, 3), np.uint8)
    image[:] = rng.integers(0, 256, 3)
    image[:110] = rng.integers(0, 256, 3)
    for _ in range(5):
        y, x = rng.integers(60, 220), rng.integers(0, 280)
        image[y : y + 60, x : x + rng.integers(5, 80)] = rng.integers(0, 256, 3)
    for i, level in enumerate((0, 12, 13, 51, 102, 153, 204, 255)):
        image[130:150, 12 * i : 12 * i + 12] = level
        image[150:170, 12 * i : 12 * i + 12] = (level, level, level * 9 // 10)
    noise = rng.normal(0, rng.choice([0, 4, 15]), image.shape)
    return np.asarray(np.clip(image + noise, 0, 255), np.uint8)


@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize("seed", range(4))
def test_the_mask_is_the_thesis_steps_pixel_by_pixel(method: Method, seed: int) -> None:
    image = scene(seed)
    assert np.array_equal(obstacle_mask(image, method), loop_mask(image, method))


@pytest.mark.parametrize("method", METHODS)
def test_other_sizes_are_worked_on_as_320_by_240(method: Method) -> None:
    image = scene(1)
    big = np.asarray(cv2.resize(image, (640, 480), interpolation=cv2.INTER_NEAREST), np.uint8)
    expected = obstacle_mask(image, method).repeat(2, axis=0).repeat(2, axis=1)
    assert np.array_equal(obstacle_mask(big, method), expected)


@pytest.mark.parametrize("method", METHODS)
def test_a_red_box_on_a_blue_floor_is_found_and_the_floor_is_not(method: Method) -> None:
    image = np.full((240, 320, 3), (180, 90, 60), np.uint8)
    image[120:170, 130:190] = (40, 40, 200)
    mask = obstacle_mask(image, method)
    assert mask[125:165, 135:185].all()
    assert not mask[200:].any()


def test_an_obstacle_in_the_reference_area_becomes_floor_which_is_why_the_default_does_otherwise() -> None:
    image = np.full((240, 320, 3), (180, 90, 60), np.uint8)
    image[120:240, 100:220] = (40, 40, 200)
    assert not obstacle_mask(image, "thesis_code")[130:230, 110:210].any()


def loop_side(mask: npt.NDArray[np.bool_]) -> tuple[float, float]:
    lowest = []
    for column in range(1, 321):
        low = 0
        for row in range(1, 211):
            if mask[row - 1, column - 1]:
                low = row
        lowest.append(low)
    left, right = lowest[0:107], lowest[214:320]
    return sum(left) / len(left), sum(right) / len(right)


@settings(max_examples=30, deadline=None)
@given(st.lists(st.tuples(st.integers(0, 239), st.integers(0, 319), st.integers(1, 60)), max_size=6))
def test_the_side_is_chosen_as_the_thesis_does(boxes: list[tuple[int, int, int]]) -> None:
    mask = np.zeros((240, 320), np.bool_)
    for y, x, size in boxes:
        mask[y : y + size, x : x + size] = True
    got = choose_side(mask)
    left, right = loop_side(mask)
    assert (got.left, got.right) == (pytest.approx(left), pytest.approx(right))
    assert got.side == ("left" if left <= right else "right")


@given(arrays.arrays(np.bool_, (24, 32)))
def test_a_mirrored_picture_has_the_mirrored_side_at_any_size(small: Any) -> None:
    mask = np.kron(small, np.ones((20, 20), np.bool_)).astype(np.bool_)
    got, mirrored = choose_side(mask), choose_side(mask[:, ::-1])
    if abs(got.left - got.right) > 25:  # the thirds are 107 and 106 columns wide
        assert got.side != mirrored.side

"""The learned look of the floor, held against a slow and obvious count."""

from __future__ import annotations

import cv2
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from chairward_vision_obstacle.floor_look import C_BINS, Y_BINS, FloorLook, looks

S = 1_000_000_000


def learned(image: np.ndarray, floor: np.ndarray, obstacle: np.ndarray, **options: float) -> FloorLook:
    kept = {"share": 0.02, "contrast": 0.25, "fast_s": 2.0, "slow_s": 60.0, "enough": 20} | options
    look = FloorLook(**kept)  # type: ignore[arg-type]
    look.learn(looks(image), floor, obstacle, 0)
    return look


def slow_is_floor(
    image: np.ndarray, floor: np.ndarray, obstacle: np.ndarray, share: float, contrast: float
) -> np.ndarray:
    """Pixel by pixel: how many of the floor's (obstacle's) pixels look alike, to within one bin each way."""
    cells = [divmod(int(b), C_BINS * C_BINS) for b in looks(image).ravel()]
    bins = [(y, *divmod(rest, C_BINS)) for y, rest in cells]
    flat, up = floor.ravel(), obstacle.ravel()
    out = []
    for y, r, b in bins:
        alike = [abs(y - v) <= 1 and abs(r - s) <= 1 and abs(b - c) <= 1 for v, s, c in bins]
        of_floor = sum(a and f for a, f in zip(alike, flat, strict=True)) / max(1, flat.sum())
        of_up = sum(a and u for a, u in zip(alike, up, strict=True)) / max(1, up.sum()) if up.sum() >= 20 else 0.0
        out.append(of_floor >= share - 1e-7 and of_floor >= contrast * of_up - 1e-7)
    return np.array(out).reshape(floor.shape)


@settings(max_examples=15, deadline=None)
@given(st.integers(0, 10_000))
def test_a_look_is_floor_exactly_when_enough_of_the_floor_looks_alike(seed: int) -> None:
    rng = np.random.default_rng(seed)
    image = rng.choice(rng.integers(0, 256, (5, 3)), (12, 14)).astype(np.uint8)
    image = np.clip(image + rng.integers(-6, 7, image.shape), 0, 255).astype(np.uint8)
    floor = rng.random((12, 14)) < 0.5
    obstacle = ~floor & (rng.random((12, 14)) < 0.5)
    got = learned(image, floor, obstacle, share=0.03).is_floor(looks(image))
    assert (got == slow_is_floor(image, floor, obstacle, 0.03, 0.25)).mean() > 0.99


@given(st.tuples(*[st.integers(0, 255)] * 3))
def test_every_colour_has_a_bin(colour: tuple[int, int, int]) -> None:
    (found,) = looks(np.array([[colour]], np.uint8)).ravel()
    assert 0 <= found < Y_BINS * C_BINS * C_BINS
    y, _, _ = cv2.cvtColor(np.array([[colour]], np.uint8), cv2.COLOR_BGR2YCrCb)[0, 0]
    assert found // (C_BINS * C_BINS) == y // 8


def flat(colour: tuple[int, int, int]) -> np.ndarray:
    return np.full((20, 20, 3), colour, np.uint8)


ALL, NONE = np.ones((20, 20), np.bool_), np.zeros((20, 20), np.bool_)


def test_several_looks_are_floor_at_once() -> None:
    tiles = flat((200, 200, 200))
    tiles[:, ::4] = (60, 60, 60)
    look = learned(tiles, ALL, NONE)
    assert look.is_floor(looks(tiles)).all()
    assert not look.is_floor(looks(flat((40, 40, 200)))).any()


def test_a_floor_of_before_is_known_for_a_minute_and_then_forgotten() -> None:
    look = learned(flat((200, 200, 200)), ALL, NONE)
    for second in range(1, 31):
        look.learn(looks(flat((90, 90, 90))), ALL, NONE, second * S)
    assert look.is_floor(looks(flat((200, 200, 200)))).all()
    assert look.is_floor(looks(flat((90, 90, 90)))).all()
    for second in range(31, 400):
        look.learn(looks(flat((90, 90, 90))), ALL, NONE, second * S)
    assert not look.is_floor(looks(flat((200, 200, 200)))).any()


def test_what_obstacles_look_like_is_not_floor_for_a_few_stray_floor_pixels() -> None:
    image = flat((150, 150, 150))
    image[:, 10:] = (40, 90, 160)
    floor, obstacle = NONE.copy(), NONE.copy()
    floor[:, :10] = True
    floor[3, 10:16] = True  # six pixels of the box were taken for floor
    obstacle[:, 10:] = True
    obstacle[3, 10:16] = False
    assert not learned(image, floor, obstacle).is_floor(looks(image))[:, 10:].any()


@pytest.mark.parametrize("pixels", [0, 19])
def test_too_few_pixels_teach_nothing(pixels: int) -> None:
    floor = NONE.copy()
    floor.ravel()[:pixels] = True
    look = learned(flat((150, 150, 150)), floor, NONE)
    assert not look.knows
    assert not look.is_floor(looks(flat((150, 150, 150)))).any()

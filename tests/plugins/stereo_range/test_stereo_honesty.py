"""Cannot see is never clear: blank, dark, covered, frozen, swapped, shifted, repeating, plain."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from chairward_stereo_range.tracker import Tracker

PERIOD_NS = 66_666_667
WITHIN_FRAMES = 8
"""0.5 s at 15 frames a second."""


def frames(tools: Any, count: int = WITHIN_FRAMES) -> list[tuple[Any, Any]]:
    box = tools.board(1500.0, left_mm=300.0, right_mm=-200.0)
    return [tools.render(tools.room((box,), driven_mm=20.0 * i, seed=i)) for i in range(count)]


def run(tools: Any, pairs: list[tuple[Any, Any]], skew_ns: int = 0) -> list[Any]:
    tracker = Tracker(tools.finder())
    return [tracker.step(a, b, i * PERIOD_NS, skew_ns) for i, (a, b) in enumerate(pairs)]


def test_a_healthy_pair_is_never_called_faulty(tools: Any) -> None:
    assert [r.reason for r in run(tools, frames(tools, 16)) if not r.can_see] == []


@pytest.mark.parametrize("side", [0, 1])
@pytest.mark.parametrize(
    ("spoil", "word"),
    [
        (lambda p: p // 30, "dark"),
        (lambda p: np.full_like(p, 128), "covered"),
        (lambda p: np.full_like(p, 255), "light"),
        (lambda p: (p * 0.45).astype(np.uint8), "darker"),
    ],
    ids=["dark", "covered", "blinded", "unequal"],
)
def test_a_spoilt_camera_is_named_and_blind(tools: Any, side: int, spoil: Any, word: str) -> None:
    pairs = []
    for pair in frames(tools, 3):
        spoilt = list(pair)
        spoilt[side] = spoil(pair[side])
        pairs.append((spoilt[0], spoilt[1]))
    last = run(tools, pairs)[-1]
    assert not last.can_see
    assert word in last.reason
    assert ("left", "right")[side] in last.reason


@pytest.mark.parametrize("side", [0, 1])
def test_a_frozen_camera_is_noticed_within_half_a_second(tools: Any, side: int) -> None:
    pairs = frames(tools)
    held = pairs[0][side]
    frozen = [(held, b) if side == 0 else (a, held) for a, b in pairs]
    last = run(tools, frozen)[-1]
    assert not last.can_see
    assert "frozen" in last.reason
    assert ("left", "right")[side] in last.reason


def test_swapped_cameras_are_noticed_within_half_a_second(tools: Any) -> None:
    last = run(tools, [(b, a) for a, b in frames(tools)])[-1]
    assert not last.can_see
    assert "swapped" in last.reason


def test_cameras_out_of_line_are_noticed_within_half_a_second(tools: Any) -> None:
    last = run(tools, [(a, np.roll(b, 8, axis=0)) for a, b in frames(tools)])[-1]
    assert not last.can_see
    assert "calibrate" in last.reason


def test_shutters_apart_are_named(tools: Any) -> None:
    last = run(tools, frames(tools, 1), skew_ns=40_000_000)[-1]
    assert not last.can_see
    assert "40 ms" in last.reason


def test_a_blank_wall_is_blind_not_clear(tools: Any) -> None:
    left, right = tools.render(tools.room((tools.board(500.0, texture="plain"),)))
    found = tools.finder().measure(left, right)
    assert not found.can_see
    assert "texture" in found.reason


def test_stripes_are_never_called_clear(tools: Any) -> None:
    for distance in (420.0, 500.0, 580.0):
        left, right = tools.render(tools.room((tools.board(distance, texture="stripes"),)))
        found = tools.finder().measure(left, right)
        assert not found.can_see or (found.ahead is not None and found.ahead.ahead_mm <= 600.0)


def test_a_plain_box_near_by_is_read_or_flagged(tools: Any) -> None:
    for distance in (420.0, 500.0, 580.0):
        box = tools.board(distance, left_mm=150.0, right_mm=-120.0, top_mm=900.0, texture="plain", level=60.0)
        found = tools.finder().measure(*tools.render(tools.room((box,))))
        assert not found.can_see or (found.ahead is not None and found.ahead.ahead_mm <= 600.0)


def test_a_wide_plain_patch_between_near_rims_could_bulge_and_is_flagged(tools: Any) -> None:
    middle = tools.board(720.0, left_mm=180.0, right_mm=-180.0, top_mm=900.0, texture="plain", level=60.0)
    found = tools.finder().measure(*tools.render(tools.room((middle,))))
    assert found.hidden_mm < 690.0
    assert not found.can_see
    assert "plain surface" in found.reason


@pytest.mark.parametrize(("distance", "seen"), [(850.0, False), (1700.0, True)])
def test_a_plain_surface_that_leaves_the_picture_could_bulge_by_all_that_is_seen_of_it(
    tools: Any, distance: float, seen: bool
) -> None:
    surface = tools.board(distance, left_mm=-0.1 * distance, texture="plain", level=170.0)
    found = tools.finder(region="trapezoid").measure(*tools.render(tools.room((surface,))))
    assert found.can_see == seen, (found.reason, found.hidden_mm)


@pytest.mark.parametrize("texture", ["plain", "rough"])
@pytest.mark.parametrize("distance", [150.0, 190.0, 230.0])
def test_a_post_nearer_than_the_search_goes_is_flagged(tools: Any, texture: str, distance: float) -> None:
    for width in (15.0, 25.0, 40.0, 70.0):
        post = tools.board(distance, left_mm=width / 2, right_mm=-width / 2, top_mm=900.0, texture=texture, level=60.0)
        found = tools.finder(region="trapezoid").measure(*tools.render(tools.room((post,))))
        assert not found.can_see or (found.ahead is not None and found.ahead.ahead_mm <= 600.0)


def test_a_repeating_floor_is_seen_where_it_is_measured_to_be_floor(tools: Any) -> None:
    """Shifted by a period it would stand at one depth over many rows, as no floor does."""
    found = tools.finder().measure(*tools.render(tools.room(floor="stripes")))
    assert found.can_see, found.reason
    assert found.ahead is None

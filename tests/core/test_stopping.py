"""Stopping distance and the speed that fits it are each other's inverse."""

from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from chairward.stopping import decel_on_slope_mm_s2, largest_speed_mm_s, stopping_distance_mm

SPEED, REACTION, DECEL = st.floats(1.0, 3_000.0), st.floats(0.0, 3.0), st.floats(50.0, 5_000.0)


def braked_way_mm(speed: float, reaction_s: float, decel: float) -> float:
    """The slow, obvious reference: 0.1 ms after 0.1 ms."""
    way, dt = speed * reaction_s, 1e-4
    while speed > 0.0:
        way += speed * dt
        speed -= decel * dt
    return way


def test_the_formula_agrees_with_braking_step_by_step() -> None:
    for speed, reaction, decel in ((500.0, 0.45, 600.0), (1_250.0, 0.3, 1_000.0), (100.0, 0.0, 2_000.0)):
        assert stopping_distance_mm(speed, reaction, decel) == pytest.approx(
            braked_way_mm(speed, reaction, decel), rel=1e-2
        )


def test_the_figure_of_peers_lesson_2() -> None:
    assert stopping_distance_mm(1_250.0, 0.3, 1_000.0) == pytest.approx(1_156, abs=1)


@given(SPEED, REACTION, DECEL)
def test_the_largest_speed_needs_exactly_the_room(speed: float, reaction: float, decel: float) -> None:
    room = stopping_distance_mm(speed, reaction, decel)
    assert largest_speed_mm_s(room, reaction, decel) == pytest.approx(speed, rel=1e-6)


@given(st.floats(-1_000.0, 0.0), REACTION, DECEL)
def test_no_room_no_speed(room: float, reaction: float, decel: float) -> None:
    assert largest_speed_mm_s(room, reaction, decel) == 0.0


@given(st.floats(0.0, 5_000.0), st.floats(0.0, 500.0), REACTION, DECEL)
def test_more_room_never_means_less_speed(room: float, more: float, reaction: float, decel: float) -> None:
    assert largest_speed_mm_s(room, reaction, decel) <= largest_speed_mm_s(room + more, reaction, decel)


def test_a_slope_takes_its_part_of_the_brake_and_a_steep_one_all() -> None:
    assert decel_on_slope_mm_s2(1_000.0, 0.0) == 1_000.0
    assert decel_on_slope_mm_s2(1_000.0, 5.0) == pytest.approx(509.7, abs=0.1)
    assert decel_on_slope_mm_s2(1_000.0, 12.0) < 0.0

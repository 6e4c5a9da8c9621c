"""Stopping distance and the speed that fits it are each other's inverse."""

from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from chairward.stopping import approach_speed_mm_s, decel_on_slope_mm_s2, largest_speed_mm_s, stopping_distance_mm

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


def nearest_when_following_the_curve(room: float, closing: float, reaction_s: float, decel: float) -> float:
    """The slow reference: a chair at the speed for where it was reaction_s ago, braking no harder than decel."""
    dt, speed = 1e-3, approach_speed_mm_s(room, closing, reaction_s, decel)
    past = [room + speed * dt * n + closing * dt * n for n in range(int(reaction_s / dt), -1, -1)]
    while speed > 1.0 and room > -1_000.0:
        wanted = approach_speed_mm_s(past.pop(0), closing, reaction_s, decel)
        speed = max(wanted, speed - decel * dt) if wanted < speed else speed
        room -= (speed + closing) * dt
        past.append(room)
    return room


@pytest.mark.parametrize("closing", [0.0, 300.0, 1_400.0])
@pytest.mark.parametrize(("reaction", "decel"), [(0.3, 1_000.0), (0.45, 600.0), (0.8, 400.0), (0.6, 2_000.0)])
def test_a_chair_that_follows_the_approach_speed_late_by_its_reaction_stands_before_the_room_is_used_up(
    closing: float, reaction: float, decel: float
) -> None:
    for room in (300.0, 1_000.0, 3_000.0):
        assert nearest_when_following_the_curve(room, closing, reaction, decel) >= -5.0


@given(st.floats(0.0, 5_000.0), st.floats(0.0, 500.0), st.floats(0.0, 2_000.0), REACTION, DECEL)
def test_more_room_never_lowers_and_a_faster_approach_never_raises_the_approach_speed(
    room: float, more: float, closing: float, reaction: float, decel: float
) -> None:
    speed = approach_speed_mm_s(room, closing, reaction, decel)
    assert speed <= approach_speed_mm_s(room + more, closing, reaction, decel) + 1e-9
    assert speed >= approach_speed_mm_s(room, closing + more, reaction, decel) - 1e-9
    assert 0.0 <= speed <= largest_speed_mm_s(room, reaction, decel) + 1e-9


@given(SPEED, st.floats(0.0, 2_000.0), REACTION, DECEL)
def test_the_approach_speed_uses_up_exactly_the_room(
    speed: float, closing: float, reaction: float, decel: float
) -> None:
    own = stopping_distance_mm(speed, reaction, decel)
    theirs = closing * (reaction + speed / decel)
    late = decel * reaction**2 / 2.0
    found = approach_speed_mm_s(own + theirs + late, closing, reaction, decel)
    assert found == pytest.approx(speed, rel=1e-6)


def test_figures_that_can_be_checked_by_hand() -> None:
    assert stopping_distance_mm(600.0, 0.5, 600.0) == 600.0
    assert largest_speed_mm_s(600.0, 0.5, 600.0) == pytest.approx(600.0)
    assert largest_speed_mm_s(1.0, 0.5, 600.0) == pytest.approx(1.9934, abs=1e-4)
    assert approach_speed_mm_s(1_275.0, 400.0, 0.5, 600.0) == pytest.approx(600.0)
    assert approach_speed_mm_s(275.0, 400.0, 0.5, 600.0) == 0.0
    assert largest_speed_mm_s(-0.5, 0.0, 600.0) == 0.0
    assert decel_on_slope_mm_s2(1_000.0, 10.0) == pytest.approx(19.335)

"""The person who crosses: comes when the chair does, waits until it rests, never walks into it."""

from __future__ import annotations

import pytest

from chairward_simulator.people import Walker


@pytest.fixture
def walker(home) -> Walker:
    assert home.person is not None
    return Walker.at_start(home.person)


def walk(walker: Walker, seconds: float, chair_x: float, speed: float, room: float) -> None:
    for _ in range(round(seconds / 0.01)):
        walker.step(0.01, chair_x, speed, room)


def test_waits_until_the_chair_is_through_the_door(walker, home) -> None:
    walk(walker, 5.0, 5000.0, 500.0, 9000.0)
    assert (walker.doing, walker.x_mm, walker.y_mm) == ("waiting", *home.person.wait_at)


def test_stands_in_the_way_until_the_chair_has_rested_and_walks_on(walker, home) -> None:
    walk(walker, 3.0, 5800.0, 500.0, 9000.0)
    assert (walker.doing, walker.x_mm, walker.y_mm) == ("standing", *home.person.stand_at)
    walk(walker, 5.0, 6000.0, 300.0, 700.0)
    assert walker.doing == "standing"
    walk(walker, 1.0, 6300.0, 0.0, 600.0)
    walk(walker, 0.2, 6300.0, 50.0, 600.0)
    walk(walker, 1.4, 6300.0, 0.0, 600.0)
    assert walker.doing == "standing"
    walk(walker, 5.0, 6300.0, 0.0, 600.0)
    assert (walker.doing, walker.x_mm, walker.y_mm) == ("gone", *home.person.leave_to)


def test_does_not_walk_on_into_a_chair_that_is_close(walker) -> None:
    walk(walker, 0.5, 5800.0, 500.0, 9000.0)
    before = (walker.x_mm, walker.y_mm)
    walk(walker, 3.0, 7000.0, 0.0, 200.0)
    assert (walker.x_mm, walker.y_mm) == before
    assert walker.doing == "coming"

"""The judge: collisions, falls, nearest approach and causes of stops come from the world itself."""

from __future__ import annotations

import pytest

from chairward_simulator.body import Body, Bridge, Pins
from chairward_simulator.home import person_obstacle
from chairward_simulator.truth import Truth, of_home
from chairward_simulator.world import World

FORWARD = Pins(drive=Bridge(duty=0.5, in1=True))


@pytest.fixture
def silent(home, footprint) -> World:
    return World(home, footprint, speaks=False)


def place(world: World, x: float, y: float, heading: float) -> None:
    world.body = world._free = Body(x_mm=x, y_mm=y, heading_deg=heading)


def run(world: World, pins: Pins, seconds: float) -> None:
    for _ in range(round(seconds / 0.005)):
        world.step(pins)


def test_driving_on_into_a_wall_is_one_collision_and_goes_no_further(silent) -> None:
    place(silent, 1500.0, 3000.0, 180.0)
    run(silent, FORWARD, 6.0)
    assert silent.report()["collisions"] == ["picture, west"]
    assert silent.body.x_mm == pytest.approx(490.0, abs=25.0)
    run(silent, Pins(drive=Bridge(duty=0.5, in2=True)), 1.0)  # it can back out again
    assert silent.body.x_mm > 700.0
    run(silent, FORWARD, 3.0)
    assert len(silent.report()["collisions"]) == 2


def test_driving_over_the_step_is_a_collision(silent) -> None:
    place(silent, 7000.0, 2300.0, -90.0)
    run(silent, FORWARD, 4.0)
    assert silent.report()["collisions"] == ["step down"]


def test_nearest_approach_is_that_to_what_it_drove_at(silent) -> None:
    place(silent, 8000.0, 2250.0, 0.0)
    run(silent, FORWARD, 2.0)
    run(silent, Pins(drive=Bridge(duty=1.0)), 1.0)
    report = silent.report()
    assert report["nearest_ahead_of"] == "cardboard box"
    assert report["nearest_ahead_mm"] == pytest.approx(9400.0 - 450.0 - silent.body.x_mm, abs=20.0)
    assert report["driven_mm"] == pytest.approx(silent.body.x_mm - 8000.0, abs=2.0)


def test_somebody_walking_up_to_the_chair_is_not_its_own_approach(home, footprint) -> None:
    truth = of_home(home, footprint)
    rolling = Body(x_mm=6200.0, y_mm=2250.0, heading_deg=0.0, speed_mm_s=300.0)
    truth.look(0.0, rolling, [person_obstacle(7000.0, 2250.0, moving=True)])
    assert truth.nearest_ahead_mm > 2000.0
    truth.look(0.1, rolling, [person_obstacle(7000.0, 2250.0, moving=False)])
    assert truth.nearest_ahead_of == "person"
    assert truth.nearest_ahead_mm == pytest.approx(7000.0 - 230.0 - 6650.0)


def stop_at(truth: Truth, x: float, word: str) -> None:
    truth.heard("front")
    truth.look(0.0, Body(x_mm=x - 50, y_mm=2250.0, heading_deg=0.0, speed_mm_s=300.0), ())
    truth.heard(word)
    truth.look(1.0, Body(x_mm=x, y_mm=2250.0, heading_deg=0.0), ())


def test_a_stop_by_word_or_in_the_open_is_no_protective_stop(home, footprint) -> None:
    truth = of_home(home, footprint)
    stop_at(truth, 8330.0, "stop")
    stop_at(truth, 6500.0, "front")
    assert truth.report()["stopped_before"] == []
    assert truth.report()["other_stops"] == 2
    stop_at(truth, 8330.0, "front")
    assert [s["thing"] for s in truth.report()["stopped_before"]] == ["cardboard box"]


def test_a_doorway_counts_once_each_way_with_the_stops_made_in_it(home, footprint) -> None:
    truth = of_home(home, footprint)
    for x, speed in ((4500.0, 400.0), (4700.0, 0.0), (4900.0, 400.0), (5150.0, 400.0), (5900.0, 400.0)):
        truth.look(x / 1000.0, Body(x_mm=x, y_mm=2270.0, heading_deg=0.0, speed_mm_s=speed), ())
    passed = truth.report()["doorways_passed"]
    assert [(p["doorway"], p["left_of_middle_mm"], p["stops"]) for p in passed] == [("doorway", 20, 1)]

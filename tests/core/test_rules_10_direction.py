"""Rule 10: what each way may do at most is in the chair file; a live reading never opens anything."""

from __future__ import annotations

import pytest
from msgspec.structs import replace

from chairward.components import STILL
from chairward.envelope import Caps, meet
from chairward.facts import MS, Limits, SourceLimits
from chairward.messages import Command, Way
from chairward.rules import direction
from chairward.scene import WAYS, look
from chairward.testing.ride import START_NS, Ride, chair_limits, driving, healthy, readings

CAPS, UNSEEN = Caps(900.0, 400.0, 40.0, 35.0), Caps(0.0, 150.0, 20.0, 15.0)


def limits_with(*covers: frozenset[Way]) -> Limits:
    sensors = {f"lane{i}/range": SourceLimits(freshness_ns=200 * MS, covers=ways) for i, ways in enumerate(covers)}
    return chair_limits(sensors=sensors, caps=CAPS, unseen=UNSEEN)


def caps_for(limits: Limits) -> Caps:
    return meet(direction(look(healthy(limits), driving(), limits)))


def test_the_chairs_own_limit_holds_where_everything_is_covered() -> None:
    assert caps_for(limits_with(frozenset(WAYS))) == CAPS


@pytest.mark.parametrize("way", WAYS)
def test_a_way_that_no_sensor_covers_may_do_what_the_chair_file_says_for_unseen(way: Way) -> None:
    index = WAYS.index(way)
    assert caps_for(limits_with(frozenset(WAYS) - {way})) == Caps(
        *(UNSEEN[i] if i == index else cap for i, cap in enumerate(CAPS))
    )


def test_the_coverage_of_all_sensors_counts_together() -> None:
    assert caps_for(limits_with(frozenset({Way.AHEAD, Way.LEFT}), frozenset({Way.BEHIND, Way.RIGHT}))) == CAPS


def test_a_sensor_that_says_nothing_of_a_way_it_is_declared_to_watch_does_not_watch_it() -> None:
    limits = limits_with(frozenset({Way.AHEAD, Way.LEFT, Way.RIGHT}))
    silent = healthy(limits, ranges={"lane0/range": readings(START_NS, ahead_mm=None)})
    assert meet(direction(look(silent, driving(), limits))).forward_mm_s == UNSEEN.forward_mm_s
    assert meet(direction(look(healthy(limits), driving(), limits))).forward_mm_s == CAPS.forward_mm_s


def test_without_any_sensor_there_is_no_way_ahead() -> None:
    assert caps_for(limits_with()) == UNSEEN


def test_unseen_never_means_more_than_the_chairs_own_limit() -> None:
    generous = replace(limits_with(), unseen=Caps(9_000.0, 9_000.0, 90.0, 90.0))
    assert caps_for(generous) == CAPS


def test_a_reading_of_an_undeclared_way_opens_nothing() -> None:
    limits = limits_with(frozenset({Way.AHEAD}))
    facts = healthy(limits, ranges={"lane0/range": readings(START_NS, behind_mm=5_000, left_mm=5_000)})
    assert meet(direction(look(facts, driving(), limits))) == Caps(CAPS.forward_mm_s, 150.0, 20.0, 15.0)


def test_a_sensor_that_the_chair_file_does_not_know_opens_nothing() -> None:
    limits = limits_with(frozenset({Way.AHEAD}))
    facts = healthy(limits, ranges={"stranger/range": readings(START_NS), "lane0/range": readings(START_NS)})
    assert meet(direction(look(facts, driving(), limits))) == Caps(CAPS.forward_mm_s, 150.0, 20.0, 15.0)


def test_backing_without_a_rear_sensor_is_slow_and_the_way_ahead_without_one_closed() -> None:
    ride = Ride(limits=replace(chair_limits(), backward_mm_s=400.0, caps=CAPS))
    ride.arm()
    assert ride.tick(Command.BACK, times=50).motion.drive_mm_s == -150.0
    blind_chair = Ride(limits=limits_with(frozenset({Way.LEFT, Way.RIGHT})))
    blind_chair.arm()
    assert blind_chair.tick(Command.FRONT, times=5).motion == STILL
    assert blind_chair.decisions[-1].instruction == "Stop now"


def test_a_way_without_a_distance_is_not_watched_whoever_made_the_infinity() -> None:
    limits = limits_with(frozenset(WAYS))
    scene = look(healthy(limits), driving(), limits)
    mute = tuple(seen._replace(ahead_mm=float("inf")) for seen in scene.seen)
    assert meet(direction(scene._replace(seen=mute))).forward_mm_s == UNSEEN.forward_mm_s

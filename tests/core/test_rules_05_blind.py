"""Rule 5: a sensor that cannot see opens nothing; three blind pictures spend the wish."""

from __future__ import annotations

import pytest
from msgspec.structs import replace

from chairward.components import STILL
from chairward.envelope import OPEN, Caps, Envelope, Grip, meet
from chairward.facts import MS, Limits, SourceLimits
from chairward.messages import Command, RangeReading, Way
from chairward.rules import blind
from chairward.scene import look
from chairward.testing.ride import FRONT, START_NS, Ride, chair_limits, driving, healthy, readings

SONAR, TWIN = "sonar/range", "front/colour"
AHEAD = SourceLimits(freshness_ns=200 * MS, covers=frozenset({Way.AHEAD}))
LIMITS = chair_limits()


def with_other(name: str, limits: Limits = LIMITS, need: SourceLimits = AHEAD, crawl: float = 80.0) -> Limits:
    return replace(limits, sensors={**limits.sensors, name: need}, crawl_mm_s=crawl)


def window(blind_ones: int) -> tuple[RangeReading, ...]:
    dark = readings(START_NS, can_see=False, ahead_mm=None, reason="plain wall")
    return dark[:blind_ones] + readings(START_NS)[blind_ones:]


def votes(limits: Limits = LIMITS, **blind_ones: int) -> list[Envelope]:
    ranges = {name: window(blind_ones.get(name.replace("/", "_"), 0)) for name in limits.sensors}
    return list(blind(look(healthy(limits, ranges=ranges), driving(), limits)))


def test_seeing_sensors_are_not_voted_against() -> None:
    assert votes() == []


@pytest.mark.parametrize("count", [1, 2, 3])
def test_one_blind_picture_of_three_counts_what_it_covers_as_uncovered(count: int) -> None:
    (vote,) = votes(front_range=count)
    assert vote.caps == Caps(0.0, OPEN.backward_mm_s, 20.0, 20.0)
    assert (vote.source, vote.detail) == (FRONT, "plain wall")
    assert vote.grip is (Grip.SPENDS if count == 3 else Grip.WAITS)


def test_a_blind_sensor_without_a_reason_is_still_explained() -> None:
    facts = healthy(LIMITS, ranges={FRONT: readings(START_NS, can_see=False)})
    (vote,) = blind(look(facts, driving(), LIMITS))
    assert vote.detail == "cannot see"


def test_only_the_covered_ways_of_the_blind_sensor_are_touched() -> None:
    rear = SourceLimits(freshness_ns=200 * MS, covers=frozenset({Way.BEHIND}))
    (vote,) = votes(with_other("rear/range", need=rear), rear_range=3)
    assert vote.caps == Caps(OPEN.forward_mm_s, 150.0, OPEN.left_deg_s, OPEN.right_deg_s)


def test_a_seeing_sensor_of_another_lane_allows_the_crawl_the_chair_file_gives() -> None:
    assert meet(votes(with_other(SONAR), front_range=3)).forward_mm_s == 80.0
    assert meet(votes(with_other("aside/range"), front_range=3)).forward_mm_s == 80.0
    assert meet(votes(with_other(SONAR, crawl=0.0), front_range=3)).forward_mm_s == 0.0


def test_no_crawl_when_the_other_is_blind_too_or_does_not_look_ahead_or_shares_the_camera() -> None:
    beside = SourceLimits(freshness_ns=200 * MS, covers=frozenset({Way.LEFT}))
    assert meet(votes(with_other(SONAR), front_range=3, sonar_range=1)).forward_mm_s == 0.0
    assert meet(votes(with_other(SONAR, need=beside), front_range=3)).forward_mm_s == 0.0
    assert meet(votes(with_other(TWIN), front_range=3)).forward_mm_s == 0.0


def test_no_crawl_when_the_other_sees_but_says_no_distance_ahead() -> None:
    limits = with_other(SONAR)
    mute = healthy(limits, ranges={FRONT: window(3), SONAR: readings(START_NS, ahead_mm=None)})
    assert meet(list(blind(look(mute, driving(), limits)))).forward_mm_s == 0.0


def test_a_stranger_to_the_chair_file_gives_no_crawl_and_has_no_ways_to_close() -> None:
    limits = replace(LIMITS, crawl_mm_s=80.0)
    facts = healthy(limits, ranges={FRONT: window(3), SONAR: window(0), "other/range": window(3)})
    assert [vote.caps.forward_mm_s for vote in blind(look(facts, driving(), limits))] == [0.0]


def test_one_blind_picture_stops_and_the_same_wish_goes_on_after_it() -> None:
    ride = Ride()
    ride.drive_off()
    dark = (*readings(ride.now_ns)[1:], readings(ride.now_ns, can_see=False)[2])
    stopped = ride.tick(ranges={FRONT: dark})
    assert stopped.motion == STILL
    assert not stopped.protective_stop
    assert ride.tick(times=10).motion.drive_mm_s > 0.0


def test_three_blind_pictures_are_a_protective_stop_and_seeing_again_does_not_restart() -> None:
    ride = Ride()
    ride.drive_off()
    ride.world[FRONT] = {"can_see": False, "ahead_mm": None, "reason": "dark"}
    stopped = ride.tick()
    assert stopped.protective_stop
    assert stopped.instruction == "Stop now"
    assert stopped.open_ways == (Way.BEHIND, Way.LEFT, Way.RIGHT)
    ride.world.clear()
    assert ride.tick(times=20).motion == STILL
    assert ride.tick(Command.FRONT, times=20).motion.drive_mm_s > 0.0


def test_more_than_three_blind_pictures_spend_the_wish_too() -> None:
    facts = healthy(LIMITS, ranges={FRONT: (*window(3), window(3)[-1])})
    (vote,) = blind(look(facts, driving(), LIMITS))
    assert vote.grip is Grip.SPENDS


def test_no_crawl_when_the_other_is_infinitely_far_whoever_made_the_infinity() -> None:
    limits = with_other(SONAR)
    scene = look(healthy(limits, ranges={FRONT: window(3), SONAR: window(0)}), driving(), limits)
    far = tuple(seen._replace(ahead_mm=float("inf")) for seen in scene.seen)
    assert meet(list(blind(scene._replace(seen=far)))).forward_mm_s == 0.0

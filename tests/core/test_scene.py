"""What the rules look at: readings boiled down to the worst that they say, and names taken apart."""

from __future__ import annotations

import msgspec
import pytest
from hypothesis import given
from hypothesis import strategies as st

from chairward.components import STILL, Motion
from chairward.messages import DriveStatus, RangeReading, Way
from chairward.scene import WAYS, Seen, boil, lane, look, reported
from chairward.testing.ride import FRONT, START_NS, chair_limits, driving, healthy, readings

DISTANCE = st.none() | st.integers(0, 3)
READING = st.builds(
    RangeReading,
    seq=st.just(1),
    captured_ns=st.just(1),
    can_see=st.booleans(),
    ahead_mm=DISTANCE,
    behind_mm=DISTANCE,
    left_mm=DISTANCE,
    right_mm=DISTANCE,
    closing_mm_s=st.integers(0, 3),
    reason=st.sampled_from(["dark", "plain wall"]),
)


@given(st.lists(READING, max_size=4).map(tuple))
def test_boiling_keeps_the_worst_of_all_readings(window: tuple[RangeReading, ...]) -> None:
    def nearest(way: Way) -> float:
        return min((mm for r in window if (mm := getattr(r, f"{way}_mm")) is not None), default=float("inf"))

    blind = [reading for reading in window if not reading.can_see]
    seen = boil("front/range", window)
    assert seen == Seen(
        source="front/range",
        ahead_mm=nearest(Way.AHEAD),
        behind_mm=nearest(Way.BEHIND),
        left_mm=nearest(Way.LEFT),
        right_mm=nearest(Way.RIGHT),
        closing_mm_s=max((reading.closing_mm_s for reading in window), default=0),
        blind=len(blind),
        reason=blind[-1].reason if blind else "",
    )
    assert [seen.mm(way) for way in WAYS] == [nearest(way) for way in Way]


def test_a_sensor_that_has_said_nothing_is_not_in_the_scene() -> None:
    limits = chair_limits()
    ranges = {FRONT: readings(START_NS), "new/one": ()}
    assert [seen.source for seen in look(healthy(limits, ranges=ranges), driving(), limits).seen] == [FRONT]


@pytest.mark.parametrize(("source", "name"), [("front/range", "front"), ("front", "front"), ("a/b/c", "a")])
def test_a_source_belongs_to_the_lane_before_the_stroke(source: str, name: str) -> None:
    assert lane(source) == name


def test_a_controller_that_does_not_tell_its_motion_is_taken_to_stand() -> None:
    silent = DriveStatus(at_ns=1, linked=True, armed=True)
    assert reported(silent) == STILL
    assert reported(msgspec.structs.replace(silent, speed_mm_s=-150.0, turn_deg_s=7.0)) == Motion(-150.0, 7.0)

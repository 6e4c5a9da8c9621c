"""The reflex: which reading stops the drive before the reasons are known. That decide() agrees is a law of its own."""

from __future__ import annotations

import pytest
from msgspec.structs import replace

from chairward.arbiter import decide
from chairward.components import STILL, Motion
from chairward.facts import Wish
from chairward.messages import Command
from chairward.reflex import reflex
from chairward.testing.ride import FRONT, START_NS, VOICE, chair_limits, driving, healthy, readings

LIMITS = chair_limits()
FORWARD, BACKWARD, TURNING = Motion(300.0, 0.0), Motion(-150.0, 0.0), Motion(0.0, 20.0)


@pytest.mark.parametrize(
    ("does", "sees", "stops"),
    [
        (FORWARD, {"ahead_mm": 600}, True),
        (FORWARD, {"ahead_mm": 601}, False),
        (FORWARD, {"ahead_mm": None}, False),
        (FORWARD, {"ahead_mm": 3_000, "behind_mm": 100}, False),
        (BACKWARD, {"behind_mm": 600}, True),
        (BACKWARD, {"behind_mm": 601}, False),
        (BACKWARD, {"ahead_mm": 100}, False),
        (Motion(0.5, 0.0), {"ahead_mm": 100}, True),
        (Motion(-0.5, 0.0), {"behind_mm": 100}, True),
        (TURNING, {"ahead_mm": 100, "behind_mm": 100}, False),
        (STILL, {"ahead_mm": 100, "behind_mm": 100}, False),
    ],
)
def test_what_is_too_near_where_the_chair_drives_stops_it(
    does: Motion, sees: dict[str, int | None], stops: bool
) -> None:
    facts = replace(healthy(LIMITS), ranges={"not/yet": (), FRONT: readings(START_NS, **sees)})
    assert reflex(driving(output=does), facts, LIMITS) is stops


def test_any_reading_that_still_counts_is_enough() -> None:
    near, far = readings(START_NS, ahead_mm=100), readings(START_NS, ahead_mm=3_000)
    for mixed in ((near[0], *far[1:]), (*far[:2], near[2])):
        facts = replace(healthy(LIMITS), ranges={FRONT: mixed})
        assert reflex(driving(output=FORWARD), facts, LIMITS)


def test_where_a_word_came_too_decide_says_what_happens() -> None:
    wish = Wish(source=VOICE, seq=2, at_ns=START_NS, command=Command.LEFT)
    facts = replace(healthy(LIMITS), ranges={FRONT: readings(START_NS, ahead_mm=100)}, heard=(wish,))
    assert not reflex(driving(output=FORWARD), facts, LIMITS)
    assert decide(driving(output=FORWARD), facts, LIMITS)[1].motion == STILL

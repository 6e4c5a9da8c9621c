"""Rule 6: what was near and vanishes without receding is still there."""

from __future__ import annotations

from typing import Any

import pytest
from msgspec.structs import replace

from chairward.components import STILL, Motion
from chairward.facts import MS, Near
from chairward.memory import BACKED_OFF_MM, remember
from chairward.messages import Button, Command, RangeReading
from chairward.scene import look
from chairward.testing.ride import FRONT, START_NS, Ride, chair_limits, driving, healthy, readings

FRAME_NS = 33 * MS


class Camera:
    """Feeds a ride one picture a tick of 33 ms, so that the window holds three different distances."""

    def __init__(self, **limits: Any) -> None:
        self.ride = Ride(limits=chair_limits(**limits))
        self.ride.arm()
        self.window = list(readings(self.ride.now_ns))

    def see(self, *distances: int | None, heard: tuple[Command, ...] = (), press: tuple[Button, ...] = ()) -> None:
        for mm in distances:
            at = self.ride.now_ns
            reading = RangeReading(seq=at, captured_ns=at, can_see=mm is not None, ahead_mm=mm, left_mm=3_000)
            self.window = [*self.window[1:], reading]
            self.ride.tick(*heard, press=press, dt_ns=FRAME_NS, ranges={FRONT: tuple(self.window)})
            heard, press = (), ()

    @property
    def ways(self) -> list[str]:
        return [str(way) for way in self.ride.decisions[-1].open_ways]

    @property
    def held_to_be_there(self) -> bool:
        return any(near.gone for near in self.ride.state.near.values())


def lost_something() -> Camera:
    camera = Camera()
    camera.see(900, 850, 800, 790, 4_000, 4_000, 4_000)
    return camera


def test_a_thing_that_vanishes_is_still_there() -> None:
    camera = lost_something()
    assert camera.held_to_be_there
    assert "ahead" not in camera.ways
    assert camera.ride.decisions[-1].reasons[0].detail == "what was 790 mm ahead has vanished from view"


def test_a_thing_that_turns_into_cannot_see_is_still_there_when_the_sensor_sees_again() -> None:
    camera = Camera()
    camera.see(790, 780, None, None, None, 4_000, 4_000, 4_000)
    assert camera.held_to_be_there


def test_it_stays_there_however_long_the_chair_waits() -> None:
    camera = lost_something()
    camera.see(*[4_000] * 200)
    assert camera.held_to_be_there


def test_a_word_does_not_drive_into_it() -> None:
    camera = lost_something()
    camera.see(4_000, heard=(Command.FRONT,))
    assert camera.ride.decisions[-1].motion == STILL
    assert camera.ride.state.wish is None


def test_driving_when_it_vanishes_is_a_protective_stop() -> None:
    camera = Camera()
    camera.see(2_000, heard=(Command.FRONT,))
    camera.see(*[2_000] * 10, 800, 790, 4_000, 4_000, 4_000)
    assert camera.ride.decisions[-1].protective_stop


@pytest.mark.parametrize("step_mm", [10, 40, 66])
def test_somebody_who_walks_away_is_forgotten(step_mm: int) -> None:
    camera = Camera()
    camera.see(*range(700, 1_500, step_mm))
    assert not camera.held_to_be_there
    assert FRONT not in camera.ride.state.near
    assert "ahead" in camera.ways


def test_a_jump_is_not_walking_away_however_late_it_is_looked_at() -> None:
    camera = Camera()
    camera.see(700, 700, 700, 1_000, 1_000, 1_000)
    assert camera.held_to_be_there


def test_a_single_missed_picture_is_no_loss() -> None:
    camera = Camera()
    camera.see(700, 4_000, 700, 4_000, 4_000, 695)
    assert camera.ride.state.near[FRONT] == Near(distance_mm=695, seen_ns=camera.window[-1].captured_ns)


def test_seeing_it_again_ends_the_loss_and_it_can_then_walk_away() -> None:
    camera = lost_something()
    camera.see(780)
    assert not camera.held_to_be_there
    camera.see(*range(800, 1_400, 40))
    assert "ahead" in camera.ways


def test_backing_off_far_enough_lifts_it_and_less_does_not() -> None:
    camera = lost_something()
    camera.see(4_000, heard=(Command.BACK,))
    while camera.ride.state.wish:
        backed = camera.ride.state.near[FRONT].backed_mm if FRONT in camera.ride.state.near else None
        assert (backed is None) == ("ahead" in camera.ways)
        assert backed is None or backed < BACKED_OFF_MM
        camera.see(4_000)
    assert not camera.ride.state.near


def test_turning_away_lifts_it() -> None:
    camera = lost_something()
    camera.see(4_000, heard=(Command.LEFT,))
    camera.see(*[4_000] * 10)
    assert "ahead" in camera.ways


def test_a_thing_that_the_chair_turns_out_of_its_view_is_not_lost() -> None:
    camera = Camera()
    camera.see(650, heard=(Command.LEFT,))
    camera.see(*[650] * 8, 4_000, 4_000, 4_000)
    assert not camera.held_to_be_there


def test_the_operator_confirms_with_reset_at_a_standstill() -> None:
    camera = lost_something()
    camera.see(4_000, press=(Button.RESET,))
    assert not camera.ride.state.near
    camera.see(4_000)
    assert "ahead" in camera.ways


def test_reset_does_not_forget_what_is_still_in_view() -> None:
    camera = Camera()
    camera.see(700, 700, 700)
    camera.see(700, press=(Button.RESET,))
    camera.see(700, 4_000, 4_000, 4_000)
    assert camera.held_to_be_there


def test_beyond_near_loss_nothing_is_remembered() -> None:
    camera = Camera()
    camera.see(801, 801, 801, 4_000, 4_000, 4_000)
    assert not camera.ride.state.near


def test_a_sensor_that_disappears_altogether_keeps_its_memory() -> None:
    camera = lost_something()
    camera.ride.tick(ranges={})
    assert camera.held_to_be_there


@pytest.mark.parametrize(
    ("output", "reported", "backed"),
    [(-100.0, None, 2.0), (-100.0, -50.0, 1.0), (-100.0, 0.0, 0.0), (-50.0, -100.0, 1.0), (100.0, None, 0.0)],
)
def test_backing_counts_only_as_far_as_command_and_report_agree(
    output: float, reported: float | None, backed: float
) -> None:
    limits, near = chair_limits(), Near(distance_mm=700, seen_ns=START_NS - 10**9, gone=True)
    state = driving(near={FRONT: near}, output=Motion(output, 0.0))
    facts = healthy(limits)
    facts = replace(facts, drive=replace(facts.drive, speed_mm_s=reported))
    assert remember(look(facts, state, limits), 0.02)[FRONT].backed_mm == pytest.approx(backed)


@pytest.mark.parametrize(("output", "reported", "turned"), [(5.0, None, 0.1), (-5.0, -2.0, 0.04), (5.0, 0.0, 0.0)])
def test_turning_counts_only_as_far_as_command_and_report_agree(
    output: float, reported: float | None, turned: float
) -> None:
    limits, near = chair_limits(), Near(distance_mm=700, seen_ns=START_NS - 10**9, gone=True)
    state = driving(near={FRONT: near}, output=Motion(0.0, output))
    facts = healthy(limits)
    facts = replace(facts, drive=replace(facts.drive, turn_deg_s=reported))
    assert remember(look(facts, state, limits), 0.02)[FRONT].turned_deg == pytest.approx(turned)


# ---- the limits, to the millimetre ----------------------------------------------------------------------------------
LIMITS = chair_limits()
FAR = readings(START_NS)
OLDEST_NS = FAR[0].captured_ns


def after(near: Near, *, window: tuple[RangeReading, ...] = FAR, output: Motion = STILL) -> Near | None:
    """What is remembered a tick later by a chair that remembered this."""
    state = driving(near={FRONT: near}, output=output)
    return remember(look(healthy(LIMITS, ranges={FRONT: window}), state, LIMITS), 0.02).get(FRONT)


def at(*distances: int | None) -> tuple[RangeReading, ...]:
    return tuple(replace(reading, ahead_mm=mm) for reading, mm in zip(FAR, distances, strict=True))


@pytest.mark.parametrize(("since_ms", "farthest"), [(0, 850), (33, 916), (1_000, 2_850), (-40, 850)])
def test_what_recedes_comes_no_farther_than_somebody_walks_in_the_time_between(since_ms: int, farthest: int) -> None:
    near = Near(distance_mm=700, seen_ns=OLDEST_NS - since_ms * MS)
    assert after(near, window=at(farthest, 4_000, 4_000)) is None
    assert after(near, window=at(farthest + 1, 4_000, 4_000)) == replace(near, gone=True)
    assert after(near, window=at(None, 4_000, 4_000)) == replace(near, gone=True)


def test_what_has_vanished_does_not_recede_any_more() -> None:
    gone = Near(distance_mm=700, seen_ns=OLDEST_NS - 33 * MS, gone=True)
    assert after(gone, window=at(900, 900, 900)) == gone


@pytest.mark.parametrize(("backed", "lifted"), [(198.0, True), (197.9, False)])
def test_two_hundred_millimetres_back_lift_it_and_no_less(backed: float, lifted: bool) -> None:
    gone = Near(distance_mm=700, seen_ns=1, backed_mm=backed, gone=True)
    assert (after(gone, output=Motion(-100.0, 0.0)) is None) == lifted


@pytest.mark.parametrize(("turned", "lifted"), [(0.4, True), (0.39, False)])
def test_half_a_degree_of_turning_lifts_it_and_no_less(turned: float, lifted: bool) -> None:
    gone = Near(distance_mm=700, seen_ns=1, turned_deg=turned, gone=True)
    assert (after(gone, output=Motion(0.0, -5.0)) is None) == lifted


def test_near_begins_at_near_loss_mm() -> None:
    assert remember(look(healthy(LIMITS, ranges={FRONT: at(800, 800, 800)}), driving(), LIMITS), 0.02) == {
        FRONT: Near(distance_mm=800, seen_ns=FAR[2].captured_ns)
    }


def test_what_the_chair_has_done_counts_from_the_newest_near_reading() -> None:
    old = Near(distance_mm=650, seen_ns=1, backed_mm=50.0, turned_deg=0.1, gone=True)
    moving = Motion(-100.0, 5.0)
    for newest in (801, None):
        kept = after(old, window=at(700, int("700"), newest), output=moving)
        assert kept == Near(distance_mm=700, seen_ns=FAR[1].captured_ns, backed_mm=52.0, turned_deg=0.2)
    for newest in (800, 700, 0):
        fresh = after(old, window=at(790, 790, newest), output=moving)
        assert fresh == Near(distance_mm=min(790, newest), seen_ns=FAR[2 if newest < 790 else 1].captured_ns)


def test_a_sensor_sees_only_for_itself() -> None:
    kept = remember(
        look(healthy(LIMITS, ranges={FRONT: FAR}), driving(near={"x/y": Near(distance_mm=1, seen_ns=1)}), LIMITS), 0.02
    )
    assert kept == {"x/y": Near(distance_mm=1, seen_ns=1)}

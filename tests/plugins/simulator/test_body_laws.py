"""The body behind the pins: brakes never accelerate, a disabled bridge only coasts, motors follow their duty."""

from __future__ import annotations

from dataclasses import replace

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from chairward_simulator.body import NO_PINS, Body, BodyLaw, Bridge, Pins, pins_from

LAW = BodyLaw()
speeds = st.floats(-900.0, 900.0)
turns = st.floats(-80.0, 80.0)
steps = st.floats(0.001, 0.1)
duties = st.floats(0.0, 1.0)
bridges = st.builds(lambda d, a, b: Bridge(duty=d, in1=a, in2=b), duties, st.booleans(), st.booleans())


def body(speed: float = 0.0, turn: float = 0.0) -> Body:
    return Body(x_mm=0.0, y_mm=0.0, heading_deg=0.0, speed_mm_s=speed, turn_deg_s=turn)


def run(start: Body, pins: Pins, seconds: float, law: BodyLaw = LAW) -> Body:
    for _ in range(round(seconds / 0.005)):
        start = start.step(pins, 0.005, law)
    return start


@settings(deadline=None)
@given(speed=speeds, turn=turns, dt=steps, drive=bridges, steer=bridges)
def test_parking_brake_only_ever_slows_whatever_the_bridges_say(speed, turn, dt, drive, steer) -> None:
    after = body(speed, turn).step(Pins(drive=drive, steer=steer, brake=True), dt, LAW)
    assert abs(after.speed_mm_s) <= abs(speed)
    assert abs(after.turn_deg_s) <= abs(turn)
    assert after.speed_mm_s * speed >= 0.0


@settings(deadline=None)
@given(speed=speeds, turn=turns, dt=steps, duty=st.floats(0.01, 1.0), both=st.booleans())
def test_short_brake_only_ever_slows_on_the_level(speed, turn, dt, duty, both) -> None:
    short = Bridge(duty=duty, in1=both, in2=both)
    after = body(speed, turn).step(Pins(drive=short, steer=short), dt, LAW)
    assert abs(after.speed_mm_s) <= abs(speed)
    assert abs(after.turn_deg_s) <= abs(turn)
    assert after.speed_mm_s * speed >= 0.0


@settings(deadline=None)
@given(speed=speeds, turn=turns, dt=steps, in1=st.booleans(), in2=st.booleans())
def test_disabled_bridge_coasts_losing_no_more_than_friction(speed, turn, dt, in1, in2) -> None:
    off = Bridge(duty=0.0, in1=in1, in2=in2)
    after = body(speed, turn).step(Pins(drive=off, steer=off), dt, LAW)
    lost = abs(speed) - abs(after.speed_mm_s)
    assert 0.0 <= lost <= LAW.drive.coast * dt + 1e-9


def test_coasting_rolls_much_further_than_short_brake_and_brake_stops_shortest() -> None:
    ways = [run(body(500.0), pins, 4.0).x_mm for pins in (NO_PINS, Pins(drive=Bridge(duty=1.0)), Pins(brake=True))]
    assert ways[0] == pytest.approx(500.0**2 / (2 * 200.0), rel=0.02)
    assert ways[0] > 5 * ways[1] > 5 * ways[2]
    assert all(
        run(body(500.0), pins, 4.0).speed_mm_s == pytest.approx(0.0, abs=0.1) for pins in (NO_PINS, Pins(brake=True))
    )


@settings(deadline=None)
@given(duty=st.floats(0.05, 1.0), forward=st.booleans())
def test_motor_settles_at_its_share_of_full_speed(duty, forward) -> None:
    after = run(body(), Pins(drive=Bridge(duty=duty, in1=forward, in2=not forward)), 1.0)
    assert after.speed_mm_s == pytest.approx((700.0 if forward else -700.0) * duty, rel=0.01)
    assert after.heading_deg == 0.0


def test_steering_motor_turns_left_on_in1_and_right_on_in2() -> None:
    left = run(body(), Pins(steer=Bridge(duty=0.5, in1=True)), 1.0)
    right = run(body(), Pins(steer=Bridge(duty=0.5, in2=True)), 1.0)
    assert left.turn_deg_s == pytest.approx(30.0, rel=0.01)
    assert right.heading_deg == pytest.approx(-left.heading_deg)
    assert left.x_mm == left.y_mm == 0.0


def test_driving_and_turning_is_a_circle() -> None:
    after = run(body(), Pins(drive=Bridge(duty=0.5, in1=True), steer=Bridge(duty=0.5, in1=True)), 0.5)
    settled = after
    for _ in range(2400):  # 12 s at 30 deg/s: once round
        settled = settled.step(Pins(drive=Bridge(duty=0.5, in1=True), steer=Bridge(duty=0.5, in1=True)), 0.005, LAW)
    assert settled.x_mm == pytest.approx(after.x_mm, abs=8.0)
    assert settled.y_mm == pytest.approx(after.y_mm, abs=8.0)


def test_slope_rolls_an_unbraked_chair_and_the_brake_holds_it() -> None:
    steep = replace(LAW, slope_percent=5.0)
    assert run(body(), NO_PINS, 1.0, steep).speed_mm_s < -200.0
    assert run(body(), Pins(brake=True), 1.0, steep).speed_mm_s == 0.0
    gentle = replace(LAW, slope_percent=1.0)
    assert run(body(), NO_PINS, 1.0, gentle).speed_mm_s == 0.0


@settings(deadline=None)
@given(speed=speeds, turn=turns, dt=steps, drive=bridges, steer=bridges, brake=st.booleans())
def test_motion_is_never_faster_than_full_or_than_before(speed, turn, dt, drive, steer, brake) -> None:
    after = body(speed, turn).step(Pins(drive=drive, steer=steer, brake=brake), dt, LAW)
    assert abs(after.speed_mm_s) <= max(abs(speed), 700.0) + 1e-6
    assert abs(after.turn_deg_s) <= max(abs(turn), 60.0) + 1e-6
    assert -180.0 <= after.heading_deg <= 180.0


def test_pins_are_read_by_name_and_a_missing_one_is_an_error() -> None:
    values = dict.fromkeys(
        ("drive_duty", "drive_in1", "drive_in2", "steer_duty", "steer_in1", "steer_in2", "brake"), 0.0
    )
    assert pins_from(values) == NO_PINS
    assert pins_from({**values, "drive_duty": 1.5, "drive_in1": 1.0}).drive == Bridge(duty=1.0, in1=True)
    del values["brake"]
    with pytest.raises(KeyError, match="brake"):
        pins_from(values)

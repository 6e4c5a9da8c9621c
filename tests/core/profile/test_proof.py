"""The proof of distances: what is proven can be driven, and what cannot be stopped in time is refused."""

from __future__ import annotations

import re
from math import inf

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from msgspec.structs import astuple

from chairward.envelope import Caps
from chairward.facts import Limits
from chairward.profile import ProfileError
from chairward.profile.models import PROTECTED_MM, LimitsTable, StoppingTable
from chairward.profile.proof import Proof, allowed_mm_s, largest_mm_s, needed_mm, prove, reaction_s
from chairward.stopping import G_MM_S2, decel_on_slope_mm_s2

HERE = "chairs/x.toml: {}".format
REACTION, DECEL, CLOSING = st.floats(0.02, 1.5), st.floats(20, 3000), st.floats(0, 2000)


def way_until_standing(speed: float, reaction: float, decel: float, closing: float) -> float:
    """Slow and obvious: step through time until the chair stands."""
    dt, t, way = 0.0005, 0.0, 0.0
    while speed > 0.0:
        way += (speed + closing) * dt
        t += dt
        if t > reaction:
            speed -= decel * dt
    return way


@pytest.mark.parametrize(
    ("speed", "reaction", "decel", "closing"),
    [(500, 0.45, 600, 0), (500, 0.45, 600, 800), (1250, 0.3, 1000, 0), (100, 0.1, 2000, 1500)],
)
def test_what_is_needed_is_what_a_stopping_chair_covers(
    speed: float, reaction: float, decel: float, closing: float
) -> None:
    assert needed_mm(speed, reaction, decel, closing) == pytest.approx(
        way_until_standing(speed, reaction, decel, closing), rel=0.01, abs=3
    )


@settings(deadline=None)
@given(room=st.floats(0, 10_000), reaction=REACTION, decel=DECEL, closing=CLOSING)
def test_the_largest_speed_fits_and_the_next_does_not(
    room: float, reaction: float, decel: float, closing: float
) -> None:
    best = largest_mm_s(room, reaction, decel, closing)
    assert best >= 0
    if best > 0:
        assert needed_mm(best, reaction, decel, closing) <= room + 1e-6
    assert needed_mm(best + 1, reaction, decel, closing) > room - 1e-6


def test_the_shipped_figures_hold() -> None:
    proof = prove(LimitsTable(), StoppingTable(closing_mm_s=0), 200, HERE)
    assert proof.reaction_s == pytest.approx(0.45)
    assert proof.needed_mm == pytest.approx(225 + 208.3, abs=0.1)
    assert proof.nearest_mm >= PROTECTED_MM


@pytest.mark.parametrize("key", ["forward_mm_s", "arc_mm_s", "backward_mm_s"])
def test_a_speed_that_does_not_fit_is_refused_with_the_largest_that_does(key: str) -> None:
    stopping = StoppingTable(decel_mm_s2=600, sensor_range_mm=1200)
    limits = LimitsTable.model_validate({"forward_mm_s": 1, "arc_mm_s": 1, "backward_mm_s": 1, key: 500})
    if key == "arc_mm_s":
        limits = limits.model_copy(update={"forward_mm_s": 500})
        key = "forward_mm_s"
    with pytest.raises(ProfileError) as caught:
        prove(limits, stopping, 200, HERE, sees_behind=True)
    message = str(caught.value)
    assert message.startswith(f"chairs/x.toml: {key} = 500: the chair needs ")
    fits = int(message.split("at most ")[1].split()[0])
    small = limits.model_copy(update=dict.fromkeys(("forward_mm_s", "arc_mm_s", "backward_mm_s"), fits))
    prove(small, stopping, 200, HERE, sees_behind=True)
    with pytest.raises(ProfileError):
        prove(small.model_copy(update={key: fits + 1}), stopping, 200, HERE, sees_behind=True)


def test_where_no_speed_fits_that_is_said() -> None:
    with pytest.raises(ProfileError, match="no speed fits: a sensor that sees farther is needed"):
        prove(LimitsTable(), StoppingTable(sensor_range_mm=650), 200, HERE)


def test_a_slope_on_which_the_chair_cannot_stop_is_refused() -> None:
    with pytest.raises(ProfileError, match=r"^chairs/x\.toml: slope_percent = 10: .* lower slope_percent"):
        prove(LimitsTable(), StoppingTable(decel_mm_s2=900, slope_percent=10), 200, HERE)


def test_a_crawl_that_comes_too_near_is_refused() -> None:
    stopping = StoppingTable(decel_mm_s2=600, slope_percent=5, watchdog_ms=500)
    with pytest.raises(ProfileError, match=r"crawl_mm_s = 100: .* raise stop_mm to \d+ or lower crawl_mm_s") as caught:
        prove(LimitsTable(crawl_mm_s=100, forward_mm_s=100), stopping, 200, HERE)
    enough = int(str(caught.value).split("raise stop_mm to ")[1].split()[0])
    raised = LimitsTable(crawl_mm_s=100, forward_mm_s=100, stop_mm=enough, avoid_mm=1000, near_loss_mm=1000)
    assert prove(raised, stopping, 200, HERE).nearest_mm >= PROTECTED_MM


def test_a_sensor_that_errs_too_much_is_refused_with_the_stop_distance_it_needs() -> None:
    with pytest.raises(ProfileError, match=r"stop_mm = 600: .* raise stop_mm to \d+$"):
        prove(LimitsTable(), StoppingTable(sensor_error_mm=150), 200, HERE)


def test_the_proof_holds_in_the_files_too_and_blames_the_file_that_set_the_value(house) -> None:
    house.chair["limits"]["forward_mm_s"] = 1200
    assert house.refused().startswith("chairs/test.toml: limits.forward_mm_s = 1200: the chair needs ")
    house.person["limits"] = {"forward_mm_s": 1100}
    assert house.refused().startswith("people/asha.toml: limits.forward_mm_s = 1100: ")
    assert house.refused("limits.forward_mm_s=1000").startswith("--set limits.forward_mm_s = 1000: ")
    assert house.load("limits.forward_mm_s=500").limits.forward_mm_s == 500
    house.chair["stopping"]["slope_percent"] = 30
    assert house.refused().startswith("chairs/test.toml: stopping.slope_percent = 30: ")


@pytest.mark.parametrize(
    ("limits", "stopping"),
    [
        (LimitsTable(), StoppingTable(closing_mm_s=0)),
        (LimitsTable(forward_mm_s=900), StoppingTable(closing_mm_s=0, decel_mm_s2=900, sensor_error_mm=80)),
        (LimitsTable(forward_mm_s=300), StoppingTable(decel_mm_s2=700, slope_percent=4, watchdog_ms=400)),
        (LimitsTable(stop_mm=700, avoid_mm=900, forward_mm_s=700), StoppingTable(decel_mm_s2=1200)),
        (LimitsTable(forward_mm_s=900), StoppingTable(decel_mm_s2=2000, watchdog_ms=0, closing_mm_s=0)),
    ],
)
def test_what_is_proven_is_how_near_a_chair_under_the_rules_comes(limits: LimitsTable, stopping: StoppingTable) -> None:
    """Slow and obvious: every instant at which the guard may die is driven to its end, with a finer step."""
    proof = prove(limits, stopping, 200, HERE)
    a, watchdog = decel_on_slope_mm_s2(stopping.decel_mm_s2, stopping.slope_percent), stopping.watchdog_ms / 1000
    inside = Limits(
        stop_mm=limits.stop_mm,
        reaction_s=reaction_s(200, stopping),
        decel_mm_s2=a,
        caps=Caps(limits.forward_mm_s, 0.0, 0.0, 0.0),
    )
    dt, speed, distance = 0.004, float(limits.forward_mm_s), float(stopping.sensor_range_mm)
    late = [distance] * round((inside.reaction_s - watchdog) / dt)
    nearest = distance
    for step in range(6000):
        late.append(distance)
        allowed = allowed_mm_s(late.pop(0) + stopping.sensor_error_mm, speed, inside)
        allowed = min(allowed, limits.forward_mm_s)
        speed = max(speed - a * dt, allowed) if allowed < speed else min(speed + limits.accel_mm_s2 * dt, allowed)
        distance -= speed * dt
        nearest = min(nearest, distance if step % 10 else distance_when_the_guard_dies(distance, speed, watchdog, a))
    assert speed == 0.0, "it arrives"
    assert nearest == pytest.approx(proof.nearest_mm, abs=8.0)
    assert nearest >= PROTECTED_MM


def distance_when_the_guard_dies(distance: float, speed: float, watchdog: float, decel: float) -> float:
    dt, t = 0.002, 0.0
    while speed > 0.0:
        distance -= speed * dt
        t += dt
        if t > watchdog:
            speed -= decel * dt
    return distance


def test_a_chair_that_creeps_arrives_in_bounded_time() -> None:
    slow = LimitsTable(forward_mm_s=100, accel_mm_s2=50)
    assert prove(slow, StoppingTable(decel_mm_s2=100, closing_mm_s=0), 200, HERE).nearest_mm >= PROTECTED_MM


@pytest.mark.parametrize(
    ("limits", "stopping", "freshness_ms", "proof", "said"),
    [
        (
            LimitsTable(),
            StoppingTable(closing_mm_s=0),
            200,
            Proof(reaction_s=0.45, decel_mm_s2=600.0, needed_mm=433.33, room_mm=1_900.0, nearest_mm=520.46),
            "stops in 433 of 1900 mm (reaction 450 ms, 600 mm/s²), never nearer than 520 mm",
        ),
        (
            LimitsTable(forward_mm_s=900, crawl_mm_s=50),
            StoppingTable(closing_mm_s=0, decel_mm_s2=900, sensor_error_mm=80, watchdog_ms=150),
            150,
            Proof(reaction_s=0.35, decel_mm_s2=900.0, needed_mm=765.0, room_mm=1_900.0, nearest_mm=497.49),
            "stops in 765 of 1900 mm (reaction 350 ms, 900 mm/s²), never nearer than 497 mm",
        ),
        (
            LimitsTable(forward_mm_s=300, accel_mm_s2=200),
            StoppingTable(decel_mm_s2=700, slope_percent=4, watchdog_ms=0, closing_mm_s=100),
            100,
            Proof(reaction_s=0.15, decel_mm_s2=307.73, needed_mm=303.72, room_mm=1_900.0, nearest_mm=535.41),
            "stops in 304 of 1900 mm (reaction 150 ms, 308 mm/s²), never nearer than 535 mm",
        ),
    ],
)
def test_the_figures_of_a_proof_do_not_change_unnoticed(
    limits: LimitsTable, stopping: StoppingTable, freshness_ms: int, proof: Proof, said: str
) -> None:
    found = prove(limits, stopping, freshness_ms, HERE)
    assert astuple(found) == pytest.approx(astuple(proof), abs=0.006)
    assert str(found) == said


@pytest.mark.parametrize(
    ("limits", "stopping", "said"),
    [
        (
            LimitsTable(),
            StoppingTable(sensor_range_mm=1_200),
            "forward_mm_s = 500: the chair needs 1460 mm to stop (reaction 450 ms, 600 mm/s² on the slope, somebody "
            "coming at 800 mm/s), but from first sight at 1200 mm to stop_mm = 600 it has 600 mm: at most 127 fits",
        ),
        (
            LimitsTable(crawl_mm_s=100, forward_mm_s=100),
            StoppingTable(decel_mm_s2=600, slope_percent=5, watchdog_ms=500),
            "crawl_mm_s = 100: driving at a wall the chair could come as near as 429 mm (reaction 750 ms, 110 mm/s², "
            "readings wrong by 50 mm), allowed is 450: raise stop_mm to 621 or lower crawl_mm_s",
        ),
        (
            LimitsTable(),
            StoppingTable(sensor_error_mm=150),
            "stop_mm = 600: driving at a wall the chair could come as near as 420 mm (reaction 450 ms, 600 mm/s², "
            "readings wrong by 150 mm), allowed is 450: raise stop_mm to 630",
        ),
    ],
)
def test_a_refusal_says_in_one_sentence_what_was_found_and_what_to_do(
    limits: LimitsTable, stopping: StoppingTable, said: str
) -> None:
    with pytest.raises(ProfileError) as caught:
        prove(limits, stopping, 200, HERE)
    assert str(caught.value) == f"chairs/x.toml: {said}"


def test_what_fits_exactly_is_not_refused() -> None:
    stopping = StoppingTable(closing_mm_s=0, decel_mm_s2=500, sensor_range_mm=1_075)
    assert needed_mm(500.0, 0.45, 500.0, 0.0) == 475.0
    assert prove(LimitsTable(), stopping, 200, HERE).room_mm == 475.0


@pytest.mark.parametrize(("reading", "speed"), [(-5.0, 0.0), (600.4, 0.0), (600.6, 60.0), (1e9, inf)])
def test_a_reading_is_a_whole_number_as_sensors_say_it(reading: float, speed: float) -> None:
    inside = Limits(stop_mm=600, reaction_s=0.45, decel_mm_s2=600.0, caps=Caps(500.0, 0.0, 0.0, 0.0))
    assert allowed_mm_s(reading, 0.0, inside) == speed


def test_a_speed_that_the_chair_has_already_counts_in_what_it_is_allowed() -> None:
    inside = Limits(stop_mm=600, reaction_s=0.45, decel_mm_s2=600.0, caps=Caps(500.0, 0.0, 0.0, 0.0))
    assert allowed_mm_s(899.0, 600.0, inside) == 0.0, "300 mm are needed from 600 mm/s"
    assert allowed_mm_s(900.0, 600.0, inside) > 0.0


def test_a_proof_is_told_to_the_millisecond_and_nobody_changes_it() -> None:
    proof = Proof(reaction_s=2.0, decel_mm_s2=600.0, needed_mm=1.0, room_mm=2.0, nearest_mm=500.0)
    assert "reaction 2000 ms" in str(proof)
    with pytest.raises(AttributeError):
        proof.reaction_s = 0.0


def test_the_stop_distance_that_is_advised_makes_up_for_what_is_missing() -> None:
    errs = StoppingTable(closing_mm_s=0).model_copy(update={"sensor_error_mm": 400})
    with pytest.raises(ProfileError) as caught:
        prove(LimitsTable(), errs, 200, HERE)
    found = re.search(r"as near as (-?\d+) mm .* raise stop_mm to (\d+)", str(caught.value))
    assert found
    near, enough = map(int, found.groups())
    assert near < PROTECTED_MM / 2
    assert enough == LimitsTable().stop_mm + PROTECTED_MM - near


def test_a_chair_that_just_keeps_the_distance_keeps_it() -> None:
    stopping = StoppingTable(closing_mm_s=0, sensor_error_mm=120)
    assert prove(LimitsTable(crawl_mm_s=60), stopping, 200, HERE).nearest_mm == PROTECTED_MM


def test_a_slope_that_takes_just_all_of_the_deceleration_is_refused() -> None:
    stopping = StoppingTable().model_copy(update={"decel_mm_s2": G_MM_S2 * 10 / 100.0, "slope_percent": 10})
    with pytest.raises(ProfileError, match="lower slope_percent or measure a larger decel_mm_s2"):
        prove(LimitsTable(), stopping, 200, HERE)


def test_a_chair_that_hardly_brakes_is_refused_for_its_speed() -> None:
    weak = StoppingTable().model_copy(update={"decel_mm_s2": 0.5})
    with pytest.raises(ProfileError, match=r"forward_mm_s = 500: the chair needs \d+ mm to stop"):
        prove(LimitsTable(), weak, 200, HERE)


def test_one_millimetre_a_second_that_fits_is_named_and_the_reaction_to_the_millisecond() -> None:
    short = StoppingTable(closing_mm_s=0, watchdog_ms=500).model_copy(update={"sensor_range_mm": 601})
    with pytest.raises(ProfileError, match=r"\(reaction 750 ms, .* at most 1 fits"):
        prove(LimitsTable(), short, 200, HERE)

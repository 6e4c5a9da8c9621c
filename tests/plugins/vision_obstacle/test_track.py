"""Confirming, carrying on and forgetting, as laws."""

from __future__ import annotations

from hypothesis import given
from hypothesis import strategies as st

from chairward_vision_obstacle.birdseye import Shift
from chairward_vision_obstacle.regions import Sighting
from chairward_vision_obstacle.track import EDGE, FORGET_S, Track, Tracked

MS = 1_000_000
STEP = Shift(33.0, 0.0)
STILL = Shift(0.0, 0.0)


def track(confirm: int = 3) -> Track:
    return Track(nearest_mm=950.0, half_width_mm=320.0, confirm=confirm)


def approached(tracker: Track, shift: Shift | None = STEP) -> tuple[int, Tracked | None]:
    """A thing seen from 1400 mm until it slips under the view at 950 mm, 33 mm a picture; (time, last answer)."""
    now_ns, found, distance = 0, None, 1400.0
    while distance > 950:
        now_ns += 66 * MS
        found = tracker.step(now_ns, Sighting(distance), shift)
        distance -= 33.0
    return now_ns, found


def test_too_few_sightings_are_nothing_and_enough_are_the_newest_distance() -> None:
    tracker = track()
    assert tracker.step(1 * MS, Sighting(1300.0), STILL) is None
    assert tracker.step(2 * MS, Sighting(1310.0), STILL) is None
    found = tracker.step(3 * MS, Sighting(1290.0), STILL)
    assert found is not None
    assert (found.ahead_mm, found.remembered) == (1290.0, False)


def test_sightings_that_disagree_are_nothing() -> None:
    tracker = track()
    for number, distance in enumerate((1300.0, 2200.0, 1300.0, 3000.0, 1800.0, 1100.0)):
        assert tracker.step(number * MS, Sighting(distance), STILL) is None


def test_what_slips_under_the_view_comes_nearer_as_the_floor_moves_and_stays_while_it_stands() -> None:
    tracker = track()
    now_ns, last = approached(tracker)
    assert last is not None
    expected = last.ahead_mm
    for _ in range(10):
        now_ns += 66 * MS
        expected -= 33.0
        found = tracker.step(now_ns, None, STEP)
        assert found is not None
        assert found.remembered
        assert abs(found.ahead_mm - expected) < 1e-6
    for _ in range(10):
        now_ns += 66 * MS
        found = tracker.step(now_ns, None, STILL)
        assert found is not None
        assert abs(found.ahead_mm - expected) < 1e-6


def test_on_a_plain_floor_the_speed_is_that_of_the_thing_itself() -> None:
    tracker = track()
    now_ns, last = approached(tracker, shift=None)
    assert last is not None
    for _ in range(6):
        now_ns += 66 * MS
        found = tracker.step(now_ns, None, None)
    assert found is not None
    assert abs(found.ahead_mm - (last.ahead_mm - 6 * 33.0)) < 25


def test_it_is_forgotten_when_backed_away_from_turned_from_or_long_past() -> None:
    for shift, pictures in ((Shift(-33.0, 0.0), 20), (Shift(0.0, 40.0), 20), (STILL, round(FORGET_S / 0.066) + 20)):
        tracker = track()
        now_ns, found = approached(tracker)
        assert found is not None
        for _ in range(pictures):
            now_ns += 66 * MS
            found = tracker.step(now_ns, None, shift)
        assert found is None, shift


def test_what_vanishes_in_plain_view_is_gone_within_half_a_second() -> None:
    tracker = track()
    for number in range(5):
        tracker.step(number * 66 * MS, Sighting(1900.0), STILL)
    answers = [tracker.step((5 + number) * 66 * MS, None, STILL) for number in range(10)]
    assert answers[-1] is None
    assert not any(a is not None and a.remembered for a in answers)


def test_a_farther_thing_does_not_hide_the_one_under_the_view() -> None:
    tracker = track()
    now_ns, _ = approached(tracker)
    tracker.step(now_ns + 66 * MS, None, STEP)
    for _ in range(6):
        now_ns += 66 * MS
        found = tracker.step(now_ns, Sighting(2000.0), STILL)
    assert found is not None
    assert found.remembered
    assert found.ahead_mm < 1000


def test_what_the_pictures_edge_cuts_off_is_no_farther_than_expected() -> None:
    tracker = track()
    now_ns, last = approached(tracker)
    assert last is not None
    found = tracker.step(now_ns + 66 * MS, Sighting(960.0, cut=True), STEP)
    assert found is not None
    assert abs(found.ahead_mm - (last.ahead_mm - 33.0)) < 1e-6


sightings = st.none() | st.builds(Sighting, ahead_mm=st.floats(0, 4000, allow_nan=False), cut=st.booleans())
shifts = st.none() | st.builds(Shift, st.floats(-60, 60), st.floats(-60, 60))


@given(st.lists(st.tuples(st.integers(1, 300), sightings, shifts), max_size=60), st.integers(1, 5))
def test_whatever_happens_answers_are_distances_that_somebody_saw(
    steps: list[tuple[int, Sighting | None, Shift | None]], confirm: int
) -> None:
    tracker, now_ns, seen = track(confirm), 0, 0
    for gap_ms, sighting, shift in steps:
        now_ns += gap_ms * MS
        seen += sighting is not None
        found = tracker.step(now_ns, sighting, shift)
        if found is not None:
            assert seen >= confirm
            assert found.ahead_mm >= 0
            assert found.seen_ns <= now_ns
            assert not found.remembered or found.ahead_mm <= EDGE * 950


def test_what_reaches_above_the_camera_and_is_out_of_sight_has_gone_aside_and_is_not_carried() -> None:
    tracker, now_ns = track(), 0
    for _ in range(6):
        now_ns += 66 * MS
        found = tracker.step(now_ns, Sighting(700.0, tall=True), STILL)
    assert found is not None
    for _ in range(12):
        now_ns += 66 * MS
        found = tracker.step(now_ns, None, STILL)
    assert found is None

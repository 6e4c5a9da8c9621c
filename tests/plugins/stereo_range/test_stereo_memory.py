"""What is remembered between frames, and when it is forgotten."""

from __future__ import annotations

from math import inf
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from chairward.components import Footprint
from chairward_stereo_range.drops import EdgeTrack
from chairward_stereo_range.geometry import make_view
from chairward_stereo_range.known_clear import BRIDGE_S, NEEDED_MM, KnownClear
from chairward_stereo_range.leaving import Edge, Leaving
from chairward_stereo_range.memory import BLIND_PICTURES, Memory, Seen
from chairward_stereo_range.odometry import FloorOdometry, Steady
from chairward_stereo_range.tracker import Tracker

DT_S = 1 / 15
NOTHING = np.zeros((240, 320), bool)
"""Nothing stands up."""


def approach(memory: Memory, start: float, step: float, edge: float, top: float = 120.0) -> tuple[int, float]:
    """Drive at a low thing until it goes out of view; returns the frame count and the true distance then."""
    distance, i = start, 0
    while distance > edge - step:
        memory.step(Seen(i * DT_S, distance, top), step if i else None)
        distance -= step
        i += 1
    return i, distance


@settings(max_examples=40, deadline=None)
@given(step=st.floats(12, 60), edge=st.floats(400, 1100))
def test_a_low_thing_gone_under_the_view_is_carried_by_the_odometry(step: float, edge: float) -> None:
    memory = Memory(edge, 900.0)
    i, distance = approach(memory, edge + 900.0, step, edge)
    while distance > -900.0 + step:
        kept = memory.step(Seen(i * DT_S, None, 0.0), step)
        assert kept.from_memory
        assert kept.ahead_mm == pytest.approx(max(distance, 0.0), abs=1e-6)
        distance -= step
        i += 1
    for _ in range(3):
        kept = memory.step(Seen(i * DT_S, None, 0.0), step)
        i += 1
    assert kept.ahead_mm is None, "forgotten once the chair has passed it"


def test_a_standing_chair_does_not_forget() -> None:
    memory = Memory(1000.0, 900.0)
    i, distance = approach(memory, 1800.0, 33.0, 1000.0)
    for k in range(300):
        kept = memory.step(Seen((i + k) * DT_S, None, 0.0), 0.0)
    assert kept.from_memory
    assert kept.ahead_mm == pytest.approx(distance + 33.0)


def test_where_the_floor_does_not_tell_a_low_thing_comes_on_at_its_pace_and_is_left_to_the_guard_at_last() -> None:
    memory = Memory(1000.0, 900.0)
    i, distance = approach(memory, 1800.0, 33.0, 1000.0)
    told = [memory.step(Seen((i + k) * DT_S, None, 0.0), None).ahead_mm for k in range(BLIND_PICTURES + 1)]
    for k, mm in enumerate(told[:-1]):
        assert mm == pytest.approx(max(distance - 33.0 * k, 0.0), abs=1e-6)
    assert told[-1] is None


def test_what_the_floor_never_confirmed_to_come_nearer_stays_where_it_was() -> None:
    memory = Memory(1000.0, 900.0)
    for i in range(20):
        last_mm = 1800.0 - 40.0 * i
        memory.step(Seen(i * DT_S, last_mm, 120.0), None)
    told = [memory.step(Seen((20 + k) * DT_S, None, 0.0), None).ahead_mm for k in range(2 * BLIND_PICTURES)]
    assert told == [last_mm] * len(told)


def test_backing_off_until_its_place_is_seen_again_forgets() -> None:
    memory = Memory(1000.0, 900.0)
    i, _ = approach(memory, 1800.0, 33.0, 1000.0)
    for k in range(12):
        kept = memory.step(Seen((i + k) * DT_S, None, 0.0), -33.0)
    assert kept.ahead_mm is None


def test_turning_away_forgets() -> None:
    memory = Memory(1000.0, 900.0)
    i, _ = approach(memory, 1800.0, 33.0, 1000.0)
    kept = [memory.step(Seen((i + k) * DT_S, None, 0.0), 0.0, 60.0).ahead_mm for k in range(15)]
    assert kept[3] is not None
    assert kept[-1] is None


def test_a_tall_thing_that_vanishes_went_sideways_and_is_not_remembered() -> None:
    memory = Memory(1000.0, 900.0)
    i, _ = approach(memory, 1800.0, 33.0, 1000.0, top=1500.0)
    assert memory.step(Seen(i * DT_S, None, 0.0), 33.0).ahead_mm is None


def test_noise_that_does_not_approach_is_not_remembered() -> None:
    memory = Memory(1000.0, 900.0)
    for i, mm in enumerate([1060.0, 1070.0, 1055.0, 1065.0, 1060.0]):
        memory.step(Seen(i * DT_S, mm, 80.0), 33.0)
    assert memory.step(Seen(6 * DT_S, None, 0.0), 33.0).ahead_mm is None


def test_closing_speed_is_what_is_left_after_the_chairs_own() -> None:
    own, walker = 33.0, 60.0
    standing, walking = Memory(0.0, 900.0), Memory(0.0, 900.0)
    for i in range(12):
        still = standing.step(Seen(i * DT_S, 2500.0 - own * i, 1500.0), own)
        moving = walking.step(Seen(i * DT_S, 2500.0 - (own + walker) * i, 1500.0), own)
    assert still.closing_mm_s == 0.0
    assert moving.closing_mm_s == pytest.approx(walker / DT_S, rel=0.05)


def test_the_floor_s_end_counts_when_it_is_seen_again_where_the_chair_has_come_to() -> None:
    steady, wandering = EdgeTrack(), EdgeTrack()
    told = [steady.step(i * DT_S, 1500.0 - 33.0 * i, 33.0) for i in range(3)]
    assert told == [None, 1467.0, 1434.0]
    feigned = [wandering.step(i * DT_S, 1500.0 + 400.0 * i, 33.0) for i in range(6)]
    assert feigned == [None] * 6, "what goes away from a chair that comes nearer is a mirror image"


@given(step=st.floats(26, 60), lower=st.floats(0.4, 1.0))
def test_the_floor_s_end_is_carried_for_a_while_where_it_is_not_seen_or_only_farther(step: float, lower: float) -> None:
    """lower: how fast the lower floor passes, which is all that the odometry sees once the edge is near."""
    track = EdgeTrack()
    for i in range(6):
        last = track.step(i * DT_S, 1500.0 - step * i, step)
    for i in range(6, 12):
        last = track.step(i * DT_S, None if i % 2 else 1900.0, lower * step)
        assert last is not None
        assert 1500.0 - step * i - 1.0 <= last <= 1500.0 - step * i + (1.0 - 0.99 * lower) * step * (i - 5)
    assert track.step(3.0, None, step) is None, "but not for long"


def test_an_edge_seen_twice_without_driving_at_it_is_not_carried() -> None:
    track = EdgeTrack()
    assert [track.step(i * DT_S, mm, 0.0) for i, mm in enumerate((1500.0, 1500.0, None))] == [None, 1500.0, None]


def test_one_wrong_word_of_the_floor_does_not_count() -> None:
    steady = Steady()
    told = [steady.step((mm, 0.0)) for mm in (33.0, 33.0, -120.0, 33.0, 33.0)]
    assert told[-1] == (33.0, 0.0)
    assert steady.step(None) is None


def test_a_tall_thing_of_which_a_low_part_is_seen_last_has_not_gone_under_the_view() -> None:
    memory = Memory(1000.0, 900.0)
    for i, top in enumerate([1200.0] * 12 + [200.0] * 5):
        memory.step(Seen(i * DT_S, 1580.0 - 33.0 * i, top), 33.0)
    assert memory.step(Seen(17 * DT_S, None, 0.0), 33.0).ahead_mm is None


@pytest.mark.parametrize("step", [0.0, 20.0, 45.0, -25.0])
def test_the_floor_tells_how_far_the_chair_drove(tools: Any, step: float) -> None:
    odometry = FloorOdometry(tools.finder().view)
    moved = [odometry.step(tools.render(tools.room(driven_mm=400.0 + step * i, seed=i))[0], NOTHING) for i in range(4)]
    assert moved[0] is None
    for now in moved[1:]:
        assert now is not None
        assert now[0] == pytest.approx(step, abs=9.0)
        assert now[1] == pytest.approx(0.0, abs=6.0)


def test_a_plain_floor_tells_nothing(tools: Any) -> None:
    odometry = FloorOdometry(tools.finder().view)
    moved = [
        odometry.step(tools.render(tools.room(floor="plain", driven_mm=30.0 * i, seed=i))[0], NOTHING) for i in range(3)
    ]
    assert moved == [None, None, None]


def test_what_stands_up_does_not_count_as_floor_and_with_too_little_floor_nothing_is_told(tools: Any) -> None:
    view = tools.finder().view
    told, misled, covered = FloorOdometry(view), FloorOdometry(view), FloorOdometry(view)
    floor, _ = tools.render(tools.room(driven_mm=400.0))
    stands = NOTHING.copy()
    stands[:, 140:180] = True
    misled_mm = []
    stripes = np.random.default_rng(5).integers(0, 2, (400, 40, 1), dtype=np.uint8) * np.uint8(255)
    for i in range(4):
        left = floor.copy()
        left[:, 140:180] = stripes[40 - 3 * i : 280 - 3 * i]  # comes nearer while the chair stands
        still, wrong = told.step(left, stands), misled.step(left, NOTHING)
        assert covered.step(left, ~NOTHING) is None
        if i:
            assert still == pytest.approx((0.0, 0.0), abs=6.0)
            misled_mm += [abs(wrong[0])] if wrong is not None else []
    assert misled_mm
    assert min(misled_mm) > 10.0


@pytest.mark.parametrize("mount", ["a", "b"])
def test_a_low_box_is_still_there_after_it_has_left_the_picture(tools: Any, mount: str) -> None:
    pose = tools.mount_a if mount == "a" else tools.mount_b
    tracker = Tracker(tools.finder(pose))
    box = tools.board(1900.0, left_mm=200.0, right_mm=-200.0, top_mm=150.0)
    for i in range(48):
        left, right = tools.render(tools.room((box,), driven_mm=33.0 * i, seed=i), pose=pose)
        last = tracker.step(left, right, int(i * DT_S * 1e9))
    truth = 1900.0 - 47 * 33.0
    assert truth - 200.0 <= last.ahead_mm <= truth + 50.0, "never farther than it is; things above the floor hasten it"


@pytest.mark.parametrize("mount", ["a", "b"])
def test_a_step_down_is_still_there_after_it_has_left_the_picture(tools: Any, mount: str) -> None:
    pose = tools.mount_a if mount == "a" else tools.mount_b
    tracker = Tracker(tools.finder(pose))
    for i in range(48):
        room = tools.room(floor_to_mm=2000.0, floor_below_mm=250.0, driven_mm=33.0 * i, seed=i)
        last = tracker.step(*tools.render(room, pose=pose), int(i * DT_S * 1e9))
    assert last.ahead_mm <= 600.0


def leaving(tools: Any) -> Leaving:
    """For a way of 640 mm, the floor looked at 1800 mm before the axle; 600 mm ahead the pair shows 319 to -269 mm."""
    view = make_view(tools.geometry(), tools.mount_a, Footprint(front_mm=0.0, rear_mm=900.0, half_width_mm=300.0))
    return Leaving(view, 320.0, 0, 240.0, 1800.0)


def drive_at(memory: Leaving, left_mm: float, step: float, until: float) -> float:
    """Drive at a thing from 1100 mm until it is so near; returns how near it is now."""
    distance = 1100.0
    while distance > until:
        assert memory.step(Edge(distance, left_mm), step, 0.0) is None, "what is seen is told as it is seen"
        distance -= step
    return distance


@settings(max_examples=40, deadline=None)
@given(step=st.floats(5, 45), side=st.sampled_from([280.0, -280.0]), other=st.sampled_from([None, 300.0, 2000.0]))
def test_a_thing_gone_out_of_view_sideways_is_carried_until_it_is_passed(
    tools: Any, step: float, side: float, other: float | None
) -> None:
    memory = leaving(tools)
    distance = drive_at(memory, side, step, 600.0)
    while distance > -800.0:
        beyond = None if other is None else Edge(max(distance, 0.0) + other, 0.0)
        assert memory.step(beyond, step, 0.0) == pytest.approx(max(distance, 0.0), abs=1e-6)
        distance -= step
    for _ in range(60):
        told = memory.step(None, step, 0.0)
    assert told is None, "forgotten once the chair has passed it"


def test_a_thing_gone_from_the_middle_of_the_view_has_really_gone(tools: Any) -> None:
    memory = leaving(tools)
    drive_at(memory, 20.0, 30.0, 700.0)
    assert memory.step(None, 30.0, 0.0) is None


def test_a_thing_gone_sideways_that_the_chair_has_turned_away_from_is_beside_the_way(tools: Any) -> None:
    memory = leaving(tools)
    drive_at(memory, 280.0, 30.0, 600.0)
    told = [memory.step(None, 0.0, 20.0) for _ in range(10)]
    assert told[0] is not None
    assert told[-1] is None


def test_a_thing_gone_sideways_is_forgotten_when_its_place_is_seen_again(tools: Any) -> None:
    memory = leaving(tools)
    drive_at(memory, 280.0, 30.0, 600.0)
    told = [memory.step(None, -30.0, 0.0) for _ in range(12)]
    assert told[0] is not None
    assert told[-1] is None


def test_over_a_plain_floor_a_thing_gone_sideways_comes_on_at_its_own_pace(tools: Any) -> None:
    memory = leaving(tools)
    distance = 1100.0
    while distance > 600.0:
        memory.step(Edge(distance, 280.0), None, 0.0)
        distance -= 30.0
    told = [memory.step(None, None, 0.0) for _ in range(10)]
    assert told[-1] is not None
    assert told[-1] == pytest.approx(distance - 9 * 30.0, abs=60.0)


def test_a_table_top_that_has_gone_over_the_pictures_top_is_still_there(tools: Any) -> None:
    tracker = Tracker(tools.finder())
    table = tools.board(1500.0, bottom_mm=640.0, top_mm=760.0)
    behind = tools.board(2100.0, left_mm=60.0, right_mm=-60.0)
    last = None
    for i in range(31):
        left, right = tools.render(tools.room((table, behind), driven_mm=33.0 * i, seed=i))
        last = tracker.step(left, right, int(i * DT_S * 1e9))
    assert last is not None
    assert last.ahead_mm == pytest.approx(1500.0 - 30 * 33.0, abs=60.0)


def after_a_clear_second(ahead_mm: float) -> KnownClear:
    """A way that was measured clear for a second, with the nearest thing at ahead_mm."""
    known = KnownClear()
    for i in range(15):
        assert not known.step(i * DT_S, True, ahead_mm, 33.0), "nothing is put off while there is no doubt"
    return known


def test_a_doubt_of_a_moment_on_a_known_way_is_put_off_for_a_bounded_time() -> None:
    known = after_a_clear_second(inf)
    answers = [known.step((15 + i) * DT_S, False, inf, 33.0) for i in range(30)]
    assert answers[0]
    until = answers.index(False)
    assert (until + 1) * DT_S <= BRIDGE_S + DT_S
    assert not any(answers[until:])


@given(ahead_mm=st.floats(0, 3000), driven_mm=st.floats(0, 200))
def test_no_doubt_is_put_off_beyond_the_way_that_was_measured(ahead_mm: float, driven_mm: float) -> None:
    known = after_a_clear_second(ahead_mm)
    for i in range(1, 7):
        if known.step((14 + i) * DT_S, False, inf, driven_mm):
            assert ahead_mm - i * driven_mm >= NEEDED_MM


def test_the_way_is_not_known_at_the_start_nor_after_turning_nor_to_who_doubts_most_of_the_time() -> None:
    assert not KnownClear().step(0.0, False, inf, 0.0)
    turned = after_a_clear_second(inf)
    assert not turned.step(15 * DT_S, False, inf, 33.0, sideways_mm=200.0)
    doubtful = KnownClear()
    assert not any(doubtful.step(i * DT_S, i % 3 == 0, inf, 33.0) for i in range(3, 60))


def test_without_the_floor_s_word_the_known_way_shrinks_at_full_speed() -> None:
    known = after_a_clear_second(NEEDED_MM + 100.0)
    assert known.step(15 * DT_S, False, inf, None)
    assert not known.step(17 * DT_S, False, inf, None)


def test_the_way_is_known_up_to_the_thing_that_ended_it_though_the_floor_tells_too_much() -> None:
    known = after_a_clear_second(NEEDED_MM + 200.0)
    assert all(known.step((15 + i) * DT_S, False, NEEDED_MM + 167.0 - 33.0 * i, 80.0) for i in range(5))
    another = after_a_clear_second(NEEDED_MM + 200.0)
    assert not all(another.step((15 + i) * DT_S, False, NEEDED_MM + 900.0, 80.0) for i in range(5)), "that is another"

"""The default method: what it sees, what it does not stop for, and what it says when it cannot tell."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from chairward.components import Bench, Context, Pose, Processor
from chairward.messages import NOTHING_NEAR_MM, RangeReading
from chairward.stages import DisparityMap, FloorMap, ObstacleMap, RectifiedPair, StereoFrame
from chairward_vision_obstacle.plugin import chairward_sensors, make
from chairward_vision_obstacle.settings import VisionObstacleSettings

RED, GREY, DARK = (40, 40, 200), (128, 128, 128), (15, 15, 15)


def test_a_free_floor_is_free(stage: Processor, worlds: SimpleNamespace) -> None:
    reading = worlds.stand(stage, worlds.World())
    assert reading.can_see
    assert reading.ahead_mm == reading.left_mm == reading.right_mm == NOTHING_NEAR_MM
    assert reading.reason == "freest way straight on"


@pytest.mark.parametrize("ahead_mm", [1100, 1400, 1900])
def test_a_box_is_seen_where_it_meets_the_floor(stage: Processor, worlds: SimpleNamespace, ahead_mm: int) -> None:
    reading = worlds.stand(stage, worlds.World([worlds.Thing(ahead_mm, 300, 400, RED)]))
    assert reading.ahead_mm == pytest.approx(ahead_mm, rel=0.06)


@pytest.mark.parametrize(("error", "expected_mm"), [(1.25, 1500), (0.85, 1275), (2.0, NOTHING_NEAR_MM)])
def test_the_nearer_of_floor_and_stereo_counts_and_both_must_agree(
    stage: Processor, worlds: SimpleNamespace, error: float, expected_mm: int
) -> None:
    for number in range(1, 9):
        bench = worlds.World([worlds.Thing(1500, 300, 400, RED)]).see(0.0, number)
        right = bench.get(DisparityMap)
        bench.put(replace(right, disparity_px=right.disparity_px / np.float32(error)))
        (reading,) = stage.process(bench)
    assert isinstance(reading, RangeReading)
    assert reading.ahead_mm == pytest.approx(expected_mm, rel=0.06)


def test_a_box_beside_the_way_is_not_ahead(stage: Processor, worlds: SimpleNamespace) -> None:
    reading = worlds.stand(stage, worlds.World([worlds.Thing(1500, 300, 400, RED, left_mm=700)]))
    assert reading.ahead_mm == NOTHING_NEAR_MM
    assert reading.left_mm < reading.right_mm == NOTHING_NEAR_MM


def test_one_picture_is_not_believed(stage: Processor, worlds: SimpleNamespace) -> None:
    worlds.stand(stage, worlds.World())
    reading = worlds.stand(stage, worlds.World([worlds.Thing(1500, 300, 400, RED)]), pictures=1, first=9)
    assert reading.ahead_mm == NOTHING_NEAR_MM
    reading = worlds.stand(stage, worlds.World([worlds.Thing(1500, 300, 400, RED)]), pictures=2, first=10)
    assert reading.ahead_mm < 2000


@pytest.mark.parametrize(
    "paint",
    [
        (1200, 900, 0, (60, 70, 75), 800),  # a shadow: the floor's colour, half as bright
        (1200, 500, 0, (250, 250, 250), 400),  # glare
        (1100, 700, 0, (150, 40, 90), 1000),  # a rug
        (1300, 640, 0, DARK, 200),  # a dark mat
    ],
)
def test_what_lies_flat_does_not_stop_the_chair(
    stage: Processor, worlds: SimpleNamespace, paint: tuple[float, ...]
) -> None:
    readings = worlds.drive(stage, worlds.World([worlds.Thing(*paint)]), 0, 1400)
    assert {r.ahead_mm for _, r in readings} == {NOTHING_NEAR_MM}
    assert all(r.can_see for _, r in readings)


def test_a_tiled_floor_with_dark_joints_is_floor(stage: Processor, worlds: SimpleNamespace) -> None:
    joints = [worlds.Thing(d, 3000, 0, (60, 70, 75), 20) for d in range(300, 5000, 300)]
    readings = worlds.drive(stage, worlds.World(joints), 0, 900)
    assert all(r.ahead_mm > 600 for _, r in readings)


@pytest.mark.parametrize("height_mm", [100, 120])
def test_a_low_box_is_stopped_for_though_it_is_under_the_view_by_then(
    stage: Processor, worlds: SimpleNamespace, height_mm: int
) -> None:
    readings = worlds.drive(stage, worlds.World([worlds.Thing(2000, 300, height_mm, RED)]), 500, 1900)
    stop_at = next(2000 - driven for driven, r in readings if r.ahead_mm <= 600)
    assert 480 <= stop_at <= 720
    assert any("under the camera's view" in r.reason for _, r in readings)


def test_a_cable_is_stopped_for(stage: Processor, worlds: SimpleNamespace) -> None:
    cable = worlds.Thing(2000, 1200, 0, DARK, 20)
    readings = worlds.drive(stage, worlds.World([cable]), 500, 1900)
    stop_at = next(2000 - driven for driven, r in readings if r.ahead_mm <= 600)
    assert 480 <= stop_at <= 720


def test_what_is_under_the_view_is_forgotten_when_the_chair_has_backed_off(
    stage: Processor, worlds: SimpleNamespace
) -> None:
    world = worlds.World([worlds.Thing(2000, 300, 120, RED)])
    there = worlds.drive(stage, world, 600, 1400)
    assert there[-1][1].ahead_mm <= 700
    free = worlds.World()
    for number, driven_mm in enumerate(np.arange(1400, 750, -33.3), start=len(there) + 1):
        (reading,) = stage.process(free.see(float(driven_mm), number))
    assert isinstance(reading, RangeReading)
    assert reading.ahead_mm == NOTHING_NEAR_MM


def test_a_floor_known_in_one_light_is_known_again_after_another(context: Context, worlds: SimpleNamespace) -> None:
    stage = make(VisionObstacleSettings(), context)
    worlds.stand(stage, worlds.World(), 10)
    worlds.stand(stage, worlds.World(light=0.55), 60, first=11)
    bench = worlds.World().see(0.0, 71)
    empty = FloorMap(
        floor=np.zeros((240, 320), np.bool_),
        obstacle=np.zeros((240, 320), np.bool_),
        horizon_row=48.0,
        captured_ns=bench.get(FloorMap).captured_ns,
    )
    bench.put(empty)  # stereo says nothing now: the floor must be recognised by its look alone
    stage.process(bench)
    mask = bench.get(ObstacleMap)
    assert mask is not None
    assert mask.mask[120:, 60:260].mean() < 0.05


def test_an_obstacle_standing_in_front_from_the_start_does_not_become_floor(
    stage: Processor, worlds: SimpleNamespace
) -> None:
    world = worlds.World([worlds.Thing(1000, 500, 500, RED)])
    reading = worlds.stand(stage, world)
    bench = world.see(0.0, 9)
    stage.process(bench)
    mask = bench.get(ObstacleMap)
    assert mask is not None
    assert mask.mask[120:180, 130:190].mean() > 0.95
    assert reading.ahead_mm is not None
    assert reading.ahead_mm < 1100


def test_a_cable_that_lies_there_for_long_is_not_learned_as_floor(stage: Processor, worlds: SimpleNamespace) -> None:
    reading = worlds.stand(stage, worlds.World([worlds.Thing(1300, 1200, 0, DARK, 20)]), pictures=120)
    assert reading.ahead_mm == pytest.approx(1300, rel=0.06)


def test_before_any_floor_was_seen_it_cannot_see(stage: Processor, worlds: SimpleNamespace) -> None:
    bench = worlds.World([worlds.Thing(200, 3000, 2000, GREY)]).see()
    (reading,) = stage.process(bench)
    assert isinstance(reading, RangeReading)
    assert not reading.can_see
    assert reading.ahead_mm is None
    assert "has not seen enough floor yet" in reading.reason


@pytest.mark.parametrize(("light", "reason"), [(0.04, "too dark"), (40.0, "too bright")])
def test_in_the_dark_and_in_glare_it_cannot_see(
    stage: Processor, worlds: SimpleNamespace, light: float, reason: str
) -> None:
    worlds.stand(stage, worlds.World())
    reading = worlds.stand(stage, worlds.World(light=light), pictures=1, first=9)
    assert not reading.can_see
    assert reason in reading.reason


def test_without_stereo_before_it_it_says_what_to_do(stage: Processor, worlds: SimpleNamespace) -> None:
    full = worlds.World().see()
    bench = Bench()
    bench.put(full.get(StereoFrame))
    (reading,) = stage.process(bench)
    assert isinstance(reading, RangeReading)
    assert not reading.can_see
    assert "put stereo_range before vision_obstacle" in reading.reason
    assert list(stage.process(Bench())) == []


def test_a_floor_map_of_another_picture_is_not_used(stage: Processor, worlds: SimpleNamespace) -> None:
    bench, old = worlds.World().see(0.0, 2), worlds.World().see(0.0, 1)
    bench.put(old.get(FloorMap))
    (reading,) = stage.process(bench)
    assert isinstance(reading, RangeReading)
    assert not reading.can_see


def test_without_a_mount_it_says_what_to_do(context: Context, worlds: SimpleNamespace) -> None:
    unmounted = Context(lane="front", run_dir=context.run_dir, chair_dir=context.chair_dir, pose=Pose())
    (reading,) = make(VisionObstacleSettings(), unmounted).process(worlds.World().see())
    assert isinstance(reading, RangeReading)
    assert not reading.can_see
    assert "pose.z_mm" in reading.reason


def test_the_mount_of_the_pictures_themselves_comes_before_the_chair_files(
    context: Context, worlds: SimpleNamespace
) -> None:
    world = worlds.World([worlds.Thing(1400, 300, 400, RED)])

    def last(chair: Pose, pictures: Pose | None) -> RangeReading:
        stage = make(VisionObstacleSettings(), replace(context, pose=chair))
        for number in range(1, 9):
            bench = world.see(0.0, number)
            pair = bench.get(RectifiedPair)
            assert pair is not None
            bench.put(replace(pair, pose=pictures))
            (reading,) = stage.process(bench)
        assert isinstance(reading, RangeReading)
        return reading

    assert last(Pose(x_mm=450.0), worlds.pose).ahead_mm == pytest.approx(1400, rel=0.06)
    unknown = last(worlds.pose, Pose(x_mm=450.0))
    assert not unknown.can_see
    assert "no floor has been found" in unknown.reason


def test_pictures_and_mask_have_the_pictures_size_and_the_clock_of_the_frame(
    stage: Processor, worlds: SimpleNamespace
) -> None:
    bench = worlds.World([worlds.Thing(1500, 300, 400, RED)]).see(0.0, 5)
    (reading,) = stage.process(bench)
    mask = bench.get(ObstacleMap)
    pair = bench.get(RectifiedPair)
    assert mask is not None
    assert mask.mask.shape == (240, 320)
    assert bench.panes["obstacle"].image.shape == (240, 320, 3)
    assert mask.captured_ns == bench.panes["obstacle"].captured_ns == reading.captured_ns == pair.captured_ns
    assert reading.seq == 5


@pytest.mark.parametrize("method", ["thesis_text", "thesis_code"])
def test_thesis_modes_give_a_mask_to_the_stereo_stage_after_them_and_no_distance(
    context: Context, worlds: SimpleNamespace, method: str
) -> None:
    stage = make(VisionObstacleSettings(method=method), context)  # type: ignore[arg-type]
    full = worlds.World([worlds.Thing(1500, 300, 400, RED)]).see()
    bench = Bench()
    bench.put(full.get(StereoFrame))
    (reading,) = stage.process(bench)
    assert isinstance(reading, RangeReading)
    assert (reading.can_see, reading.ahead_mm, reading.left_mm) == (True, None, None)
    assert bench.get(ObstacleMap) is not None
    assert "obstacle" in bench.panes
    assert list(stage.process(Bench())) == []
    stage.close()
    stage.close()


def test_the_plugin_offers_one_stage_that_needs_only_the_pictures() -> None:
    (component,) = chairward_sensors()
    assert component.name == "vision_obstacle"
    assert tuple(component.needs) == (StereoFrame,)
    assert set(component.gives) == {ObstacleMap, RangeReading}

"""The stage on a bench: what it gives, what it says without a calibration, panes, other stages' masks."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from chairward.components import Bench, Context, Footprint, Pose
from chairward.messages import NOTHING_NEAR_MM, RangeReading
from chairward.plugins import discover
from chairward.stages import DisparityMap, FloorMap, ObstacleMap, RectifiedPair, StereoFrame
from chairward_stereo_range.calibration_file import CalibrationError
from chairward_stereo_range.settings import StereoRangeSettings
from chairward_stereo_range.stage import StereoRange


def make(tmp_path: Path, pose: Pose, **settings: Any) -> StereoRange:
    context = Context(
        lane="front",
        run_dir=tmp_path,
        chair_dir=tmp_path,
        pose=pose,
        footprint=Footprint(front_mm=450.0, rear_mm=450.0, half_width_mm=320.0),
    )
    return StereoRange(StereoRangeSettings.model_validate(settings), context)


def frame(pair: Any, geometry: Any, seq: int = 1) -> StereoFrame:
    return StereoFrame(left=pair[0], right=pair[1], captured_ns=seq * 66_000_000, seq=seq, geometry=geometry)


def run(stage: StereoRange, item: StereoFrame | None, *others: object) -> tuple[list[Any], Bench]:
    bench = Bench()
    for put in (item, *others):
        if put is not None:
            bench.put(put)
    return list(stage.process(bench)), bench


def test_the_plugin_offers_the_stage_and_its_commands() -> None:
    kind, component = discover().stage("stereo_range")
    assert kind == "sensor"
    assert list(component.needs) == [StereoFrame]
    assert {RectifiedPair, DisparityMap, FloorMap, RangeReading} == set(component.gives)
    for name, field in component.settings.model_fields.items():
        assert field.description, name


def test_a_pair_gives_a_reading_from_the_footprint_and_everything_declared(tools: Any, tmp_path: Path) -> None:
    stage = make(tmp_path, Pose(x_mm=300.0, z_mm=400.0))
    messages, bench = run(stage, frame(tools.render(tools.room((tools.board(900.0),))), tools.geometry()))
    [reading] = messages
    assert isinstance(reading, RangeReading)
    assert reading.can_see
    assert reading.ahead_mm == pytest.approx(900 - 150, abs=20), "the lens stands 150 mm behind the front edge"
    assert reading.captured_ns == 66_000_000
    assert bench.get(RectifiedPair) is not None
    disparity, floor = bench.get(DisparityMap), bench.get(FloorMap)
    assert disparity is not None
    assert floor is not None
    assert disparity.disparity_px.shape == floor.floor.shape == (240, 320)
    assert set(bench.panes) == {"left", "right", "disparity"}
    assert all(p.image.shape == (240, 320, 3) and p.image.dtype == np.uint8 for p in bench.panes.values())


def test_nearer_is_brighter_in_the_disparity_pane(tools: Any, tmp_path: Path) -> None:
    shades = []
    for distance in (500.0, 1500.0):
        stage = make(tmp_path, Pose(x_mm=450.0, z_mm=400.0))
        _, bench = run(stage, frame(tools.render(tools.room((tools.board(distance),))), tools.geometry()))
        picture = bench.panes["disparity"].image[130:200, 100:220]
        shades.append(float(np.median(picture[picture > 0])))
    assert shades[0] > shades[1] + 30


def test_nothing_ahead_reads_5000(tools: Any, tmp_path: Path) -> None:
    stage = make(tmp_path, Pose(x_mm=450.0, z_mm=400.0), panes=False)
    [reading], bench = run(stage, frame(tools.render(tools.room()), tools.geometry()))
    assert reading.can_see
    assert reading.ahead_mm == NOTHING_NEAR_MM
    assert not bench.panes


def test_an_empty_bench_says_nothing_and_so_goes_stale(tmp_path: Path) -> None:
    assert run(make(tmp_path, Pose()), None)[0] == []


def test_raw_pictures_without_a_calibration_are_blind_with_a_reason(tools: Any, tmp_path: Path) -> None:
    [reading], _ = run(make(tmp_path, Pose()), frame(tools.render(tools.room()), None))
    assert not reading.can_see
    assert reading.ahead_mm is None
    assert "calibration" in reading.reason


def test_a_missing_calibration_file_is_an_error_at_start(tmp_path: Path) -> None:
    with pytest.raises(CalibrationError, match=r"nowhere\.json"):
        make(tmp_path, Pose(), calibration="nowhere.json")


def test_larger_pictures_are_worked_on_at_the_working_height(tools: Any, tmp_path: Path) -> None:
    geometry = tools.geometry(640, 480, 600.0, 50.0)
    stage = make(tmp_path, Pose(x_mm=450.0, z_mm=400.0))
    [reading], bench = run(stage, frame(tools.render(tools.room((tools.board(700.0),)), geometry), geometry))
    pair = bench.get(RectifiedPair)
    assert pair is not None
    assert pair.left.shape == (240, 320, 3)
    assert pair.geometry.focal_px == pytest.approx(300.0)
    assert reading.ahead_mm == pytest.approx(700, abs=20)


def of_recording(tools: Any, name: str, seq: int, mount: Pose, *boards: Any) -> StereoFrame:
    pair = tools.render(tools.room(boards), pose=mount)
    return replace(frame(pair, tools.geometry(), seq), name=f"{name}/{seq:03d}")


def test_a_recording_is_measured_from_where_its_frames_say(tools: Any, tmp_path: Path) -> None:
    for mount in ("chair", "floor"):
        stage = make(tmp_path, Pose(x_mm=450.0, z_mm=400.0), mount=mount)
        told = replace(tools.mount_b, x_mm=450.0)
        item = replace(of_recording(tools, "b", 1, tools.mount_b, tools.board(900.0)), pose=told)
        [reading], bench = run(stage, item)
        pair = bench.get(RectifiedPair)
        assert pair is not None
        assert pair.pose == told
        assert reading.ahead_mm == pytest.approx(900, abs=25), mount


def test_a_recording_that_does_not_tell_its_mount_is_measured_from_its_own_floor(tools: Any, tmp_path: Path) -> None:
    stage = make(tmp_path, Pose(x_mm=450.0, z_mm=400.0), mount="floor")
    poses = []
    for name, mount in (("low", Pose(z_mm=300.0)), ("high", tools.mount_b)):
        for seq in range(1, 5):
            [reading], bench = run(stage, of_recording(tools, name, seq, mount, tools.board(1800.0)))
            pair = bench.get(RectifiedPair)
            assert pair is not None
            assert pair.pose is not None
            poses.append(pair.pose)
        assert reading.ahead_mm == pytest.approx(1800, rel=0.03), name
    low, high = poses[3], poses[7]
    assert poses == [low] * 4 + [high] * 4, "found in the first picture, kept, and found anew in another recording"
    assert (low.x_mm, low.z_mm, low.pitch_deg) == pytest.approx((450, 300, 0), abs=15)
    assert high.z_mm == pytest.approx(700, rel=0.1)
    assert high.pitch_deg == pytest.approx(15, abs=3)


def test_where_no_floor_is_found_the_mount_stays_unknown_and_all_that_is_seen_counts(
    tools: Any, tmp_path: Path
) -> None:
    stage = make(tmp_path, Pose(x_mm=450.0, z_mm=400.0), mount="floor")
    wall = tools.board(800.0)
    for seq in range(1, 40):
        [reading], bench = run(stage, of_recording(tools, "wall", seq, tools.mount_a, wall))
    pair = bench.get(RectifiedPair)
    assert pair is not None
    assert pair.pose == Pose(x_mm=450.0)
    assert reading.ahead_mm == pytest.approx(800, abs=30)


def test_the_appearance_mask_gates_the_thesis_mode_only(tools: Any, tmp_path: Path) -> None:
    pair = tools.render(tools.room((tools.board(750.0),)))
    empty = ObstacleMap(mask=np.zeros((240, 320), bool), captured_ns=1)
    for method, expected in (("thesis_code", NOTHING_NEAR_MM), ("pyramid", 750)):
        stage = make(tmp_path, Pose(x_mm=450.0, z_mm=400.0), method=method)
        [reading], _ = run(stage, frame(pair, tools.geometry()), empty)
        assert reading.ahead_mm == pytest.approx(expected, abs=20), method


def test_one_dead_camera_is_blind_whatever_the_other_shows(tools: Any, tmp_path: Path) -> None:
    left, right = tools.render(tools.room((tools.board(750.0),)))
    [reading], _ = run(make(tmp_path, Pose(z_mm=400.0)), frame((left, np.zeros_like(right)), tools.geometry()))
    assert not reading.can_see
    assert "right camera" in reading.reason

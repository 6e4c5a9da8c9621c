"""Cameras, microphone and stop device on a living world: what they give is what the world says, at its time."""

from __future__ import annotations

import threading
import time
from collections.abc import Iterator
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest

from chairward.components import Context, DeviceLost, Pose
from chairward.messages import Alive, Button, Press
from chairward.plugins import discover
from chairward.shared_state import SharedState
from chairward.stages import AudioBlock, StereoFrame
from chairward_simulator import plugin, speech
from chairward_simulator.camera import CAMERAS_ON
from chairward_simulator.world import WORLD_NAMES

CAMERA_POSE = Pose(x_mm=450.0, z_mm=400.0)


@pytest.fixture
def context(tmp_path: Path) -> Context:
    return Context(lane="front", run_dir=tmp_path, chair_dir=tmp_path, pose=CAMERA_POSE)


@pytest.fixture
def world(tmp_path: Path) -> Iterator[SharedState]:
    state = SharedState.create(tmp_path / "world", WORLD_NAMES)
    state.write(time_ns=time.monotonic_ns(), x_mm=1800.0, y_mm=1940.0)
    yield state
    state.close()


def make(name: str, context: Context, **settings: object):
    registry = discover((), {"simulator": plugin})
    assert registry.refused == []
    component = registry.get("source", name)
    return component.make(component.settings(**settings), context)


@pytest.mark.parametrize("name", ["sim_cameras", "sim_microphone", "sim_operator"])
def test_without_a_world_it_is_a_lost_device_with_the_way_out(name, context, monkeypatch) -> None:
    monkeypatch.setattr("chairward_simulator.camera.WORLD_WAIT_S", 0.05)
    source = make(name, context)
    with pytest.raises(DeviceLost, match=f"{name}: no simulated world at .*sim_home"):
        source.open()
    source.close()
    source.close()


def test_cameras_give_the_pair_of_the_newest_pose_with_its_time_and_geometry(context, world) -> None:
    cameras = make("sim_cameras", context, fps=30.0, noise=0.0)
    cameras.open()
    assert (context.run_dir / CAMERAS_ON).exists()
    first = cameras.read(1.0)
    assert isinstance(first, StereoFrame)
    world.write(time_ns=time.monotonic_ns(), x_mm=2600.0)
    pose_ns = int(world.read()["time_ns"])
    second = cameras.read(1.0)
    assert second is not None
    assert second.captured_ns == pose_ns
    assert second.seq == first.seq + 1
    assert second.geometry is not None
    assert (second.geometry.focal_px, second.geometry.baseline_mm) == (300.0, 50.0)
    assert second.left.shape == second.right.shape == (240, 320, 3)
    assert not np.array_equal(first.left, second.left)
    cameras.close()
    with pytest.raises(DeviceLost, match="not open"):
        cameras.read(0.1)


def test_cameras_show_the_person_only_where_there_is_one(context, world) -> None:
    cameras = make("sim_cameras", context, noise=0.0)
    cameras.open()
    empty = cameras.read(1.0)
    world.write(person_here=1, person_x_mm=3800.0, person_y_mm=1940.0)
    crossed = cameras.read(1.0)
    changed = (np.abs(empty.left.astype(int) - crossed.left).sum(axis=2) > 30)[:, 150:170]
    assert changed.mean() > 0.5
    cameras.close()


def test_cameras_keep_their_rate_and_drop_what_nobody_fetched(context, world) -> None:
    cameras = make("sim_cameras", context, fps=20.0)
    cameras.open()
    cameras.read(1.0)
    time.sleep(0.5)  # a slow reader
    begin = time.monotonic()
    frames = [cameras.read(1.0) for _ in range(4)]
    assert all(frames)
    assert time.monotonic() - begin > 0.09  # no burst of old frames
    cameras.close()


def test_cameras_give_nothing_before_the_next_frame_is_due(context, world) -> None:
    cameras = make("sim_cameras", context, fps=1.0)
    cameras.open()
    assert cameras.read(1.0) is not None
    assert cameras.read(0.0) is None
    cameras.close()


def test_microphone_plays_the_word_sample_for_sample_at_its_time(context, world) -> None:
    microphone = make("sim_microphone", context, noise_dbfs=-120.0)
    microphone.open()
    blocks: list[AudioBlock] = [microphone.read(0.1) for _ in range(5)]
    begin_ns = blocks[-1].captured_ns + 50_000_000
    world.write(time_ns=begin_ns, utterance_id=3, utterance_word=speech.WORDS.index("stop"), utterance_ns=begin_ns)
    word = speech.sound(speech.say_file("stop", 3))
    while blocks[-1].captured_ns < begin_ns + len(word) / 16 * 1e6 + 50e6:
        block = microphone.read(0.1)
        assert block is not None
        blocks.append(block)
    microphone.close()
    assert all(b.rate_hz == 16_000 and len(b.samples) == 160 and b.samples.dtype == np.float32 for b in blocks)
    assert all(b.lost_samples == 0 for b in blocks)
    assert {b.captured_ns - a.captured_ns for a, b in pairwise(blocks)} == {10_000_000}
    heard = np.concatenate([b.samples for b in blocks])
    first = round((begin_ns - blocks[0].captured_ns) / 1e9 * 16_000)
    assert np.abs(heard[first : first + len(word)] - word).max() < 1e-4
    assert np.abs(heard[:first]).max() < 1e-4
    assert np.abs(heard[first + len(word) :]).max() < 1e-4


def test_microphone_tells_what_a_slow_reader_has_lost(context, world) -> None:
    microphone = make("sim_microphone", context)
    microphone.open()
    first = microphone.read(0.1)
    time.sleep(0.8)
    late = microphone.read(0.1)
    assert late.lost_samples > 0
    assert late.captured_ns - first.captured_ns == 10_000_000 + late.lost_samples / 16 * 1e6
    assert time.monotonic_ns() - late.captured_ns < 200_000_000
    microphone.close()


def test_room_noise_has_the_level_asked_for(context, world) -> None:
    microphone = make("sim_microphone", context, noise_dbfs=-40.0)
    microphone.open()
    sound = np.concatenate([microphone.read(0.1).samples for _ in range(60)])
    assert 20 * np.log10(np.sqrt(np.mean(sound**2))) == pytest.approx(-40.0, abs=2.5)
    microphone.close()


def gather(operator, seconds: float) -> list[Alive | Press]:
    end, found = time.monotonic() + seconds, []
    while time.monotonic() < end:
        found += operator.read(0.05) or []
    return found


def test_operator_is_alive_every_100_ms_and_presses_when_the_person_does(context, world) -> None:
    operator = make("sim_operator", context)
    operator.open()
    quiet = gather(operator, 1.0)
    assert all(isinstance(m, Alive) and m.well for m in quiet)
    assert 7 <= len(quiet) <= 12
    world.write(arm=1, reset=1)
    pressed = [m.button for m in gather(operator, 0.3) if isinstance(m, Press)]
    assert pressed == [Button.RESET, Button.ARM]
    assert not [m for m in gather(operator, 0.3) if isinstance(m, Press)]
    world.write(arm=2)
    after = gather(operator, 0.3)
    assert [m.button for m in after if isinstance(m, Press)] == [Button.ARM]
    seqs = [m.seq for m in [*quiet, *after]]
    assert seqs == sorted(set(seqs))
    operator.close()


def test_operator_without_a_world_arms_by_itself_and_never_resets(context) -> None:
    operator = make("sim_operator", context, world=False, arm_after_s=0.2)
    operator.open()
    messages = gather(operator, 2.6)
    presses = [m.button for m in messages if isinstance(m, Press)]
    assert presses == [Button.ARM, Button.ARM]
    assert sum(isinstance(m, Alive) for m in messages) >= 15
    operator.close()


def test_making_a_source_starts_nothing(context) -> None:
    before = threading.active_count()
    for name in ("sim_cameras", "sim_microphone", "sim_operator"):
        make(name, context).close()
    assert threading.active_count() == before
    assert list(context.run_dir.iterdir()) == []

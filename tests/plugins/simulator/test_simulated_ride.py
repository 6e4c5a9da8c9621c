"""The ride in simulated time: the chair file's stages and the real arbiter, here with stages easy to see through."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import replace
from pathlib import Path

import pytest

from chairward.components import Bench, Component, Footprint, NoSettings, Pose
from chairward.facts import MS, SourceLimits
from chairward.hookspecs import hookimpl
from chairward.messages import Alive, Command, Intent, Message, RangeReading
from chairward.plan import LanePlan, Part, Plan
from chairward.plugins import discover
from chairward.stages import AudioBlock, StereoFrame
from chairward.testing.ride import AHEAD_AND_SIDES, chair_limits, chair_plan
from chairward_simulator.ride import ride

WALL_SEEN_AFTER_FRAMES = 70


class Seer:
    """Sees nothing near for a while, then something at 500 mm."""

    def process(self, bench: Bench) -> Iterable[Message]:
        frame = bench.get(StereoFrame)
        assert frame is not None
        near = 500 if frame.seq > WALL_SEEN_AFTER_FRAMES else 4000
        return [RangeReading(seq=frame.seq, captured_ns=frame.captured_ns, can_see=True, ahead_mm=near)]

    def close(self) -> None:
        """Nothing to release."""


class Listener:
    """Understands "front" whenever somebody has just said something loud enough."""

    seq = 0
    loud = False

    def process(self, bench: Bench) -> Iterable[Message]:
        block = bench.get(AudioBlock)
        assert block is not None
        was, self.loud = self.loud, bool(abs(block.samples).max() > 0.1)
        self.seq += 1
        if self.loud and not was:
            return [Intent(seq=self.seq, captured_ns=block.captured_ns, command=Command.FRONT, word="front")]
        return [Alive(seq=self.seq, captured_ns=block.captured_ns)]

    def close(self) -> None:
        """Nothing to release."""


class Stages:
    """A plugin with both."""

    CHAIRWARD_API = 1

    @hookimpl
    def chairward_sensors(self):
        return [Component(name="seer", settings=NoSettings, make=lambda s, c: Seer(), gives=(RangeReading,))]

    @hookimpl
    def chairward_recognizers(self):
        return [Component(name="listener", settings=NoSettings, make=lambda s, c: Listener(), gives=(Intent, Alive))]


@pytest.fixture
def plan(footprint: Footprint) -> Plan:
    names = {"front/seer": SourceLimits(freshness_ns=200 * MS, covers=AHEAD_AND_SIDES)}
    ears = {"voice/listener": SourceLimits(freshness_ns=400 * MS)}
    return chair_plan(
        footprint=footprint,
        limits=chair_limits(sensors=names, recognizers=ears),
        lanes=(
            LanePlan(
                name="front",
                source=Part(component="sim_cameras"),
                stages=(Part(component="seer"),),
                pose=Pose(x_mm=450.0, z_mm=400.0),
            ),
            LanePlan(name="voice", source=Part(component="sim_microphone"), stages=(Part(component="listener"),)),
        ),
    )


def test_words_said_in_the_world_move_it_through_the_real_rules_until_a_sensor_objects(plan, tmp_path: Path) -> None:
    told = list(ride(plan, discover((), {"stages": Stages()}), tmp_path, 8.0))
    report = told[-1]
    assert isinstance(report, dict)
    sentences = [line for line in told if isinstance(line, str)]
    assert any("says 'left'" in line for line in sentences)
    stops = [line for line in sentences if "protective stop" in line]
    assert len(stops) == 1
    assert "front/seer: 500 mm ahead" in stops[0]
    assert 500 < report["driven_mm"] < 2000
    assert report["top_speed_mm_s"] <= 505
    assert report["collisions"] == []


def test_a_chair_without_simulated_lanes_is_refused_by_name(plan, tmp_path: Path) -> None:
    with pytest.raises(ValueError, match=r"t\.toml: no lane has source = 'sim_cameras'"):
        list(ride(replace(plan, lanes=plan.lanes[1:]), discover((), {"stages": Stages()}), tmp_path, 1.0))

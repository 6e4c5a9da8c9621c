"""A second stage of the lane behind stereo, for evaluations: a chair listens to every sensor that it has.

It is found by its name among the installed plugins and fed with what stereo has laid on the bench, as a lane does.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from chairward.components import Bench, Component, Context, Pose, Processor
from chairward.messages import RangeReading
from chairward.plugins import Registry, discover, discover_only
from chairward.stages import RectifiedPair, StereoFrame
from chairward_stereo_range.finder import Measurement, RangeFinder
from chairward_stereo_range.manifest import FOOTPRINT
from chairward_stereo_range.stage import lay_out

USUAL = "vision_obstacle"
NO_STAGE = "none"
MakeStage = Callable[[Pose], Processor]


@dataclass(frozen=True, slots=True)
class Vote:
    """What the second stage says: ahead_mm from the lens, infinite where it says nothing."""

    ahead_mm: float = np.inf
    can_see: bool = True


def stage_maker(name: str) -> MakeStage | None:
    """What makes the stage `name` for a mount; None for "none", or where the usual one is not installed.

    Raises chairward.plugins.PluginError where another one is not installed, or cannot be used.
    """
    if name == NO_STAGE:
        return None
    registry: Registry = discover_only([name]) if name == USUAL else discover()
    if name == USUAL and not registry.components["sensor"] and not registry.refused:
        return None
    _, component = registry.stage(name)
    return lambda pose: _make(component, pose)


def _make(component: Component, pose: Pose) -> Processor:
    quiet = {"panes": False} if "panes" in component.settings.model_fields else {}
    context = Context(lane="evaluate", run_dir=Path(), chair_dir=Path(), pose=pose, footprint=FOOTPRINT)
    made: Processor = component.make(component.settings.model_validate(quiet), context)
    return made


def vote(stage: Processor, pair: RectifiedPair, found: Measurement, finder: RangeFinder) -> Vote:
    """What the stage says of a pair that stereo has measured."""
    bench = Bench()
    bench.put(
        StereoFrame(
            left=pair.left, right=pair.right, captured_ns=pair.captured_ns, seq=pair.seq, geometry=pair.geometry
        )
    )
    lay_out(bench, pair, found, finder)
    readings = [message for message in stage.process(bench) if isinstance(message, RangeReading)]
    near = min((float(r.ahead_mm) for r in readings if r.ahead_mm is not None), default=np.inf)
    return Vote(near, all(r.can_see for r in readings))

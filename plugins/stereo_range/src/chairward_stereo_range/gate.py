"""The thesis' gate for evaluations: the appearance mask of the stage `vision_obstacle`, if it is installed."""

from __future__ import annotations

from pathlib import Path

from chairward.components import Bench, Context
from chairward.plugins import PluginError, discover
from chairward.stages import Image, ObstacleMap, RectifiedPair, StereoFrame, StereoGeometry
from chairward_stereo_range.evaluate import Gate
from chairward_stereo_range.region import Bools


def thesis_gate(method: str) -> Gate | None:
    """The mask maker of `thesis_code` or `thesis_text`; None for other methods, or when no such stage is installed."""
    if method not in ("thesis_code", "thesis_text"):
        return None
    try:
        _, component = discover().stage("vision_obstacle")
    except PluginError:
        return None
    settings = component.settings.model_validate({"method": method})
    stage = component.make(settings, Context(lane="evaluate", run_dir=Path(), chair_dir=Path()))
    count = 0

    def mask(left: Image, right: Image, geometry: StereoGeometry) -> Bools | None:
        nonlocal count
        count += 1
        bench = Bench()
        bench.put(StereoFrame(left=left, right=right, captured_ns=count, seq=count, geometry=geometry))
        bench.put(RectifiedPair(left=left, right=right, geometry=geometry, captured_ns=count, seq=count))
        list(stage.process(bench))
        found = bench.get(ObstacleMap)
        return None if found is None else found.mask

    return mask

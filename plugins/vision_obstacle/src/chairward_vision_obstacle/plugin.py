"""What this plugin offers: registered once, at start, without touching a device."""

from __future__ import annotations

from collections.abc import Sequence

from chairward.components import Component, Context, Processor
from chairward.hookspecs import hookimpl
from chairward.messages import RangeReading
from chairward.stages import ObstacleMap, StereoFrame
from chairward_vision_obstacle.settings import VisionObstacleSettings

CHAIRWARD_API = 1


def make(settings: VisionObstacleSettings, context: Context) -> Processor:
    """The stage for settings.method."""
    from chairward_vision_obstacle.stage import LearnedStage, ThesisVision

    return LearnedStage(settings, context) if settings.method == "learned" else ThesisVision(settings, settings.method)


@hookimpl
def chairward_sensors() -> Sequence[Component]:
    """One stage; it needs no more than the pictures, and uses what stereo has laid on the bench."""
    return [
        Component(
            name="vision_obstacle",
            settings=VisionObstacleSettings,
            make=make,
            needs=(StereoFrame,),
            gives=(ObstacleMap, RangeReading),
            summary="obstacles by their look: what does not look like the floor",
        )
    ]

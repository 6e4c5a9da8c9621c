"""What this plugin offers: registered once, at start, without touching a device."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import typer

from chairward.components import Component, Context
from chairward.hookspecs import hookimpl
from chairward.messages import RangeReading
from chairward.stages import DisparityMap, FloorMap, RectifiedPair, StereoFrame
from chairward_stereo_range.settings import StereoRangeSettings

if TYPE_CHECKING:
    from chairward.doctor import Check

CHAIRWARD_API = 1


def _make(settings: StereoRangeSettings, context: Context) -> Any:
    from chairward_stereo_range.stage import StereoRange

    return StereoRange(settings, context)


@hookimpl
def chairward_sensors() -> Sequence[Component]:
    """The stage `stereo_range`."""
    return [
        Component(
            name="stereo_range",
            settings=StereoRangeSettings,
            make=_make,
            needs=(StereoFrame,),
            gives=(RectifiedPair, DisparityMap, FloorMap, RangeReading),
            summary="distance of the nearest thing ahead, left and right, by stereo",
        )
    ]


@hookimpl
def chairward_commands(app: typer.Typer) -> None:
    """`chairward range ...` and `chairward calibrate ...`."""
    from chairward_stereo_range.calibration.cli import app as calibrate_app
    from chairward_stereo_range.cli import range_app

    app.add_typer(range_app, name="range")
    app.add_typer(calibrate_app, name="calibrate")


@hookimpl
def chairward_checks() -> Sequence[Check]:
    """The calibration."""
    from chairward_stereo_range.checks import checks

    return checks()

"""What this plugin offers: registered once, at start, without touching a device."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

from chairward.components import Component, Context, Source
from chairward.hookspecs import hookimpl
from chairward.stages import StereoFrame
from chairward_cameras.settings import CamerasSettings

if TYPE_CHECKING:
    from chairward.doctor import Check

CHAIRWARD_API = 1


def make(settings: CamerasSettings, context: Context) -> Source:
    """The source for settings.kind; nothing is opened yet."""
    if settings.kind == "live":
        from chairward_cameras.live import LivePairs

        return LivePairs(settings)
    from chairward_cameras.playback import FilePairs

    return FilePairs(settings, context)


@hookimpl
def chairward_sources() -> Sequence[Component]:
    """One source: a camera pair, live or recorded."""
    return [
        Component(
            name="cameras",
            settings=CamerasSettings,
            make=make,
            gives=(StereoFrame,),
            summary="a webcam pair, or recorded pairs from a manifest or a folder",
        )
    ]


@hookimpl
def chairward_checks() -> Sequence[Check]:
    """The two cameras."""
    from chairward_cameras.checks import checks

    return checks()

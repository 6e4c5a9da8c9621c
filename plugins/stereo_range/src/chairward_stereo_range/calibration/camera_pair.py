"""A pair of cameras for the commands that set a chair up: from a chair file's lane, or two devices by name."""

from __future__ import annotations

import re
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

from chairward import plugins, profile
from chairward.components import Context, Footprint, Pose, Source
from chairward.plan import fill_run_dir
from chairward.profile import ProfileError
from chairward.stages import StereoFrame

CAMERAS = "cameras"
"""The source that takes devices (settings kind, left, right, width_px, height_px)."""


class SourceError(ValueError):
    """There is no such camera pair: one sentence with what to do."""


@dataclass(frozen=True, slots=True)
class CameraPair:
    """make: folder for its files -> the source, not yet opened. The rest is what the chair file says of its lane.

    calibration: the file that stereo_range would use in that lane, or None.
    """

    make: Callable[[Path], Source]
    lane: str = ""
    chair_file: Path = Path()
    pose: Pose = Pose()
    footprint: Footprint | None = None
    calibration: Path | None = None


def of_chair(chair: str, lane: str | None, sets: list[str]) -> CameraPair:
    """The camera lane of a chair file (its first, or the one named). Raises SourceError."""
    registry = plugins.discover()
    try:
        plan = profile.load_traced(chair, None, sets, registry).plan
        sources = {each.name: registry.get("source", each.source.component) for each in plan.lanes}
    except (ProfileError, plugins.PluginError) as error:
        raise SourceError(str(error)) from error
    pairs = [each for each in plan.lanes if StereoFrame in sources[each.name].gives]
    chosen = [each for each in pairs if lane in (None, each.name)]
    if not chosen:
        names = ", ".join(each.name for each in pairs) or "none"
        raise SourceError(f"chair '{plan.chair}' has no camera lane{f' {lane!r}' if lane else ''} (it has: {names})")
    found = chosen[0]
    component = sources[found.name]
    settings = next((s.settings for s in found.stages if s.component == "stereo_range"), {})
    calibration = settings.get("calibration")

    def make(folder: Path) -> Source:
        checked = component.settings.model_validate(fill_run_dir(found.source.settings, folder))
        source: Source = component.make(checked, plan.context(found.name, found.pose, folder))
        return source

    return CameraPair(
        make,
        found.name,
        Path(plan.chair_file),
        found.pose,
        plan.footprint,
        Path(plan.chair_file).parent / calibration if calibration else None,
    )


def of_devices(left: str, right: str, size: str) -> CameraPair:
    """Two cameras by number or device. Raises SourceError."""
    shape = re.fullmatch(r"(\d+)x(\d+)", size)
    if shape is None:
        raise SourceError(f"--size {size}: write WIDTHxHEIGHT, e.g. 640x480")
    try:
        component = plugins.discover().get("source", CAMERAS)
        settings = component.settings.model_validate(
            {
                "kind": "live",
                "left": int(left) if left.isdigit() else left,
                "right": int(right) if right.isdigit() else right,
                "width_px": int(shape[1]),
                "height_px": int(shape[2]),
            }
        )
    except (plugins.PluginError, ValueError) as error:
        raise SourceError(f"cameras {left} and {right}: {error}") from error

    def make(folder: Path) -> Source:
        source: Source = component.make(settings, Context(lane="calibrate", run_dir=folder, chair_dir=folder))
        return source

    return CameraPair(make)

"""What a chair file may set for `stereo_range`."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Literal

from pydantic import Field

from chairward.components import Settings
from chairward_stereo_range.matching import Method


class StereoRangeSettings(Settings):
    """Settings of the stage `stereo_range`."""

    method: Annotated[Method, Field(description="How to match; the thesis methods are baselines")] = "pyramid"
    calibration: Annotated[
        Path | None, Field(description="Calibration file of raw camera pictures, relative to the chair file")
    ] = None
    mount: Annotated[
        Literal["chair", "floor"],
        Field(
            description="Pose of pictures that do not tell it. chair: as in the chair file; "
            "floor: found from the floor in the pictures (recordings)"
        ),
    ] = "chair"
    height_px: Annotated[int, Field(ge=120, le=1080, description="Rows of the working picture")] = 240
    region: Annotated[
        Literal["corridor", "trapezoid"],
        Field(description="What counts as ahead: the corridor that the footprint sweeps, or the thesis' fixed pixels"),
    ] = "corridor"
    nearest_mm: Annotated[float, Field(ge=100, le=1000, description="Depth to which disparities are searched")] = 240.0
    farthest_mm: Annotated[float, Field(ge=1000, le=10000, description="Beyond this nothing is reported")] = 3500.0
    clearance_mm: Annotated[float, Field(ge=20, le=150, description="Lower than this above the floor is floor")] = 60.0
    height_mm: Annotated[float, Field(ge=500, le=2500, description="Higher than this passes over the chair")] = 1400.0
    side_margin_mm: Annotated[float, Field(ge=0, le=300, description="Room to keep on each side")] = 20.0
    min_coverage: Annotated[
        float, Field(ge=0.05, le=1.0, description="Less of the region matched than this: cannot see")
    ] = 0.12
    panes: Annotated[bool, Field(description="Draw pictures for people")] = True

"""What a chair file may set for `vision_obstacle`."""

from __future__ import annotations

from typing import Literal

from pydantic import Field

from chairward.components import Settings


class VisionObstacleSettings(Settings):
    """Settings of the stage `vision_obstacle`."""

    method: Literal["learned", "thesis_text", "thesis_code"] = Field(
        "learned", description="learned: the floor's look as stereo shows it; thesis_*: baselines, never with a person"
    )
    side_margin_mm: float = Field(20.0, ge=0, le=300, description="room to keep on each side of the footprint")
    share: float = Field(
        0.012, gt=0, lt=0.2, description="a look counts as floor from this part of the measured floor on (thesis: 1/50)"
    )
    contrast: float = Field(
        0.25, ge=0, le=2, description="... and when it holds this many times what it holds of the obstacles"
    )
    fast_s: float = Field(2.0, gt=0, le=60, description="memory of the floor's look as it is now, seconds")
    slow_s: float = Field(60.0, gt=0, le=3600, description="memory of how it looked before the light changed, seconds")
    enough_pixels: int = Field(
        150, ge=20, le=5000, description="measured floor pixels (of 160 x 120) from which a picture teaches anything"
    )
    confirm: int = Field(3, ge=1, le=5, description="of five pictures so many must show an obstacle")
    confirm_thin: int = Field(4, ge=1, le=5, description="of five pictures so many must show a cable")
    panes: bool = Field(True, description="draw the obstacle picture for people")

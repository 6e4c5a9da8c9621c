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
    panes: bool = Field(True, description="draw the obstacle picture for people")

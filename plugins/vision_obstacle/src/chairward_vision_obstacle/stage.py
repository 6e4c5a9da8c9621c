"""The stage `vision_obstacle`: a picture in, an obstacle picture and a RangeReading out."""

from __future__ import annotations

from collections.abc import Iterable

import cv2

from chairward.components import Bench, Context
from chairward.messages import Message, RangeReading
from chairward.stages import ObstacleMap, Pane, RectifiedPair, StereoFrame
from chairward_vision_obstacle import panes
from chairward_vision_obstacle.settings import VisionObstacleSettings
from chairward_vision_obstacle.thesis import choose_side, obstacle_mask


class ThesisVision:
    """The baselines: an ObstacleMap for the stereo stage after it. They know no distance, so they report none."""

    def __init__(self, settings: VisionObstacleSettings, context: Context) -> None:
        del context
        cv2.setNumThreads(1)
        self._settings = settings

    def process(self, bench: Bench) -> Iterable[Message]:
        """One reading for each frame; an empty bench gives none, and so goes stale."""
        frame = bench.get(StereoFrame)
        if frame is None:
            return ()
        pair = bench.get(RectifiedPair)
        image = frame.left if pair is None else pair.left
        method = self._settings.method
        assert method != "learned"
        mask = obstacle_mask(image, method)
        bench.put(ObstacleMap(mask=mask, captured_ns=frame.captured_ns))
        side = choose_side(mask)
        if self._settings.panes:
            bench.put(Pane(name="obstacle", image=panes.black_and_white(mask), captured_ns=frame.captured_ns))
        return (
            RangeReading(
                seq=frame.seq,
                captured_ns=frame.captured_ns,
                can_see=True,
                confidence=0.0,
                reason=f"{method}: freer side {side.side}",
            ),
        )

    def close(self) -> None:
        """Nothing is held."""

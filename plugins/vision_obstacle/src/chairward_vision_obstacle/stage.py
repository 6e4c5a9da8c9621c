"""The stage `vision_obstacle`: a picture in, an obstacle picture and a RangeReading out."""

from __future__ import annotations

from collections.abc import Iterable

import cv2

from chairward.components import Bench, Context, Pose
from chairward.messages import NOTHING_NEAR_MM, Message, RangeReading
from chairward.stages import DisparityMap, FloorMap, ObstacleMap, Pane, RectifiedPair, StereoFrame, StereoGeometry
from chairward_vision_obstacle import panes
from chairward_vision_obstacle.learned import Judgement, LearnedVision
from chairward_vision_obstacle.settings import VisionObstacleSettings
from chairward_vision_obstacle.thesis import ThesisMethod, choose_side, obstacle_mask

NO_FLOOR_MAP = "no measured floor on the bench: put stereo_range before vision_obstacle in the lane's stages"
NO_MOUNT = "the camera's height is not known: set the lane's pose.z_mm in the chair file"
NO_FLOOR_YET = "the camera's height is not known: no floor has been found in these pictures yet"


class ThesisVision:
    """The baselines: an ObstacleMap for the stereo stage after it. They know no distance, so they report none."""

    def __init__(self, settings: VisionObstacleSettings, method: ThesisMethod) -> None:
        cv2.setNumThreads(1)
        self._settings, self._method = settings, method

    def process(self, bench: Bench) -> Iterable[Message]:
        """One reading for each frame; an empty bench gives none, and so goes stale."""
        frame = bench.get(StereoFrame)
        if frame is None:
            return ()
        pair = bench.get(RectifiedPair)
        mask = obstacle_mask(frame.left if pair is None else pair.left, self._method)
        bench.put(ObstacleMap(mask=mask, captured_ns=frame.captured_ns))
        side = choose_side(mask)
        if self._settings.panes:
            bench.put(Pane(name="obstacle", image=panes.black_and_white(mask), captured_ns=frame.captured_ns))
        reason = f"{self._method}: freer side {side.side}"
        return (
            RangeReading(seq=frame.seq, captured_ns=frame.captured_ns, can_see=True, confidence=0.0, reason=reason),
        )

    def close(self) -> None:
        """Nothing is held."""


class LearnedStage:
    """The default; it comes after stereo_range, whose FloorMap teaches it."""

    def __init__(self, settings: VisionObstacleSettings, context: Context) -> None:
        cv2.setNumThreads(1)
        self._settings, self._context = settings, context
        self._vision: LearnedVision | None = None
        self._made_for: tuple[StereoGeometry, Pose] | None = None

    def process(self, bench: Bench) -> Iterable[Message]:
        """One reading for each frame; an empty bench gives none, and so goes stale."""
        frame = bench.get(StereoFrame)
        if frame is None:
            return ()
        pair, floor = bench.get(RectifiedPair), bench.get(FloorMap)
        if pair is None or floor is None or floor.captured_ns != pair.captured_ns:
            return (self._blind(frame, NO_FLOOR_MAP),)
        pose = pair.pose or self._context.pose
        if pose.z_mm <= 0:
            return (self._blind(frame, NO_MOUNT if self._context.pose.z_mm <= 0 else NO_FLOOR_YET),)
        if self._vision is None or (pair.geometry, pose) != self._made_for:
            self._made_for = (pair.geometry, pose)
            self._vision = LearnedVision(self._settings, pair.geometry, pose, self._context.footprint)
        found = self._vision.judge(pair, floor, bench.get(DisparityMap))
        bench.put(ObstacleMap(mask=found.mask, captured_ns=frame.captured_ns))
        if self._settings.panes:
            picture = panes.overlay(pair.left, found, self._vision.ground)
            bench.put(Pane(name="obstacle", image=picture, captured_ns=frame.captured_ns))
        return (self._reading(frame, found),)

    def close(self) -> None:
        """Nothing is held."""

    def _reading(self, frame: StereoFrame, found: Judgement) -> RangeReading:
        near = found.nearest
        return RangeReading(
            seq=frame.seq,
            captured_ns=frame.captured_ns,
            can_see=found.can_see,
            ahead_mm=_whole_mm(near.ahead_mm) if near else NOTHING_NEAR_MM if found.can_see else None,
            left_mm=found.path.left_mm if found.can_see else None,
            right_mm=found.path.right_mm if found.can_see else None,
            coverage=1.0 if found.can_see else 0.0,
            confidence=1.0 if found.can_see else 0.0,
            reason=found.reason or describe(found),
        )

    def _blind(self, frame: StereoFrame, reason: str) -> RangeReading:
        return RangeReading(
            seq=frame.seq, captured_ns=frame.captured_ns, can_see=False, coverage=0.0, confidence=0.0, reason=reason
        )


def describe(found: Judgement) -> str:
    """One clause for people: what is ahead, and which way is freest."""
    heading = found.path.best_deg
    way = "straight on" if heading == 0 else f"{abs(heading)} degrees {'left' if heading > 0 else 'right'}"
    if found.nearest is None:
        return f"freest way {way}"
    where = "under the camera's view" if found.nearest.remembered else "in view"
    return f"{found.nearest.label} {where}, freest way {way}"


def _whole_mm(distance_mm: float) -> int:
    return int(min(max(distance_mm, 0.0), NOTHING_NEAR_MM))

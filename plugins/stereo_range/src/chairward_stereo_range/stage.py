"""The stage `stereo_range`: StereoFrame in; rectified pair, disparity, floor and RangeReading out."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import replace
from math import isfinite
from pathlib import Path

import numpy as np

from chairward.components import Bench, Context, Pose
from chairward.messages import NOTHING_NEAR_MM, Message, RangeReading
from chairward.stages import (
    DisparityMap,
    FloorMap,
    Image,
    ObstacleMap,
    Pane,
    RectifiedPair,
    StereoFrame,
    StereoGeometry,
)
from chairward_stereo_range import calibration_file, panes
from chairward_stereo_range.finder import Measurement, Options, RangeFinder, reported_mm
from chairward_stereo_range.geometry import make_view, scaled, working_size
from chairward_stereo_range.opencv import opencv
from chairward_stereo_range.own_mount import OwnMount, recording
from chairward_stereo_range.settings import StereoRangeSettings
from chairward_stereo_range.tracker import Tracked, Tracker


def options_of(settings: StereoRangeSettings) -> Options:
    """The measuring options that the settings name."""
    thesis = settings.method in ("thesis_code", "thesis_text")
    return Options(
        method=settings.method,
        region="trapezoid" if thesis else settings.region,
        nearest_mm=settings.nearest_mm,
        farthest_mm=settings.farthest_mm,
        clearance_mm=settings.clearance_mm,
        height_mm=settings.height_mm,
        side_margin_mm=settings.side_margin_mm,
        min_coverage=settings.min_coverage,
    )


class StereoRange:
    """A chairward.components.Processor. Raises CalibrationError at start when the calibration file cannot be used."""

    def __init__(self, settings: StereoRangeSettings, context: Context) -> None:
        self._settings, self._context = settings, context
        self._options = options_of(settings)
        self._calibration: calibration_file.Calibration | None = None
        self._calibration_path = Path()
        if settings.calibration is not None:
            self._calibration_path = context.chair_dir / settings.calibration
            self._calibration = calibration_file.load(self._calibration_path)
        self._rectifier: calibration_file.Rectifier | None = None
        self._own_mount = OwnMount(context.pose) if settings.mount == "floor" else None
        self._tracker: Tracker | None = None
        self._tracked: tuple[str, StereoGeometry, Pose] | None = None

    def process(self, bench: Bench) -> Iterable[Message]:
        """One reading for each pair; an empty bench (the source timed out) gives none, and so goes stale."""
        frame = bench.get(StereoFrame)
        if frame is None:
            return ()
        if unfit := _unfit(frame):
            return (self._blind(frame, unfit),)
        try:
            pair = self._rectified(frame)
        except calibration_file.CalibrationError as error:
            return (self._blind(frame, str(error)),)
        if pair is None:
            return (self._blind(frame, "raw camera pictures, but no calibration file is set"),)
        pose = self._pose(frame, pair)
        pair = replace(pair, pose=pose)
        tracker = self._tracker_for((recording(frame), pair.geometry, pose))
        mask = bench.get(ObstacleMap)
        step = tracker.step(
            pair.left, pair.right, frame.captured_ns, frame.skew_ns, None if mask is None else mask.mask
        )
        found = step.measurement
        lay_out(bench, pair, found, tracker.finder)
        reading = self._reading(frame, step)
        if self._settings.panes:
            for name, picture in panes.draw(pair.left, pair.right, found, tracker.finder, self._context.stop_mm):
                bench.put(Pane(name=name, image=picture, captured_ns=frame.captured_ns))
        return (reading,)

    def close(self) -> None:
        """Nothing is held."""

    def _rectified(self, frame: StereoFrame) -> RectifiedPair | None:
        height, width = frame.left.shape[:2]
        if frame.geometry is not None:
            size = working_size(width, height, self._settings.height_px)
            left, right = _resized(frame.left, size), _resized(frame.right, size)
            geometry = scaled(frame.geometry, *size)
        elif self._calibration is not None:
            if self._rectifier is None:
                size = working_size(
                    self._calibration.image_width_px, self._calibration.image_height_px, self._settings.height_px
                )
                self._rectifier = calibration_file.Rectifier(
                    self._calibration, *size, source=str(self._calibration_path)
                )
            left, right = self._rectifier(frame.left, frame.right)
            geometry = self._rectifier.geometry
        else:
            return None
        return RectifiedPair(left=left, right=right, geometry=geometry, captured_ns=frame.captured_ns, seq=frame.seq)

    def _pose(self, frame: StereoFrame, pair: RectifiedPair) -> Pose:
        if self._own_mount is not None:
            return self._own_mount.pose(frame, pair.left, pair.right, pair.geometry)
        return frame.pose or self._context.pose

    def _tracker_for(self, tracked: tuple[str, StereoGeometry, Pose]) -> Tracker:
        """The tracker of a recording, its geometry and its pose: what was seen in another one is forgotten."""
        if self._tracker is None or tracked != self._tracked:
            _, geometry, pose = tracked
            view = make_view(geometry, pose, self._context.footprint)
            self._tracker, self._tracked = Tracker(RangeFinder(view, self._options)), tracked
        return self._tracker

    def _reading(self, frame: StereoFrame, step: Tracked) -> RangeReading:
        found = step.measurement
        left_seen, right_seen = found.sides_seen
        return RangeReading(
            seq=frame.seq,
            captured_ns=frame.captured_ns,
            can_see=step.can_see,
            ahead_mm=_whole_mm(step.ahead_mm) if step.can_see or isfinite(step.ahead_mm) else None,
            left_mm=reported_mm(found.left) if (step.can_see and left_seen) or found.left else None,
            right_mm=reported_mm(found.right) if (step.can_see and right_seen) or found.right else None,
            closing_mm_s=int(np.clip(step.closing_mm_s, 0, 5000)),
            coverage=float(np.clip(found.coverage, 0.0, 1.0)),
            confidence=float(np.clip(found.coverage, 0.0, 1.0)) if step.can_see else 0.0,
            reason=step.reason[:200],
        )

    def _blind(self, frame: StereoFrame, reason: str) -> RangeReading:
        return RangeReading(
            seq=frame.seq,
            captured_ns=frame.captured_ns,
            can_see=False,
            coverage=0.0,
            confidence=0.0,
            reason=reason[:200],
        )


def lay_out(bench: Bench, pair: RectifiedPair, found: Measurement, finder: RangeFinder) -> None:
    """Lay on the bench what the stages behind this one go by."""
    at_ns = pair.captured_ns
    bench.put(pair)
    bench.put(DisparityMap(disparity_px=found.disparity, geometry=pair.geometry, captured_ns=at_ns))
    bench.put(FloorMap(floor=found.floor, obstacle=found.obstacle, horizon_row=finder.horizon_row, captured_ns=at_ns))


def _unfit(frame: StereoFrame) -> str:
    """Why pictures that come rectified cannot be a pair of their geometry; "" when they can, or come raw."""
    if frame.geometry is None:
        return ""
    sizes = [f"{picture.shape[1]}x{picture.shape[0]}" for picture in (frame.left, frame.right)]
    if sizes[0] != sizes[1]:
        return f"the left picture is {sizes[0]}, the right one {sizes[1]}: both must have one size"
    height, width = frame.left.shape[:2]
    if abs(width * frame.geometry.height_px - height * frame.geometry.width_px) > max(width, height):
        return f"pictures of size {sizes[0]} for a geometry of {frame.geometry.width_px}x{frame.geometry.height_px}"
    return ""


def _whole_mm(distance_mm: float) -> int:
    return int(min(max(distance_mm, 0.0), float(NOTHING_NEAR_MM)))


def _resized(image: Image, size: tuple[int, int]) -> Image:
    cv2 = opencv()
    if image.shape[1::-1] == size:
        return image
    how = cv2.INTER_AREA if size[1] < image.shape[0] else cv2.INTER_LINEAR
    return np.asarray(cv2.resize(image, size, interpolation=how), np.uint8)

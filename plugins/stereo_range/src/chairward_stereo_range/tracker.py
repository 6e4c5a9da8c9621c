"""The whole way from a rectified pair to one reading, frame after frame: faults, measurement, drops, memory."""

from __future__ import annotations

from dataclasses import dataclass
from math import inf

import numpy as np

from chairward.stages import Image
from chairward_stereo_range.drops import EdgeTrack
from chairward_stereo_range.faults import FaultWatch
from chairward_stereo_range.finder import Measurement, RangeFinder, Spot
from chairward_stereo_range.known_clear import KnownClear
from chairward_stereo_range.leaving import Edge, Leaving
from chairward_stereo_range.memory import Memory, Seen
from chairward_stereo_range.odometry import FloorOdometry, Steady
from chairward_stereo_range.region import Bools

DROP_FARTHEST_MM = 2000.0
"""A drop farther than this is not reported: the floor's mirror images are too alike."""


@dataclass(frozen=True, slots=True)
class Tracked:
    """One frame's result. ahead_mm: from the footprint, inf when nothing is near; depth_mm: the same thing's depth.

    driven_mm: forward since the last frame, None unknown.
    """

    measurement: Measurement
    ahead_mm: float
    depth_mm: float
    can_see: bool
    reason: str
    closing_mm_s: float = 0.0
    driven_mm: float | None = None


class Tracker:
    """Keeps what one lane knows between frames. The thesis methods get none of it: they had none."""

    def __init__(self, finder: RangeFinder) -> None:
        self.finder = finder
        view = finder.view
        self._plain = finder.is_thesis
        self._faults = FaultWatch()
        self._edge = EdgeTrack()
        self._known_clear = KnownClear()
        self._odometry = FloorOdometry(view) if view.floor_known else None
        self._steady = Steady()
        if self._odometry is not None and self._odometry.visible_from_mm == inf:
            self._odometry = None
        gone = self._odometry.visible_from_mm + view.ahead_offset_mm() if self._odometry is not None else 0.0
        self._memory = Memory(gone, view.footprint.front_mm + view.footprint.rear_mm)
        floor_mm = self._odometry.middle_mm + view.pose.x_mm if self._odometry is not None else inf
        self._leaving = Leaving(view, finder.region.half_width_mm, finder.top, finder.options.nearest_mm, floor_mm)

    def step(self, left: Image, right: Image, captured_ns: int, skew_ns: int = 0, mask: Bools | None = None) -> Tracked:
        """left, right: the rectified pair, h x w x 3 BGR. mask: appearance's obstacles, for the thesis methods."""
        found = self.finder.measure(left, right, mask)
        if self._plain:
            return _single(found)
        fault = self._faults.check(left, right, skew_ns)
        moved = (
            self._steady.step(self._odometry.step(left, found.obstacle))
            if self._odometry is not None and not fault
            else None
        )
        driven, sideways = moved if moved is not None else (None, 0.0)
        drop = self._drop(None if fault else found.drop, captured_ns / 1e9, driven)
        nearest = None if fault else min((s for s in (found.ahead, drop) if s), key=lambda s: s.ahead_mm, default=None)
        time_s, ahead_mm = captured_ns / 1e9, inf if nearest is None else nearest.ahead_mm
        known = self._known_clear.step(time_s, found.can_see and not fault, ahead_mm, driven, sideways)
        can_see = not fault and (found.can_see or (found.doubt and known))
        seen = Seen(
            time_s,
            None if nearest is None else nearest.ahead_mm,
            inf if nearest is None else nearest.top_mm,
        )
        kept = self._memory.step(seen, driven, sideways)
        edge = None if nearest is None else Edge(nearest.ahead_mm, nearest.left_mm, nearest.low_mm)
        gone_mm = self._leaving.step(edge, driven, sideways)
        if gone_mm is not None and (kept.ahead_mm is None or gone_mm < kept.ahead_mm):
            reason = fault or found.reason or "a thing has gone out of view"
            return Tracked(found, gone_mm, self.depth_mm(gone_mm), can_see, reason, 0.0, driven)
        if kept.from_memory and kept.ahead_mm is not None:
            reason = fault or found.reason or "a low thing has gone under the view"
            return Tracked(found, kept.ahead_mm, self.depth_mm(kept.ahead_mm), can_see, reason, 0.0, driven)
        return Tracked(
            found,
            ahead_mm,
            inf if nearest is None else nearest.depth_mm,
            can_see,
            fault or found.reason or ("the floor ends" if nearest is not None and nearest is drop else ""),
            kept.closing_mm_s,
            driven,
        )

    def _drop(self, seen: Spot | None, time_s: float, driven_mm: float | None) -> Spot | None:
        """Where the floor ends, as far as that is sure: as seen in this picture, or carried here."""
        seen_mm = seen.ahead_mm if seen is not None and seen.ahead_mm <= DROP_FARTHEST_MM else None
        ahead_mm = self._edge.step(time_s, seen_mm, driven_mm)
        if ahead_mm is None:
            return None
        if seen is not None and seen.ahead_mm == ahead_mm:
            return seen
        view = self.finder.view
        return Spot(self.depth_mm(ahead_mm), ahead_mm, view.geometry.height_px - 1, view.geometry.width_px // 2, 0, 0.0)

    def depth_mm(self, ahead_mm: float) -> float:
        """Depth of a floor point that is ahead_mm before the footprint, straight ahead."""
        p = self.finder.view.pose
        lens = ahead_mm - self.finder.view.ahead_offset_mm()
        pitch = np.radians(p.pitch_deg)
        return float(lens * np.cos(pitch) + p.z_mm * np.sin(pitch)) if p.pitch_deg else lens


def _single(found: Measurement) -> Tracked:
    spot = found.ahead
    return Tracked(
        found,
        inf if spot is None else spot.ahead_mm,
        inf if spot is None else spot.depth_mm,
        found.can_see,
        found.reason,
    )

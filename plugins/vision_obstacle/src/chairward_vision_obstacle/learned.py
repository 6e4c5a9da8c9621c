"""The default method: obstacles by a look that is not the floor's, the floor's look being what stereo shows it to be.

For each picture: learn from the pixels stereo has just measured to be floor; call the rest unlike; keep what stereo,
too, has seen stand up there (regions) or what is thin, long and outstanding on measured floor (cables); confirm over
several pictures and carry on what slips under the view (track). Distances are the ground plane's, independent of
stereo's. It adds a vote of its own and takes none away.
"""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
import numpy.typing as npt

from chairward.components import Footprint, Pose
from chairward.stages import DisparityMap, FloorMap, Image, RectifiedPair, StereoGeometry
from chairward_vision_obstacle import cables, regions
from chairward_vision_obstacle.birdseye import CELL_MM, BirdsEye, Shift
from chairward_vision_obstacle.floor_look import FloorLook, looks
from chairward_vision_obstacle.ground import Ground, make_ground
from chairward_vision_obstacle.heading import FreePath, feet, free_path
from chairward_vision_obstacle.regions import Cues, Sighting
from chairward_vision_obstacle.settings import VisionObstacleSettings
from chairward_vision_obstacle.track import Track, Tracked

Bools = npt.NDArray[np.bool_]

DARK, BRIGHT = 16, 250
"""Grey levels: the brightest twentieth below the one, or all but the darkest tenth above the other, show nothing."""
ROWS = 120
"""Rows of the picture in which looks are judged; cables are looked for at full size."""


@dataclass(frozen=True, slots=True)
class Judgement:
    """mask: h x w bool of the picture's size, what is not floor. nearest: confirmed, or None. can_see and reason."""

    mask: Bools
    nearest: Tracked | None
    path: FreePath
    can_see: bool
    reason: str
    shift: Shift | None
    sighting: Sighting | None
    cable: Sighting | None


class LearnedVision:
    """Judges the pictures of one geometry, in the order in which they were taken."""

    def __init__(
        self, settings: VisionObstacleSettings, geometry: StereoGeometry, pose: Pose, footprint: Footprint
    ) -> None:
        self._settings, self._geometry = settings, geometry
        self._half_width_mm = footprint.half_width_mm + settings.side_margin_mm
        small = (round(geometry.width_px * ROWS / geometry.height_px), ROWS)
        self.ground: Ground = make_ground(geometry, pose, footprint, small, settings.side_margin_mm)
        lens_mm = self.ground.nearest_mm - self.ground.offset_mm
        self._above = BirdsEye(geometry, pose, lens_mm, self._half_width_mm + 60.0)
        self._in_view = self._above.valid(geometry.height_px, geometry.width_px)
        self._look = FloorLook(
            settings.share, settings.contrast, settings.fast_s, settings.slow_s, settings.enough_pixels
        )
        self._things = Track(self.ground.nearest_mm, self._half_width_mm, settings.confirm)
        self._cables = Track(self.ground.nearest_mm, self._half_width_mm, settings.confirm_thin)

    def judge(self, pair: RectifiedPair, floor_map: FloorMap, disparity: DisparityMap | None) -> Judgement:
        """What one picture says, with all that came before it."""
        height, width = pair.left.shape[:2]
        size = (self.ground.shape[1], self.ground.shape[0])
        small = np.asarray(cv2.resize(pair.left, size, interpolation=cv2.INTER_AREA), np.uint8)
        flat = _shrunk(floor_map.floor, size, 0.5) & self.ground.seen
        raised = _shrunk(floor_map.obstacle, size, 0.25)
        bins = looks(small)
        around = cv2.dilate(raised.astype(np.uint8), np.ones((5, 9), np.uint8)) > 0
        surely_floor = between(flat, np.asarray(around)) & self.ground.seen & ~around
        self._look.learn(bins, surely_floor, raised, pair.captured_ns)
        cues = Cues(~self._look.is_floor(bins), raised, flat, self._depth(disparity, size))
        mask = regions.obstacle_mask(cues)
        above = self._above.look(pair.left)
        raised_above = (
            cv2.dilate(self._above.look_mask(floor_map.obstacle).astype(np.uint8), np.ones((5, 5), np.uint8)) > 0
        )
        floor_above = np.asarray(self._in_view & ~raised_above)
        shift = self._above.shift(above, floor_above)
        thin = cables.thin_things(np.asarray(cv2.cvtColor(above, cv2.COLOR_BGR2GRAY), np.uint8), floor_above)
        light = _light(small)
        knows = self._look.knows and not light
        thing = regions.nearest(mask, cues, self.ground, self._half_width_mm) if knows else None
        cable = self._cable(thin) if knows else None
        tracked = [
            self._things.step(pair.captured_ns, thing, shift),
            self._cables.step(pair.captured_ns, cable, shift),
        ]
        nearest = min((t for t in tracked if t is not None), key=lambda t: t.ahead_mm, default=None)
        path = free_path(*feet(mask, self.ground), self._half_width_mm)
        full = np.asarray(cv2.resize(mask.astype(np.uint8), (width, height), interpolation=cv2.INTER_NEAREST) > 0)
        if thin.any():
            full = full | self._above.back(thin, height, width)
        reason = light or ("" if self._look.knows else "has not seen enough floor yet to know its look")
        return Judgement(full, nearest, path, not reason, reason, shift, thing, cable)

    def _depth(self, disparity: DisparityMap | None, size: tuple[int, int]) -> npt.NDArray[np.float32]:
        """Depth along the optical axis, mm, inf where unknown."""
        if disparity is None:
            return np.full((size[1], size[0]), np.inf, np.float32)
        near = cv2.resize(disparity.disparity_px, size, interpolation=cv2.INTER_NEAREST)
        total = np.asarray(near, np.float32) + np.float32(disparity.geometry.doffs_px)
        fb = np.float32(disparity.geometry.focal_px * disparity.geometry.baseline_mm)
        with np.errstate(invalid="ignore"):
            known = total > 0
        depth = np.full(total.shape, np.inf, np.float32)
        np.divide(fb, total, out=depth, where=known)
        return depth

    def _cable(self, thin: Bools) -> Sighting | None:
        """The nearest thin thing in the corridor."""
        reach = round(self._half_width_mm / CELL_MM)
        middle = thin.shape[1] // 2
        rows = np.nonzero(thin[:, middle - reach : middle + reach].any(axis=1))[0]
        if not rows.size:
            return None
        forward_mm = self._above.near_mm + (thin.shape[0] - 1 - int(rows[-1])) * CELL_MM
        cut = int(rows[-1]) >= thin.shape[0] - 2
        return Sighting(forward_mm + self.ground.offset_mm, cut=cut, label="something thin on the floor")


def between(flat: Bools, raised: Bools) -> Bools:
    """flat, and every run of a row between two flat pixels that holds no raised one: the plain middle of a tile."""
    columns = np.arange(flat.shape[1], dtype=np.int16)
    none_left, none_right = np.int16(-1), np.int16(flat.shape[1])
    flat_before = np.maximum.accumulate(np.where(flat, columns, none_left), axis=1)
    raised_before = np.maximum.accumulate(np.where(raised, columns, none_left), axis=1)
    flat_after = np.minimum.accumulate(np.where(flat, columns, none_right)[:, ::-1], axis=1)[:, ::-1]
    raised_after = np.minimum.accumulate(np.where(raised, columns, none_right)[:, ::-1], axis=1)[:, ::-1]
    enclosed = (flat_before > raised_before) & (flat_after < raised_after)
    return np.asarray(flat | enclosed, np.bool_)


def _shrunk(mask: Bools, size: tuple[int, int], share: float) -> Bools:
    """The mask at another size: set where at least `share` of the pixels were."""
    return np.asarray(cv2.resize(mask.astype(np.uint8) * 255, size, interpolation=cv2.INTER_AREA) >= 255 * share)


def _light(small: Image) -> str:
    """Why the light does not do, or ""."""
    grey = np.asarray(cv2.cvtColor(small, cv2.COLOR_BGR2GRAY), np.uint8)
    if cables.level(grey, 0.95) < DARK:
        return "too dark to see"
    if cables.level(grey, 0.1) > BRIGHT:
        return "too bright to see"
    return ""

"""Things in the chair's way: connected regions that do not look like floor *and* hold pixels that stereo saw stand up.

Each cue alone is weak. Appearance calls shadows, rugs and glare obstacles; stereo has stray matches, and too few pixels
on plain or thin things. So a region counts only where the two agree, and on the distance too: the row where the region
meets the floor (camera height and pitch alone) must say what the disparities of the pixels inside it say.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import cv2
import numpy as np
import numpy.typing as npt

from chairward.stages import Floats
from chairward_vision_obstacle.ground import Ground

Bools = npt.NDArray[np.bool_]

MIN_SEEDS = 12
MIN_PIXELS = 30
LOW_MM = 60.0
"""What is lower than this above the floor is floor to stereo: so far down a region is followed by its look alone."""
FOOT_MM = 40.0
"""So wide must the foot of a thing be; narrower ones are left to stereo."""
NEARER, FARTHER = 0.75, 1.4
"""So much nearer or farther than stereo's distance may the foot's be. Farther is common: what is low above the floor is
still floor to stereo, and shoes look like shadows."""
NEAR_QUANTILE = 0.15


class Sighting(NamedTuple):
    """Something ahead, mm from the footprint; cut: the picture's edge cuts it off, so it is at most so far.

    tall: it reaches above the camera's own height, so it can leave the view only sideways, never downwards.
    """

    ahead_mm: float
    cut: bool = False
    label: str = "obstacle"
    tall: bool = False


@dataclass(frozen=True, slots=True)
class Cues:
    """What one picture says, all h x w of the ground's size.

    unlike: does not look like floor. raised: stereo measured it to stand above the floor. flat: to be floor.
    depth_mm: along the optical axis by stereo, inf unknown.
    """

    unlike: Bools
    raised: Bools
    flat: Bools
    depth_mm: Floats


def obstacle_mask(cues: Cues) -> Bools:
    """Everything that is not floor by either cue; specks are removed."""
    mask = (cues.unlike & ~cues.flat) | cues.raised
    opened = cv2.morphologyEx(mask.astype(np.uint8), cv2.MORPH_OPEN, np.ones((3, 3), np.uint8))
    return np.asarray(opened > 0, np.bool_)


def nearest(mask: Bools, cues: Cues, ground: Ground, half_width_mm: float) -> Sighting | None:
    """The nearest region in the corridor on which both cues agree; None when there is none."""
    count, labels = cv2.connectedComponents(mask.astype(np.uint8), connectivity=8)
    with np.errstate(invalid="ignore"):
        inside = np.abs(cues.depth_mm * ground.left_ray) <= half_width_mm
    seeds = cues.raised & mask & inside
    seeds_of = np.bincount(labels[seeds], minlength=count)
    area_of = np.bincount(labels[ground.corridor & mask], minlength=count)
    flat_of = np.bincount(labels[ground.corridor & mask & cues.flat], minlength=count)
    found: list[Sighting] = []
    for label in np.nonzero((seeds_of >= MIN_SEEDS) & (area_of >= MIN_PIXELS) & (seeds_of > flat_of))[0]:
        if label:
            region = labels == label
            distance = cues.depth_mm * ground.forward_ray + ground.offset_mm
            sighting = _sighting(region, cues.unlike, distance[seeds & region], ground)
            if sighting is not None:
                found.append(sighting)
    return min(found, default=None)


def _sighting(region: Bools, unlike: Bools, stereo_mm: Floats, ground: Ground) -> Sighting | None:
    """Where one region stands, if its foot and its disparities agree."""
    near_mm = float(np.quantile(stereo_mm, NEAR_QUANTILE))
    foot = _foot(region & ground.corridor, ground)
    if foot is None:
        return None
    low_rows = round(LOW_MM / _width_mm(foot[0], ground))
    grown = cv2.dilate(region.astype(np.uint8), np.ones((low_rows + 1, 1), np.uint8), anchor=(0, low_rows)) > 0
    row, foot_mm = _foot((region | (grown & unlike)) & ground.corridor, ground) or foot
    tall = bool(region[: ground.horizon_row].any())
    if row < ground.bottom - 2:
        agree = NEARER * near_mm <= foot_mm <= FARTHER * near_mm
        return Sighting(min(foot_mm, near_mm), tall=tall) if agree else None
    # The foot is below the picture: nearer than the nearest floor seen. Only what rises above the horizon can be
    # told from a stain that reaches down to the picture's edge.
    if tall and near_mm <= ground.nearest_mm * FARTHER:
        return Sighting(min(near_mm, ground.nearest_mm), tall=True)
    return None


def _foot(part: Bools, ground: Ground) -> tuple[int, float] | None:
    """(row, distance) of the lowest row by which the region is at least FOOT_MM wide, or None."""
    rows, columns = part.shape
    lowest = np.where(part.any(axis=0), rows - 1 - np.argmax(part[::-1], axis=0), -1)
    reach = np.cumsum(np.bincount(lowest[lowest >= 0], minlength=rows)[::-1])[::-1]
    for row in range(rows - 1, ground.horizon_row, -1):
        if reach[row] >= 3 and reach[row] * _width_mm(row, ground) >= FOOT_MM:
            return row, float(ground.forward_mm[row, columns // 2])
    return None


def _width_mm(row: int, ground: Ground) -> float:
    """How much floor one pixel of a row shows from side to side."""
    middle = ground.shape[1] // 2
    return abs(float(ground.left_mm[row, middle] - ground.left_mm[row, middle - 1]))

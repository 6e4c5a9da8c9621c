"""Pictures for people."""

from __future__ import annotations

import cv2
import numpy as np
import numpy.typing as npt

from chairward.stages import Image
from chairward_vision_obstacle.ground import Ground
from chairward_vision_obstacle.learned import Judgement

DIM = 3
"""The floor is shown at a third of its brightness, obstacles white over half: black and white as in the thesis."""


def black_and_white(mask: npt.NDArray[np.bool_]) -> Image:
    """White obstacle, black floor, h x w x 3 (thesis section 3)."""
    grey = mask.astype(np.uint8) * 255
    return np.repeat(grey[..., None], 3, axis=2)


def overlay(left: Image, found: Judgement, ground: Ground) -> Image:
    """The picture dimmed, obstacles light, the corridor's outline, the freest heading and the nearest thing's row."""
    picture = left // DIM
    picture[found.mask] = picture[found.mask] + 128
    height, width = left.shape[:2]
    scale = height / ground.shape[0]
    outline = ground.corridor.astype(np.uint8)
    contours, _ = cv2.findContours(outline, cv2.RETR_EXTERNAL, cv2.CHAIN_APPROX_SIMPLE)
    scaled = [np.asarray(contour * scale, np.int32) for contour in contours]
    cv2.drawContours(picture, scaled, -1, (0, 200, 200), 1)
    heading = np.radians(found.path.best_deg)
    foot = (width // 2, height - 1)
    tip = (int(width / 2 - np.sin(heading) * height * 0.3), int(height - np.cos(heading) * height * 0.3))
    cv2.arrowedLine(picture, foot, tip, (80, 220, 80), 2, tipLength=0.2)
    if found.nearest is not None:
        row = _row_of(found.nearest.ahead_mm, ground)
        cv2.line(picture, (0, int(row * scale)), (width, int(row * scale)), (60, 60, 255), 2)
    return np.asarray(picture, np.uint8)


def _row_of(ahead_mm: float, ground: Ground) -> int:
    """The row in which the floor is so far away; the last one for what is under the view."""
    middle = ground.forward_mm[:, ground.shape[1] // 2]
    rows = np.nonzero(middle <= ahead_mm)[0]
    return int(rows[0]) if rows.size else ground.shape[0] - 1

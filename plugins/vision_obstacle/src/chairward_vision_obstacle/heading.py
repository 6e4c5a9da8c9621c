"""Which way is free: how far the chair could go straight on after turning a little, by where things meet the floor."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from chairward.messages import NOTHING_NEAR_MM
from chairward_vision_obstacle.ground import FAR_MM, Ground

Bools = npt.NDArray[np.bool_]

HEADINGS_DEG = tuple(range(-30, 31, 5))
SIDE_DEG = 15


@dataclass(frozen=True, slots=True)
class FreePath:
    """free_mm: for each of HEADINGS_DEG (left positive) how far the swept path is free, up to 5000.

    best_deg: the heading nearest to straight on of those that are (almost) the freest.
    left_mm, right_mm: the freest of the headings from SIDE_DEG on to each side.
    """

    free_mm: tuple[int, ...]
    best_deg: int
    left_mm: int
    right_mm: int


def feet(mask: Bools, ground: Ground) -> tuple[npt.NDArray[np.float32], npt.NDArray[np.float32]]:
    """(forward_mm, left_mm) of the lowest obstacle pixel of every column that has one on visible floor."""
    part = mask & ground.seen
    columns = np.nonzero(part.any(axis=0))[0]
    rows = mask.shape[0] - 1 - np.argmax(part[::-1, columns], axis=0)
    return ground.forward_mm[rows, columns], ground.left_mm[rows, columns]


def free_path(forward_mm: npt.ArrayLike, left_mm: npt.ArrayLike, half_width_mm: float) -> FreePath:
    """The free way among things that stand at these points (from the footprint's front edge)."""
    x, y = np.asarray(forward_mm, np.float64), np.asarray(left_mm, np.float64)
    angles = np.radians(HEADINGS_DEG)[:, None]
    along, across = np.cos(angles) * x + np.sin(angles) * y, np.cos(angles) * y - np.sin(angles) * x
    hit = (np.abs(across) <= half_width_mm) & (along >= 0) & (along < FAR_MM)
    nearest = np.where(hit, along, NOTHING_NEAR_MM).min(axis=1, initial=NOTHING_NEAR_MM)
    free = [int(f) for f in nearest]
    most = max(free)
    best = min((abs(d), d) for d, f in zip(HEADINGS_DEG, free, strict=True) if f >= 0.95 * most)[1]
    left = max(f for d, f in zip(HEADINGS_DEG, free, strict=True) if d >= SIDE_DEG)
    right = max(f for d, f in zip(HEADINGS_DEG, free, strict=True) if d <= -SIDE_DEG)
    return FreePath(tuple(free), best, left, right)

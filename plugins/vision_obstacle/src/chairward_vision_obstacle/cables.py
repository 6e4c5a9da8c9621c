"""Thin things lying across the way (cables, edges), too low for stereo: straight pieces that stand out from the floor.

On the floor seen from above, every place and direction is asked: how much does a piece of line, 250 mm long and as wide
as a cable looks there, differ from the floor on *both* of its sides? What the floor's own grain, planks and joints give
as an answer is learned from the same picture, in all three colours (an anomaly detector as in Reed and Yu 1990). A
cable stands out from that, and nothing else on the floor, across or along, comes near it in the same colour: joints and
stripes come in numbers. The edge of a rug or shadow differs on one side only, a broad shadow is broader.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache
from typing import Any, NamedTuple

import cv2
import numpy as np
import numpy.typing as npt

from chairward_vision_obstacle.birdseye import CELL_MM

Image = npt.NDArray[np.uint8]
Bools = npt.NDArray[np.bool_]
Floats = npt.NDArray[np.float32]

THICK_MM = 20.0
LENGTH = 25
"""Cells of a piece of line."""
STEP = 3
"""Cells from one piece to the next along the line."""
SAMPLE = 2500
"""Pieces from which the floor's own are learned."""
GAP, SIDE = 1, 5
"""Cells between a line and the floor beside it, and of that floor."""
ACROSS_DEG = (-36, -24, -12, 0, 12, 24, 36)
ALONG_DEG = (-30, 0, 30)
OUTSTANDING = 7.0
"""Deviations of the floor's own pieces by which a cable differs from it."""
SINGULAR = 1.8
"""Times by which it differs more than the most outstanding piece elsewhere."""
BOTH_SIDES = 0.6
"""Of the difference: the lesser one of the two sides."""
ORDINARY = 0.85
"""Part of all pieces that is taken to be the floor's own: the most outstanding ones may be the cable."""
BROADER = 2
"""Cells by which a cable may look broader than expected."""
LEAST_ACROSS = 15
"""Cells of it inside the corridor."""
LEAST_PIECES = 50


class Cable(NamedTuple):
    """row: cells from the far edge of the grid to the nearest point in the corridor. cells: where it lies."""

    row: int
    cells: Bools


@dataclass(frozen=True, slots=True)
class _Pieces:
    """Differences from the floor on the far and on the near side, angles x rows x every STEPth column x 3.

    ok: both are known.
    """

    far: Floats
    near: Floats
    ok: Bools


def width_cells(height_mm: float, ahead_mm: float) -> int:
    """How many cells a cable hides (odd): its thickness, and what its height hides behind it."""
    return round(THICK_MM * (1 + ahead_mm / height_mm) / CELL_MM) | 1


def unseen_cells(width: int) -> int:
    """Nearer to the grid's edge than this a cable is not found, or a little too far away: its near side is not seen."""
    return width // 2 + GAP + SIDE + 6


def find(above: Image, floor: Bools, width: int, reach: int) -> Cable | None:
    """The cable that stands out most. above: rows x columns x 3; floor: cells in view and not measured as raised.

    width: see width_cells. reach: cells from the middle column to the corridor's sides.
    """
    # The root makes the sensor's noise equally strong in light and dark.
    colours = np.sqrt(above.astype(np.float32) + 2.0)
    across = _pieces(colours, floor, ACROSS_DEG, width)
    if int(across.ok.sum()) < LEAST_PIECES:
        return None
    along = _pieces(np.ascontiguousarray(colours.transpose(1, 0, 2)), np.ascontiguousarray(floor.T), ALONG_DEG, width)
    ordinary = np.concatenate([(p.far[p.ok] + p.near[p.ok]) / 2 for p in (across, along)])
    whiten = _whitening(ordinary[:: 1 + len(ordinary) // SAMPLE])
    far, near = across.far @ whiten, across.near @ whiten
    both = (far + near) / 2
    strength = np.sqrt((both**2).sum(axis=-1))
    lesser = np.minimum((far * both).sum(axis=-1), (near * both).sum(axis=-1))
    score = np.where(across.ok & (lesser > BOTH_SIDES * strength**2), strength, 0.0)
    angle, row, column = np.unravel_index(int(score.argmax()), score.shape)
    best = float(score[angle, row, column])
    if best < OUTSTANDING:
        return None
    colour = whiten @ (both[angle, row, column] / best)
    like = _likeness(across, colour)
    rows, columns = floor.shape
    run = np.zeros(columns)
    run[::STEP] = like[angle, row] >= best / 2
    present = np.convolve(run, np.ones(LENGTH), "same") > 0
    line = row + _steps(columns, ACROSS_DEG[angle])
    at = np.abs(np.arange(rows)[:, None] - line[None, :])
    beside = at <= width + SIDE
    others = max(
        _elsewhere(like, beside, ACROSS_DEG),
        _elsewhere(_likeness(along, colour), np.ascontiguousarray(beside.T), ALONG_DEG, touch=0.5),
    )
    if best < SINGULAR * others or _breadth(colours @ colour, floor, line, present) > width + BROADER:
        return None
    middle = columns // 2
    inside = np.nonzero(present & (np.abs(np.arange(columns) - middle) < reach))[0]
    if inside.size < LEAST_ACROSS:
        return None
    return Cable(min(rows - 1, int(line[inside].max()) + width // 2), (at <= width // 2) & present[None, :])


def _pieces(colours: Floats, floor: Bools, angles: tuple[int, ...], width: int) -> _Pieces:
    """All pieces of line: the mean of LENGTH x width cells, less that of SIDE rows on either side of it."""
    rows, columns = floor.shape
    edge = width // 2 + GAP + SIDE + 1
    index = _sheared(rows, columns, angles, edge)
    known = np.append(floor.ravel(), False)[index].astype(np.float32)
    values = np.concatenate([colours.reshape(-1, 3), np.zeros((1, 3), np.float32)])[index] * known[..., None]

    known_along, values_along = (_along(field) for field in (known, values))

    def means(height: int) -> tuple[Floats, Floats]:
        share, total = cv2.blur(known_along, (1, height)), cv2.blur(values_along, (1, height))
        return np.asarray(total / np.maximum(share, 0.1)[..., None], np.float32), np.asarray(share, np.float32)

    (line, line_share), (side, side_share) = means(width), means(SIDE)
    off = width // 2 + GAP + SIDE // 2 + 1
    shape = (len(angles), rows + 2 * edge, known_along.shape[1])
    kept = slice(edge, edge + rows)

    def cut(field: npt.NDArray[Any]) -> npt.NDArray[Any]:
        return field.reshape(*shape, *field.shape[2:])[:, kept]

    ok = (line_share > 0.9) & (np.roll(side_share, off, 0) > 0.8) & (np.roll(side_share, -off, 0) > 0.8)
    return _Pieces(cut(line - np.roll(side, off, 0)), cut(line - np.roll(side, -off, 0)), np.asarray(cut(ok), np.bool_))


def _along(field: Floats) -> Floats:
    """The mean over LENGTH cells of a row, in every STEPth column; beyond the grid there is nothing."""
    return np.asarray(cv2.blur(field, (LENGTH, 1), borderType=cv2.BORDER_CONSTANT)[:, ::STEP], np.float32)


@cache
def _sheared(rows: int, columns: int, angles: tuple[int, ...], edge: int) -> npt.NDArray[np.intp]:
    """For each angle the cells along lines of that slope, as level rows with `edge` empty ones above and below.

    Flat indices, (angles * (rows + 2 edge)) x columns; rows * columns is a cell that is nowhere.
    """
    wanted = np.arange(-edge, rows + edge)[None, :, None]
    source = wanted + np.stack([_steps(columns, angle) for angle in angles])[:, None, :]
    inside = (source >= 0) & (source < rows) & (wanted >= 0) & (wanted < rows)
    index = np.where(inside, source * columns + np.arange(columns), rows * columns)
    return np.asarray(index.reshape(-1, columns), np.intp)


def _steps(columns: int, angle_deg: int) -> npt.NDArray[np.intp]:
    """How many rows lower a line of that slope is in each column than in the middle."""
    return np.asarray(np.rint(np.tan(np.radians(angle_deg)) * (np.arange(columns) - (columns - 1) / 2)), np.intp)


def _whitening(sample: Floats) -> Floats:
    """W (3 x 3) so that sample @ W of the floor's own pieces has deviation 1 in every direction."""
    least = 0.01 * np.eye(3)
    spread = sample.T @ sample / len(sample) + least
    for _ in range(3):
        far = ((sample @ np.linalg.inv(spread)) * sample).sum(axis=-1)
        ordinary = sample[far <= np.quantile(far, ORDINARY)]
        spread = 1.6 * ordinary.T @ ordinary / len(ordinary) + least  # 1.6: what the cut took off
    return np.asarray(np.linalg.cholesky(np.linalg.inv(spread)), np.float32)


def _likeness(pieces: _Pieces, colour: Floats) -> Floats:
    """How strongly each piece differs from the floor on both sides in the sense of `colour`."""
    return np.asarray(np.where(pieces.ok, np.minimum(pieces.far @ colour, pieces.near @ colour), 0.0), np.float32)


def _elsewhere(like: Floats, beside: Bools, angles: tuple[int, ...], touch: float = 0.02) -> float:
    """The strongest likeness of pieces that are not on the line itself."""
    rows, columns = beside.shape
    sheared = np.append(beside.ravel(), False)[_sheared(rows, columns, angles, 0)]
    share = _along(sheared.astype(np.float32)).reshape(like.shape)
    return float(np.where(share > touch, 0.0, like).max())


def _breadth(signal: Floats, floor: Bools, line: npt.NDArray[np.intp], present: Bools) -> int:
    """Cells across the line, around its middle, on which it differs by at least half of its most."""
    reach = 14
    columns = np.nonzero(present)[0]
    rows = line[columns][None, :] + np.arange(-reach, reach + 1)[:, None]
    inside = (rows >= 0) & (rows < floor.shape[0])
    at = np.clip(rows, 0, floor.shape[0] - 1), np.broadcast_to(columns, rows.shape)
    known = inside & floor[at]
    count = known.sum(axis=1)
    profile = np.where(known, signal[at], 0.0).sum(axis=1) / np.maximum(count, 1)
    outer = [i for i in (0, 1, 2, -1, -2, -3) if count[i]]
    profile = profile - (np.mean([profile[i] for i in outer]) if outer else 0.0)
    high = (profile >= profile[reach - 2 : reach + 3].max() / 2) & (count > 0)
    low, top = reach, reach
    while low > 0 and high[low - 1]:
        low -= 1
    while top < 2 * reach and high[top + 1]:
        top += 1
    return top - low + 1

"""What the sensor cannot see, and how near something could be standing there.

A plain surface shows stereo its outline only. What lies between the rims can bulge towards the chair, as a column or a
box seen at its corner does, by up to half its width: so a plain patch of width W between rims at depth Z hides nothing
nearer than Z - W / 2. W is the whole surface's width, also where it reaches beyond the region.
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from chairward.stages import Floats
from chairward_stereo_range.geometry import View
from chairward_stereo_range.opencv import opencv
from chairward_stereo_range.pyramid import Match, gap_ends, islands
from chairward_stereo_range.region import Region
from chairward_stereo_range.texture import periodic

OPEN_PX = 5
"""Plain patches narrower than this on the half-size grid (at 240 rows) are occlusion seams, not surfaces."""
MIN_PATCH = 40
RIM_ISLAND = 20
RIM_SHARE = 0.15
HALF_RIM_SHARE = 0.35
RIM_PIXELS = 12
"""A rim (or its left or right half alone) counts as near when this part of it, and this many pixels, are obstacle."""
UNMATCHED_PIXELS = 60
"""Grid pixels (at 240 rows) with texture and without a match that are too many for an occlusion seam or for noise."""
REPEATING_SHARE = 0.1
"""A region of which so much repeats itself is not believed."""
FIT, FIT_WINDOW = 0.6, 9
"""What is left of the contrast where two pictures fit, on the half-size grid."""
SEAM_SLACK_PX = 4
"""Full-size px (at 240 rows) by which a seam may be wider than it should: both its rims are ragged."""


def hidden_distance_mm(
    match: Match,
    full: Floats,
    above: npt.NDArray[np.bool_],
    region: Region,
    view: View,
    scale: float,
) -> float:
    """The least depth at which something could stand unseen in the region, judged by the rims of plain patches; or inf.

    full: disparity with doffs, half-size grid; above: pixels measured to stand above the floor. Rims are believed also
    where they are nearer than the nearest thing of a fair size: a thing may show nothing but its rims.
    """
    cv2 = opencv()
    unmatched = ~match.textured | ~np.isfinite(match.fused)
    plain = unmatched & region.grid_mask
    side = max(3, int(OPEN_PX * scale) | 1)
    plain8 = cv2.morphologyEx(plain.astype(np.uint8), cv2.MORPH_OPEN, np.ones((side, side), np.uint8))
    count, labels, stats, _ = cv2.connectedComponentsWithStats(plain8)
    least = np.inf
    trusted = islands(full, above & ~unmatched, round(RIM_ISLAND * scale**2), scale)
    for i in range(1, count):
        x, y, w, h, area = (int(v) for v in stats[i])
        if area < MIN_PATCH * scale * scale:
            continue
        box = (slice(max(0, y - 3), y + h + 3), slice(max(0, x - 3), x + w + 3))
        patch = (labels[box] == i).astype(np.uint8)
        rim = cv2.dilate(patch, np.ones((7, 7), np.uint8)).astype(bool) & (patch == 0) & np.isfinite(match.fused[box])
        disparity = _rim_disparity(full[box], rim, rim & trusted[box], scale)
        if disparity is None:
            continue
        depth = view.fb / disparity
        within = int((patch.astype(bool) & region.contains(depth, box)).sum())
        if within < MIN_PATCH * scale * scale:
            continue
        # 2: the grid's pixels are two full-size ones wide. The mean width, as patches are ragged.
        width_mm = 2 * _width(unmatched, labels == i, y, h) * depth / view.geometry.focal_px
        least = min(least, depth - width_mm / 2)
    return float(least)


def _rim_disparity(full: Floats, rim: npt.NDArray[np.bool_], near: npt.NDArray[np.bool_], scale: float) -> float | None:
    """The whole rim's disparity, or that of its left or right half where it is nearer; None where none is near.

    A door that stands open towards the chair is far at its one side and near at the other.
    """
    middle = rim.shape[1] // 2
    halves = ((slice(0, middle), HALF_RIM_SHARE), (slice(middle, None), HALF_RIM_SHARE), (slice(None), RIM_SHARE))
    found = [
        float(np.median(full[:, part][near[:, part]]))
        for part, share in halves
        if near[:, part].sum() >= max(RIM_PIXELS * scale, share * int(rim[:, part].sum()))
    ]
    return max(found, default=None)


def out_of_match(match: Match, region: npt.NDArray[np.bool_], floor: Floats, scale: float) -> bool:
    """Does something with texture, as large as a thing close by, stand in the lower half of the region unmatched?

    What is near must reach down there. It is unmatched because it is nearer than the search goes, because only one
    camera sees it, or because it is too narrow for its own distance: each of them is a near thing's. A seam that a
    matched thing hides from the right camera does not count, nor what fits the floor, which may repeat itself.
    region: grid mask; floor: disparity of the floor on the grid, full-size px.
    """
    cv2 = opencv()
    half = match.fused.shape[0] // 2
    unmatched = match.textured & ~np.isfinite(match.fused) & region
    unmatched[:half] = False
    many = UNMATCHED_PIXELS * scale * scale
    if unmatched.sum() < many:
        return False
    unmatched[half:] &= ~_seams(match.fused[half:], scale)
    unmatched &= ~_fits(match, floor)
    opened = cv2.morphologyEx(unmatched.astype(np.uint8), cv2.MORPH_OPEN, np.ones((3, 3), np.uint8))
    _, _, stats, _ = cv2.connectedComponentsWithStats(opened)
    return bool((stats[1:, cv2.CC_STAT_AREA] >= many).any())


def repeats(
    match: Match, unsure: npt.NDArray[np.bool_], region: npt.NDArray[np.bool_], count: int, scale: float
) -> bool:
    """Does the lower half of the region, where a near thing must stand, repeat itself along its rows?

    Not where it is measured to be floor: shifted by a period it would stand at one depth over many rows. unsure,
    region: grid masks of what is not floor and of all; count: disparities searched, full-size px.
    """
    half, k = region.shape[0] // 2, round(scale)
    low, small, unsure = region[half:], match.small[half:], unsure[half:]
    if k > 1:  # a pattern that could be mistaken is as large as at 240 rows
        low, unsure = (m[: m.shape[0] // k * k : k, : m.shape[1] // k * k : k] for m in (low, unsure))
        small = np.asarray(opencv().resize(small, low.shape[::-1], interpolation=opencv().INTER_AREA), np.uint8)
    many = REPEATING_SHARE * max(1, int(np.count_nonzero(low)))
    if np.count_nonzero(unsure) <= many:
        return False
    return bool(np.count_nonzero(periodic(small, count // 2 // max(1, k), match.sigma) & unsure) > many)


def _fits(match: Match, disparity: Floats) -> npt.NDArray[np.bool_]:
    """Where the left strip looks like the right one at these disparities: all but a part of its contrast is gone."""
    cv2 = opencv()
    rows, columns = np.indices(disparity.shape, np.float32)
    other = cv2.remap(match.small_right, columns - disparity / 2, rows, cv2.INTER_LINEAR)
    side = (FIT_WINDOW, FIT_WINDOW)
    left = match.small.astype(np.float32)
    contrast = cv2.blur(np.abs(left - cv2.blur(left, side)), side)
    return np.asarray(cv2.blur(np.abs(left - other), side) <= FIT * contrast)


def _seams(fused: Floats, scale: float) -> npt.NDArray[np.bool_]:
    """Gaps that are no wider than the thing on their right side hides of what is on their left side.

    At the left border: than the right camera does not show.
    """
    w = fused.shape[1]
    before, after = gap_ends(np.isfinite(fused))
    rows = np.arange(fused.shape[0])[:, None]
    near = np.where(after < w, fused[rows, np.minimum(after, w - 1)], 0.0)
    far = np.where(before >= 0, fused[rows, np.maximum(before, 0)], 0.0)
    return np.asarray(2 * (after - before - 1) <= near - far + SEAM_SLACK_PX * scale)


def _width(plain: npt.NDArray[np.bool_], patch: npt.NDArray[np.bool_], top: int, rows: int) -> float:
    """Mean width of the plain surface that a patch of the region belongs to, over its rows, grid pixels."""
    cv2 = opencv()
    strip = plain[top : top + rows].astype(np.uint8)
    opened = cv2.morphologyEx(strip, cv2.MORPH_OPEN, np.ones((3, 3), np.uint8))
    _, labels = cv2.connectedComponents(opened)
    which = np.bincount(labels[patch[top : top + rows]])
    which[0] = 0
    return float((labels == int(which.argmax())).sum()) / rows

"""What perfect depth would tell: the renderer's own disparities in the place of the measured ones.

Everything else stays as it is: what both cameras see, the range searched, region, floor, nearest thing, honesty and
memory. What an oracle misses is the geometry's limit (out of view, hidden, too late seen); the rest is the matcher's.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import cv2
import numpy as np
import numpy.typing as npt
from photographs import Photographer

from chairward.components import Pose
from chairward.stages import Floats, Image, StereoGeometry
from chairward_simulator.scene import axes_of
from chairward_stereo_range.finder import RangeFinder
from chairward_stereo_range.pyramid import Match, half_size

SLACK_PX, SLACK_SHARE = 0.5, 0.02
"""A point is seen by the right camera, too, where that sees the same disparity to so much."""
SIGMA = 1.0


def true_disparity(photographer: Photographer, geometry: StereoGeometry, pose: Pose, heading_deg: float) -> Floats:
    """Disparity of the left picture's pixels that both cameras see, px, h x w; NaN elsewhere."""
    depth, _ = photographer.truth(geometry, pose, heading_deg)
    to_right = geometry.baseline_mm * axes_of(heading_deg, pose)[1]
    beside = replace(pose, **{f"{k}_mm": getattr(pose, f"{k}_mm") + float(to_right[i]) for i, k in enumerate("xyz")})
    there, _ = photographer.truth(geometry, beside, heading_deg)
    fb = geometry.focal_px * geometry.baseline_mm
    disparity, other = fb / depth, fb / there
    rows, columns = np.indices(disparity.shape)
    at = columns - disparity
    near = np.rint(at).astype(int)
    apart = np.full(disparity.shape, np.inf)
    for step in (-1, 0, 1):
        seen = other[rows, np.clip(near + step, 0, disparity.shape[1] - 1)]
        apart = np.minimum(apart, np.abs(seen - disparity))
    both = (at >= 0) & np.isfinite(depth) & (apart <= SLACK_PX + SLACK_SHARE * disparity)
    return np.where(both, disparity, np.nan).astype(np.float32)


class Oracle:
    """Gives every finder the true disparities instead of its matcher's, in the order of the frames measured."""

    def __init__(self, truths: Iterator[Floats]) -> None:
        self._truths = truths

    def prepare(self, finder: RangeFinder) -> None:
        """To be called with each finder before its first pair."""
        finder.match = lambda left, right: self._match(finder, left, right)

    def _match(self, finder: RangeFinder, left: Image, right: Image) -> Match:
        g = finder.view.geometry
        truth = next(self._truths)
        scale = g.width_px / truth.shape[1]
        whole = cv2.resize(truth, (g.width_px, g.height_px), interpolation=cv2.INTER_NEAREST) * np.float32(scale)
        precise = np.array(whole[finder.top : finder.bottom, : left.shape[1]], np.float32)
        with np.errstate(invalid="ignore"):
            precise[(precise < finder.first) | (precise >= finder.first + finder.count - 1)] = np.nan
        fused = np.ascontiguousarray(precise[::2, ::2])
        known: npt.NDArray[np.bool_] = np.isfinite(fused)
        return Match(fused, np.ones_like(known), known, precise, SIGMA, half_size(left), half_size(right))

"""Pictures for people: the left view with region and nearest thing, the right view, the disparity."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from chairward.stages import Image
from chairward_stereo_range.finder import Measurement, RangeFinder
from chairward_stereo_range.opencv import opencv

GREEN, YELLOW, RED, WHITE = (80, 200, 80), (40, 210, 240), (60, 60, 230), (255, 255, 255)


def draw(
    left: Image, right: Image, found: Measurement, finder: RangeFinder, stop_mm: int
) -> Iterator[tuple[str, Image]]:
    """(name, picture) of the three panes."""
    yield "left", overlay(left, found, stop_mm)
    yield "right", right
    yield "disparity", disparity_picture(found, finder.first, finder.count)


def overlay(left: Image, found: Measurement, stop_mm: int) -> Image:
    """The left picture with obstacles tinted, the region outlined, the nearest thing marked with its distance."""
    cv2 = opencv()
    out = left.copy()
    tint = found.obstacle & found.region
    out[tint] = out[tint] // 2 + np.array([30, 30, 110], np.uint8)
    outline, _ = cv2.findContours(found.region.astype(np.uint8), cv2.RETR_EXTERNAL, cv2.CHAIN_APPROX_SIMPLE)
    cv2.drawContours(out, outline, -1, WHITE, 1)
    if not found.can_see:
        cv2.putText(out, "cannot see", (8, 20), cv2.FONT_HERSHEY_SIMPLEX, 0.55, RED, 2, cv2.LINE_AA)
    if (spot := found.ahead) is not None:
        colour = RED if spot.ahead_mm <= stop_mm else YELLOW if spot.ahead_mm <= stop_mm + 150 else GREEN
        cv2.circle(out, (spot.col, spot.row), 8, colour, 2, cv2.LINE_AA)
        text = f"{max(0.0, spot.ahead_mm):.0f} mm"
        at = (min(spot.col + 11, out.shape[1] - 75), min(max(spot.row, 14), out.shape[0] - 5))
        cv2.putText(out, text, at, cv2.FONT_HERSHEY_SIMPLEX, 0.45, colour, 1, cv2.LINE_AA)
    return out


def disparity_picture(found: Measurement, first: int, count: int) -> Image:
    """Grey, brighter is nearer; black where nothing is known."""
    d = np.nan_to_num((found.disparity - first) / max(count, 1), nan=0.0)
    shade = np.clip(np.sqrt(np.clip(d, 0.0, 1.0)) * 255.0, 0, 255).astype(np.uint8)
    return np.repeat(shade[:, :, None], 3, axis=2)

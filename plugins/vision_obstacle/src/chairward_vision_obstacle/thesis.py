"""The thesis' obstacle picture (section 3) and side choice (section 5), faithfully: the baseline that is to be beaten.

Text and code of the thesis differ; both are here. All arithmetic on 8-bit pictures is exact (whole numbers), so that
no pixel's bin depends on rounding.

| | thesis_text | thesis_code |
| --- | --- | --- |
| low pass | 5x5 Gaussian | none |
| colours | hue, saturation, intensity (HSI) | hue, saturation, value (HSV) |
| reference area | trapezoid, rows 180..240 | rectangle, rows 180..240, columns 20..300 |
| hue counts where it is invalid | never | in the reference area not, elsewhere yes |
| histograms | 5 equal bins, averaged over 3 neighbours | 5 bins, edges .2001 .4001 .6001 .8001 |
| rare means | at most 1/50 of its own largest bin | at most 1/50 of the *other* histogram's largest bin |
| last | 9x9 median | 9x9 median |

The thesis states no size of its trapezoid; ours widens by one column in two rows from columns 50..270.
"""

from __future__ import annotations

from functools import cache
from typing import Literal, NamedTuple

import cv2
import numpy as np
import numpy.typing as npt

from chairward.stages import Image

Bools = npt.NDArray[np.bool_]
Ints = npt.NDArray[np.int32]

ThesisMethod = Literal["thesis_text", "thesis_code"]

WIDTH, HEIGHT = 320, 240
BINS = 5
RARE = 50
CODE_EDGES = (0.2001, 0.4001, 0.6001, 0.8001)


class Side(NamedTuple):
    """left, right: mean row of the lowest obstacle pixel over each outer third (0: free). side: the freer one."""

    left: float
    right: float
    side: Literal["left", "right"]


def obstacle_mask(image: Image, method: ThesisMethod) -> Bools:
    """True where a pixel looks unlike the reference area. image: h x w x 3 BGR; worked on at 320 x 240."""
    height, width = image.shape[:2]
    small = image
    if (width, height) != (WIDTH, HEIGHT):
        small = np.asarray(cv2.resize(image, (WIDTH, HEIGHT), interpolation=cv2.INTER_AREA), np.uint8)
    rare = _rare_by_text(small) if method == "thesis_text" else _rare_by_code(small)
    mask = cv2.medianBlur(rare.astype(np.uint8), 9)
    if (width, height) != (WIDTH, HEIGHT):
        mask = cv2.resize(mask, (width, height), interpolation=cv2.INTER_NEAREST)
    return np.asarray(mask > 0, np.bool_)


def choose_side(mask: Bools) -> Side:
    """The freer side of an obstacle picture (thesis section 5): there the obstacles' feet are farther up; ties: left.

    In every column the lowest obstacle pixel of rows 1..210 counts (of 240; 0 where there is none), averaged over
    columns 1..107 and 215..320 (of 320).
    """
    height, width = mask.shape
    looked = mask[: round(210 * height / HEIGHT)]
    rows = looked.shape[0] - np.argmax(looked[::-1], axis=0)
    lowest = np.where(looked.any(axis=0), rows, 0)
    left = float(lowest[: round(107 * width / WIDTH)].mean())
    right = float(lowest[round(214 * width / WIDTH) :].mean())
    return Side(left, right, "left" if left <= right else "right")


def _rare_by_text(image: Image) -> Bools:
    """Steps 1 to 5 as the text has them."""
    blurred = cv2.GaussianBlur(image, (5, 5), 0)
    blue, green, red = (blurred[..., i].astype(np.int32) for i in range(3))
    total = blue + green + red
    intensity_bin = np.minimum(total * BINS // 765, BINS - 1)
    # Saturation 1 - 3 min / (r + g + b) at least 0.1, intensity (r + g + b) / 765 at least 0.05, in whole numbers.
    valid = (10 * (total - 3 * np.minimum(np.minimum(blue, green), red)) >= total) & (20 * total >= 765)
    hue_bin = np.minimum((_hsi_hue(blue, green, red) * BINS).astype(np.int32), BINS - 1)
    area = _trapezoid()
    hues = np.bincount(hue_bin[area & valid], minlength=BINS).astype(np.float64)
    intensities = np.bincount(intensity_bin[area], minlength=BINS).astype(np.float64)
    hues = (np.roll(hues, 1) + hues + np.roll(hues, -1)) / 3  # hue is a circle
    padded = np.pad(intensities, 1, mode="edge")
    intensities = (padded[:-2] + padded[1:-1] + padded[2:]) / 3
    rare_hue, rare_intensity = hues * RARE <= hues.max(), intensities * RARE <= intensities.max()
    return np.asarray((valid & rare_hue[hue_bin]) | rare_intensity[intensity_bin], np.bool_)


def _rare_by_code(image: Image) -> Bools:
    """Steps 2 to 5 as the code has them."""
    blue, green, red = (image[..., i].astype(np.int32) for i in range(3))
    value = np.maximum(np.maximum(blue, green), red)
    spread = value - np.minimum(np.minimum(blue, green), red)
    hue_bin = np.searchsorted(CODE_EDGES, _hsv_hue(blue, green, red, value, spread), side="right")
    value_bin = np.searchsorted(CODE_EDGES, np.arange(256) / 255, side="right")[value]
    valid = (10 * spread >= value) & (value > 0) & (20 * value > 255)
    area = (slice(180, 240), slice(20, 300))
    hues = np.bincount(hue_bin[area][valid[area]], minlength=BINS)
    values = np.bincount(value_bin[area].ravel(), minlength=BINS)
    rare_hue, rare_value = hues * RARE <= values.max(), values * RARE <= hues.max()
    return np.asarray(rare_hue[hue_bin] | rare_value[value_bin], np.bool_)


def _hsi_hue(blue: Ints, green: Ints, red: Ints) -> npt.NDArray[np.float64]:
    """Hue as an angle in 0..1 by the arc cosine formula of the HSI model; 0 where there is no colour."""
    over = 2 * red - green - blue
    under = 2.0 * np.sqrt(((red - green) ** 2 + (red - blue) * (green - blue)).astype(np.float64))
    ratio = np.divide(over, under, out=np.ones_like(under), where=under > 0)
    angle = np.arccos(np.clip(ratio, -1.0, 1.0)) / (2 * np.pi)
    return np.asarray(np.where(blue > green, 1.0 - angle, angle), np.float64)


def _hsv_hue(blue: Ints, green: Ints, red: Ints, value: Ints, spread: Ints) -> npt.NDArray[np.float64]:
    """Hue in 0..1 by the hexagon formula of the HSV model; 0 where there is no colour."""
    base = np.select([value == red, value == green], [green - blue, blue - red], red - green)
    sector = np.select([value == red, value == green], [0, 2], 4)
    sixths = sector + base / np.maximum(spread, 1)
    return np.asarray(np.where(sixths < 0, sixths + 6, sixths) / 6.0, np.float64)


@cache
def _trapezoid() -> Bools:
    area = np.zeros((HEIGHT, WIDTH), np.bool_)
    for row in range(180, HEIGHT):
        widening = (row - 180) // 2
        area[row, 50 - widening : 270 + widening] = True
    return area

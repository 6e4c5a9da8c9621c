"""What `chairward doctor` looks at in a calibration: is it there, of this rig, and still true of the cameras now?"""

from __future__ import annotations

import time
from collections.abc import Iterator, Sequence
from datetime import date
from math import hypot

import numpy as np
from numpy.typing import NDArray

from chairward.doctor import Check, Finding, Site, not_tried
from chairward.stages import Floats, Image, StereoFrame
from chairward_stereo_range.calibration_file import Calibration, CalibrationError, Rectifier, load
from chairward_stereo_range.settings import StereoRangeSettings

OLD_DAYS = 180
POOR_PX = 1.0
EPIPOLAR_PX = 1.0
"""Rows between the same point in both rectified pictures: more, and distances come out wrong."""
BASELINES_MM = (20.0, 400.0)
FIX = "chairward calibrate stereo"
PAIRS = 3
WIDTH_PX, HEIGHT_PX = 320, 240


def checks() -> Sequence[Check]:
    """The file, then the cameras through it."""
    return [
        Check(name="calibration", component="stereo_range", look=file),
        Check(name="calibration now", component="stereo_range", look=now, timeout_s=8.0),
    ]


def file(site: Site) -> Iterator[Finding]:
    """The calibration file. Raises CalibrationError where it cannot be read, which is a finding too."""
    settings, live = _settings(site), _live(site)
    if settings.calibration is None:
        if live:
            yield _wrong("there is no calibration, so the chair is blind", f"{FIX}, then set stereo_range.calibration")
        else:
            yield not_tried("calibration", "none is named, and these cameras bring their own")
        return
    calibration = load(settings.calibration)
    yield from judge(calibration, date.fromtimestamp(time.time()), _asked_size(site))


def judge(calibration: Calibration, today: date, asked: tuple[int, int] | None) -> Iterator[Finding]:
    """What is wrong with a calibration by itself; asked: columns and rows that the cameras are set to."""
    size = (calibration.image_width_px, calibration.image_height_px)
    if asked is not None and asked != size:
        yield _wrong(
            f"it was made for {size[0]}x{size[1]} pictures, the cameras are set to {asked[0]}x{asked[1]}",
            f"set the cameras to {size[0]}x{size[1]}, or calibrate again",
        )
    x, y, z = calibration.translation_mm
    if x >= 0.0:
        yield _wrong(
            "its right camera stands left of the left one", "exchange cameras.left and right, or calibrate again"
        )
    elif not BASELINES_MM[0] <= hypot(x, y, z) <= BASELINES_MM[1]:
        yield _wrong(
            f"its cameras are {hypot(x, y, z):.0f} mm apart, which cannot be",
            "calibrate again with the true size of the board's squares (--square-mm)",
        )
    if calibration.epipolar_mean_px > POOR_PX:
        yield _wrong(
            f"it is poor: rows differ by {calibration.epipolar_mean_px:.1f} px on average",
            f"{FIX} again, with a flat board, more views, and still hands",
        )
    try:
        days = (today - date.fromisoformat(calibration.made[:10])).days
    except ValueError:
        days = 0
    if days > OLD_DAYS:
        yield Finding("calibration", False, f"it is {days} days old", f"{FIX} again", needed=False)


def now(site: Site) -> Iterator[Finding]:
    """Rows of the same point in both pictures, as the cameras stand now."""
    settings = _settings(site)
    if settings.calibration is None or not _live(site):
        why = "there is no calibration to look through" if _live(site) else "these are no cameras that stand somewhere"
        yield not_tried("calibration now", why)
        return
    rectify = Rectifier(load(settings.calibration), WIDTH_PX, HEIGHT_PX, str(settings.calibration))
    errors: list[float] = []
    for frame in site.take(StereoFrame, PAIRS, 4.0):
        try:
            found = rows_apart(*rectify(frame.left, frame.right))
        except CalibrationError as error:
            yield _wrong(str(error), "set the cameras to that size, or calibrate again")
            return
        errors += [] if found is None else [found]
    if not errors:
        yield not_tried("calibration now", "the two pictures have too few points in common")
    elif (median := float(np.median(errors))) > EPIPOLAR_PX:
        yield _wrong(
            f"the same point lies {median:.1f} rows apart in the two pictures: a camera has moved since",
            f"fasten both cameras, then {FIX} again",
        )


def rows_apart(left: Image, right: Image) -> float | None:
    """Median rows between points of the rectified left picture and where they are in the right one; None: too few."""
    import cv2

    a, b = (np.asarray(image.mean(axis=2), np.uint8) for image in (left, right))
    corners = cv2.goodFeaturesToTrack(a, 200, 0.01, 8)
    if corners is None or len(corners) < 15:
        return None
    here = np.asarray(corners, np.float32)
    there, found = _follow(a, b, here)
    back, again = _follow(b, a, there)
    sure = found & again & (np.abs(back - here).reshape(-1, 2).max(axis=1) < 0.7)
    if int(sure.sum()) < 15:
        return None
    return float(np.median(np.abs((there - here).reshape(-1, 2)[sure, 1])))


def _follow(a: Image, b: Image, points: Floats) -> tuple[Floats, NDArray[np.bool_]]:
    """Where points of one picture are in the other, and whether they were found (Lucas and Kanade)."""
    import cv2

    there, found, _ = cv2.calcOpticalFlowPyrLK(a, b, points, points.copy(), winSize=(15, 15), maxLevel=4)
    return np.asarray(there, np.float32), np.asarray(found).ravel() == 1


def _settings(site: Site) -> StereoRangeSettings:
    assert isinstance(site.settings, StereoRangeSettings)
    return site.settings


def _live(site: Site) -> bool:
    """Does the lane's source give raw pictures of real cameras?"""
    return site.lane is not None and site.lane.source.settings.get("kind") == "live"


def _asked_size(site: Site) -> tuple[int, int] | None:
    """What the source's settings ask of live cameras, where they have such settings."""
    asked = site.lane.source.settings if site.lane is not None and _live(site) else {}
    width, height = asked.get("width_px"), asked.get("height_px")
    return (int(width), int(height)) if width and height else None


def _wrong(what: str, fix: str) -> Finding:
    return Finding("calibration", False, what, fix)

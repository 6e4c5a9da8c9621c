"""What `chairward doctor` looks at in a pair of cameras: do both give pictures, good ones, of the same scene?

The pictures are taken straight from each camera, one after the other in one process. `judge` is pure, so that it can be
tried on any pictures.
"""

from __future__ import annotations

import os
import time
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from chairward.doctor import Check, Finding, Site
from chairward.stages import Image
from chairward_cameras.live import device_path
from chairward_cameras.settings import CamerasSettings

PICTURES = 12
WITHIN_S = 3.0
DARK, BRIGHT = 25.0, 235.0
"""Mean grey level of a picture that shows nothing, 0..255."""
BLURRED = 0.62
"""Of `blur`; sharp webcam pictures are below 0.5."""
UNEQUAL = 1.35
"""Ratio of the two cameras' mean grey levels."""
SHIFT_PX, TILT_PX, SAME_SHARE = 1.0, 3.0, 0.2
"""Disparity that is surely negative, rows that surely differ (at 320 columns), patches that must be found again."""


def checks() -> Sequence[Check]:
    """One check: both cameras have to be open for it anyway."""
    return [Check(name="cameras", component="cameras", look=cameras, timeout_s=9.0)]


def cameras(site: Site) -> Iterator[Finding]:
    """Live: the two cameras as they are now. Recorded pictures: that they can be read."""
    from chairward.stages import StereoFrame

    settings = site.settings
    assert isinstance(settings, CamerasSettings)
    if settings.kind != "live":
        if not site.take(StereoFrame, 1, 3.0):
            yield _wrong("its files give no pair of pictures", "correct the manifest or folder in the chair file")
        return
    if device_path(settings.left) == device_path(settings.right):
        yield _wrong(
            f"left ({settings.left}) and right ({settings.right}) are the same camera",
            "set cameras.right to the other one (v4l2-ctl --list-devices)",
        )
        return
    pictures: dict[str, list[Image]] = {}
    for side, name in (("left", settings.left), ("right", settings.right)):
        taken, why = take(device_path(name), settings)
        if why:
            yield _wrong(f"the {side} camera ({name}) {why[0]}", why[1])
        else:
            pictures[side] = taken
    if len(pictures) == 2:
        yield from judge(pictures["left"], pictures["right"], (settings.width_px, settings.height_px))


def take(path: str, settings: CamerasSettings) -> tuple[list[Image], tuple[str, str] | None]:
    """Some pictures, or what is wrong and what to do."""
    import cv2

    cv2.setNumThreads(1)
    is_device = path.startswith("/dev/video")
    if path.startswith("/") and not Path(path).exists():
        there = ", ".join(sorted(str(p) for p in Path("/dev").glob("video*"))) or "none"
        return [], (f"is not there (video devices now: {there})", "plug it in, or correct its name in the chair file")
    if path.startswith("/") and not os.access(path, os.R_OK):
        return [], ("may not be opened", "sudo usermod -aG video $USER, log in again")
    capture: Any = cv2.VideoCapture(path, cv2.CAP_V4L2 if is_device else cv2.CAP_ANY)
    try:
        if not capture.isOpened():
            return [], ("cannot be opened: another program has it, or it is no camera", "close the other program")
        if is_device:
            capture.set(cv2.CAP_PROP_FRAME_WIDTH, settings.width_px)
            capture.set(cv2.CAP_PROP_FRAME_HEIGHT, settings.height_px)
        taken: list[Image] = []
        end = time.monotonic() + WITHIN_S
        while len(taken) < PICTURES and time.monotonic() < end:
            good, image = capture.read()
            if not good:
                break
            taken.append(np.asarray(image, np.uint8))
    finally:
        capture.release()
    if len(taken) < PICTURES:
        return [], (f"gave {len(taken)} pictures and then none", "check its cable, and give it a USB port of its own")
    return taken, None


def judge(left: Sequence[Image], right: Sequence[Image], size: tuple[int, int]) -> Iterator[Finding]:
    """What is wrong with these pictures of two cameras, taken one after the other; size: columns, rows."""
    sides = {"left": left, "right": right}
    seen = dict.fromkeys(sides, True)
    for side, pictures in sides.items():
        for what, fix in _one(pictures, size):
            seen[side] = False
            yield _wrong(f"the {side} camera {what}", fix)
    if all(seen.values()):
        yield from _both(left[-1], right[-1])


def _one(pictures: Sequence[Image], size: tuple[int, int]) -> Iterator[tuple[str, str]]:
    """What is wrong with one camera, and what to do."""
    last = pictures[-1]
    given = (last.shape[1], last.shape[0])
    if given != size:
        yield (
            f"gives {given[0]}x{given[1]} pictures, {size[0]}x{size[1]} were asked for",
            f"set cameras.width_px and height_px to {given[0]} and {given[1]}, and calibrate again",
        )
    if all(np.array_equal(a, last) for a in pictures[:-1]):
        yield "is frozen: it gives the same picture again and again", "unplug it and plug it in again"
        return
    mean = float(np.mean([grey(picture).mean() for picture in pictures[-3:]]))
    if mean < DARK:
        yield f"sees nothing but dark (grey level {mean:.0f} of 255)", "uncover the lens, or switch on the light"
    elif mean > BRIGHT:
        yield f"sees nothing but white (grey level {mean:.0f} of 255)", "turn it from the light, or fix its exposure"
    elif (softness := blur(last)) > BLURRED:
        yield f"is out of focus (blur {softness:.2f} of 1)", "clean the lens, turn its focus ring, or set cameras.focus"


def _both(left: Image, right: Image) -> Iterator[Finding]:
    """Do the two fit together?"""
    a, b = float(grey(left).mean()), float(grey(right).mean())
    if max(a, b) > UNEQUAL * min(a, b):
        brighter = "left" if a > b else "right"
        yield _wrong(
            f"the {brighter} camera is {max(a, b) / min(a, b):.1f} times as bright as the other",
            "set cameras.exposure to the same value for both",
        )
    if left.shape != right.shape:
        return
    moves = matches(left, right)
    if moves is None:
        return
    share, shift, tilt = moves
    if share < SAME_SHARE:
        yield _wrong("the two cameras do not look at the same scene", "point both straight ahead, side by side")
    elif shift < -SHIFT_PX:
        yield _wrong("the two cameras are swapped: left sees what right should see", "exchange cameras.left and right")
    elif abs(tilt) > TILT_PX:
        yield _wrong(
            f"one camera sits higher or is tilted ({abs(tilt):.0f} rows apart)",
            "mount both level, then: chairward calibrate stereo",
        )


def grey(picture: Image) -> np.ndarray[Any, np.dtype[np.float32]]:
    """Grey levels as float32."""
    return picture.mean(axis=2, dtype=np.float32) if picture.ndim == 3 else picture.astype(np.float32)


def blur(picture: Image) -> float:
    """0 (sharp) to 1: how little a picture changes when it is blurred again (Crete et al. 2007), after its noise."""
    import cv2

    image = cv2.GaussianBlur(grey(picture), (3, 3), 0)
    worst = 0.0
    for axis in (0, 1):
        again = cv2.blur(image, (1, 9) if axis == 0 else (9, 1))
        before, after = np.abs(np.diff(image, axis=axis)), np.abs(np.diff(again, axis=axis))
        lost = np.maximum(0.0, before - after)
        total = float(before.sum())
        worst = max(worst, 1.0 if total == 0.0 else 1.0 - float(lost.sum()) / total)
    return worst


def matches(left: Image, right: Image) -> tuple[float, float, float] | None:
    """Share of the left picture's patches found in the right one, and their median shift (left's column minus right's)
    and tilt (rows), both at 320 columns; None where there is too little to be found."""
    import cv2

    scale = 320.0 / left.shape[1]
    a, b = (cv2.resize(grey(p), None, fx=scale, fy=scale, interpolation=cv2.INTER_AREA) for p in (left, right))
    rows, columns = a.shape
    half, reach, up = 12, 72, 14
    corners = cv2.goodFeaturesToTrack(
        a[up + half : rows - up - half, reach // 2 : columns - reach // 2].astype(np.uint8), 60, 0.02, 12
    )
    if corners is None or len(corners) < 8:
        return None
    shifts, tilts = [], []
    for column, row in corners.reshape(-1, 2):
        x, y = round(float(column)) + reach // 2, round(float(row)) + up + half
        x0, x1 = max(0, x - half - reach), min(columns, x + half + reach)
        patch = a[y - half : y + half, max(0, x - half) : x + half]
        area = b[y - half - up : y + half + up, x0:x1]
        score = cv2.matchTemplate(area, patch, cv2.TM_CCOEFF_NORMED)
        _, best, _, (at_x, at_y) = cv2.minMaxLoc(score)
        if best > 0.8:
            shifts.append(max(0, x - half) - (x0 + at_x))
            tilts.append(at_y - up)
    share = len(shifts) / len(corners)
    return share, float(np.median(shifts)) if shifts else 0.0, float(np.median(tilts)) if tilts else 0.0


def _wrong(what: str, fix: str) -> Finding:
    return Finding("cameras", False, what, fix)

"""Stereo calibration from pictures of a chessboard (Zhang 2000): each camera alone, then both.

Corners: classic detector, refined with a 7x7 half window (measured best, see the README). Views whose error stands out
are dropped with the reason. A result over 0.5 px (thesis section 2) is refused.
"""

from __future__ import annotations

from dataclasses import dataclass
from datetime import UTC, datetime
from pathlib import Path

import numpy as np
import numpy.typing as npt

from chairward.stages import Image
from chairward_stereo_range.calibration_file import Calibration, CalibrationError, Camera
from chairward_stereo_range.opencv import opencv

Corners = npt.NDArray[np.float32]
MAX_RMS_PX = 0.5
MIN_VIEWS = 6
OUTLIER = 2.0
"""A view is dropped when its error is more than this many times the median view's."""
REFINE_HALF_WINDOW = 7


@dataclass(frozen=True, slots=True)
class View:
    """One pair in which both cameras saw the whole board; corners: n x 1 x 2 px, in the same order in both."""

    name: str
    left: Corners
    right: Corners


def find_corners(grey: Image, board: tuple[int, int]) -> Corners | None:
    """Inner corners of a board (columns, rows), n x 1 x 2 px, or None."""
    cv2 = opencv()
    flags = cv2.CALIB_CB_ADAPTIVE_THRESH | cv2.CALIB_CB_NORMALIZE_IMAGE
    found, corners = cv2.findChessboardCorners(grey, board, flags=flags)
    if not found:
        return None
    half = min(REFINE_HALF_WINDOW, max(2, int(_spacing(corners, board) / 2.5)))
    criteria = (cv2.TERM_CRITERIA_EPS + cv2.TERM_CRITERIA_COUNT, 40, 1e-4)
    refined = cv2.cornerSubPix(grey, corners, (half, half), (-1, -1), criteria)
    return np.asarray(refined, np.float32).reshape(-1, 1, 2)


def _spacing(corners: Corners, board: tuple[int, int]) -> float:
    """The least distance of neighbours in a row, px: the refining window must not reach the next corner."""
    grid = corners.reshape(board[1], board[0], 2)
    return float(np.linalg.norm(np.diff(grid, axis=1), axis=-1).min())


def same_order(left: Corners, right: Corners) -> Corners:
    """The right corners, reversed if that makes them agree with the left ones.

    The detector may start at opposite ends of the board in the two pictures; what is left over after a shift tells.
    """
    reverse = np.ascontiguousarray(right[::-1])

    def spread(candidate: Corners) -> float:
        return float(np.var((left - candidate).reshape(-1, 2), axis=0).sum())

    return right if spread(right) <= spread(reverse) else reverse


def find_views(
    pairs: list[tuple[Path, Path]], board: tuple[int, int]
) -> tuple[list[View], dict[str, str], tuple[int, int]]:
    """(views, dropped name -> reason, picture size). Raises CalibrationError on unreadable or unequal pictures."""
    cv2 = opencv()
    views: list[View] = []
    dropped: dict[str, str] = {}
    size: tuple[int, int] | None = None
    for left_path, right_path in pairs:
        grey = [cv2.imread(str(p), cv2.IMREAD_GRAYSCALE) for p in (left_path, right_path)]
        for path, picture in zip((left_path, right_path), grey, strict=True):
            if picture is None:
                raise CalibrationError(f"{path}: cannot be read as a picture")
            shape = (int(picture.shape[1]), int(picture.shape[0]))
            size = size or shape
            if shape != size:
                raise CalibrationError(
                    f"{path}: is {shape[0]}x{shape[1]}, the others are {size[0]}x{size[1]}: use one size for all"
                )
        corners = [find_corners(picture, board) for picture in grey]
        missing = [side for side, c in zip(("left", "right"), corners, strict=True) if c is None]
        if corners[0] is None or corners[1] is None:
            dropped[left_path.name] = f"board not found in the {' and the '.join(missing)} picture"
            continue
        views.append(View(left_path.name, corners[0], same_order(corners[0], corners[1])))
    if size is None:
        raise CalibrationError("no pictures: check the patterns of --left and --right")
    return views, dropped, size


def calibrate(
    views: list[View], dropped: dict[str, str], size: tuple[int, int], board: tuple[int, int], square_mm: float
) -> Calibration:
    """Calibrate, drop views that stand out, calibrate again. Raises CalibrationError when the result is no good."""
    dropped = dict(dropped)
    while True:
        if len(views) < MIN_VIEWS:
            reasons = "; ".join(f"{name}: {reason}" for name, reason in list(dropped.items())[:5])
            raise CalibrationError(
                f"only {len(views)} usable views, at least {MIN_VIEWS} are needed ({reasons or 'none dropped'}): "
                f"take more pictures of the {board[0]}x{board[1]} board, or check --board"
            )
        solved = _solve(views, size, board, square_mm)
        errors = solved.view_rms
        worst = int(errors.argmax())
        limit = max(OUTLIER * float(np.median(errors)), 0.25)
        if errors[worst] <= limit:
            break
        name = views[worst].name
        dropped[name] = f"error {errors[worst]:.2f} px, over {limit:.2f}: blurred, moving or bent board"
        views = [view for view in views if view.name != name]
    if solved.rms_stereo > MAX_RMS_PX:
        raise CalibrationError(
            f"stereo error {solved.rms_stereo:.2f} px is over {MAX_RMS_PX} px: keep the board flat and still, "
            "both cameras at the same instant, and cover the whole picture"
        )
    return Calibration(
        made=datetime.now(UTC).isoformat(timespec="seconds"),
        image_width_px=size[0],
        image_height_px=size[1],
        board=f"{board[0]}x{board[1]}",
        square_mm=square_mm,
        left=Camera(matrix=solved.k1.tolist(), distortion=solved.d1.ravel().tolist(), rms_px=solved.rms_left),
        right=Camera(matrix=solved.k2.tolist(), distortion=solved.d2.ravel().tolist(), rms_px=solved.rms_right),
        rotation=solved.rotation.tolist(),
        translation_mm=solved.translation.ravel().tolist(),
        rms_stereo_px=solved.rms_stereo,
        epipolar_mean_px=float(solved.epipolar.mean()),
        epipolar_p95_px=float(np.quantile(solved.epipolar, 0.95)),
        views_used=[view.name for view in views],
        views_dropped=dropped,
    )


Array = npt.NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class _Solved:
    k1: Array
    d1: Array
    k2: Array
    d2: Array
    rotation: Array
    translation: Array
    rms_left: float
    rms_right: float
    rms_stereo: float
    view_rms: Array
    epipolar: Array


def board_points(board: tuple[int, int], square_mm: float) -> npt.NDArray[np.float32]:
    """The corners in the board's plane, n x 3 mm."""
    points = np.zeros((board[0] * board[1], 3), np.float32)
    points[:, :2] = np.mgrid[0 : board[0], 0 : board[1]].T.reshape(-1, 2) * square_mm
    return points


def _solve(views: list[View], size: tuple[int, int], board: tuple[int, int], square_mm: float) -> _Solved:
    cv2 = opencv()
    points = [board_points(board, square_mm)] * len(views)
    left, right = [v.left for v in views], [v.right for v in views]
    rms1, k1, d1, _, _ = cv2.calibrateCamera(points, left, size, None, None)
    rms2, k2, d2, _, _ = cv2.calibrateCamera(points, right, size, None, None)
    found = cv2.stereoCalibrateExtended(
        points, left, right, k1, d1, k2, d2, size, np.eye(3), np.zeros((3, 1)),
        flags=cv2.CALIB_USE_INTRINSIC_GUESS,
        criteria=(cv2.TERM_CRITERIA_EPS + cv2.TERM_CRITERIA_COUNT, 200, 1e-8),
    )  # fmt: skip
    rms, k1, d1, k2, d2, rotation, translation = found[:7]
    view_rms = np.sqrt((np.asarray(found[-1], float) ** 2).mean(axis=1))
    r1, r2, p1, p2 = cv2.stereoRectify(k1, d1, k2, d2, size, rotation, translation, alpha=0)[:4]
    epipolar = np.concatenate(
        [
            np.abs(
                cv2.undistortPoints(v.left, k1, d1, R=r1, P=p1)[:, 0, 1]
                - cv2.undistortPoints(v.right, k2, d2, R=r2, P=p2)[:, 0, 1]
            )
            for v in views
        ]
    )
    return _Solved(k1, d1, k2, d2, rotation, translation, rms1, rms2, rms, view_rms, epipolar)

"""Stereo calibration from views of a chessboard (Zhang 2000): each camera alone, then both.

No board is flat and exactly as printed. Where each camera by itself finds the same bent board, and the board that one
has found explains the other's pictures better, its real shape is used (the releasing method, Strobl and Hirzinger
2011). Views whose error stands out are dropped with the reason. A result over 0.5 px (thesis section 2) is refused.
"""

from __future__ import annotations

from dataclasses import dataclass
from datetime import UTC, datetime

import numpy as np
import numpy.typing as npt

from chairward_stereo_range.calibration.boards import Board, Corners, Lens, Points, View, flat_board, straightened
from chairward_stereo_range.calibration_file import Calibration, CalibrationError, Camera
from chairward_stereo_range.opencv import opencv

Array = npt.NDArray[np.float64]

MAX_RMS_PX = 0.5
MIN_VIEWS = 6
OUTLIER = 2.0
"""A view is dropped when its error is more than this many times the median view's."""
LEAST_OUTLIER_PX = 0.2
SHAPE_VIEWS = 8
"""Views from which the board's shape is asked for."""
SHAPE_GAIN = 0.97
"""The shape that one camera found must bring the other camera's error down to this; of a flat board: up to 1.05."""
K3_GAIN = 0.95
"""The third radial term must bring the error down to this: unneeded, it goes wild where no board was."""
SANE_ZOOM = 0.6, 1.7
"""Focal length after over before rectification: beyond this the lens model bends back inside the picture."""
FOLDS = 4


@dataclass(frozen=True, slots=True)
class Solved:
    """Cameras, and where the right one is: X_right = rotation X_left + translation (in squares).

    view_rms: px, one each view. residual: left and right, views x corners x 2 px (found minus expected).
    """

    left: Lens
    right: Lens
    rotation: Array
    translation: Array
    rms_left: float
    rms_right: float
    rms: float
    view_rms: Array
    residual: tuple[Array, Array]


@dataclass(frozen=True, slots=True)
class Result:
    """The calibration, and what its report shows: the views that were used and what is left over in each."""

    calibration: Calibration
    views: list[View]
    solved: Solved


def calibrate(views: list[View], dropped: dict[str, str], board: Board, square_mm: float) -> Result:
    """Calibrate the pair from `views`; `dropped` (name -> reason) tells of pairs without a board.

    Raises CalibrationError when the result is no good.
    """
    flat = flat_board(board)
    views, dropped, solved = _settle(views, dropped, board, flat)
    better = [straightened(view, board, (solved.left, solved.right)) for view in views]
    if solve(better, flat).rms < solved.rms:
        views, dropped, solved = _settle(better, dropped, board, flat)
    shape = board_shape(views, board, solved)
    if shape is not None:
        views, dropped, solved = _settle(views, dropped, board, shape)
    if solved.rms > MAX_RMS_PX:
        raise CalibrationError(
            f"stereo error {solved.rms:.2f} px is over {MAX_RMS_PX} px: keep the board flat and still, "
            "both cameras at the same instant, and cover the whole picture"
        )
    if not SANE_ZOOM[0] < _zoom(views, solved) < SANE_ZOOM[1]:
        raise CalibrationError(
            "the lens is not known where no board was seen: take more pictures with the board at the picture's corners"
        )
    epipolar = epipolar_error(views, solved)
    height, width = views[0].pictures[0].shape
    used = flat if shape is None else shape
    calibration = Calibration(
        made=datetime.now(UTC).isoformat(timespec="seconds"),
        image_width_px=width,
        image_height_px=height,
        board=f"{board[0]}x{board[1]}",
        square_mm=square_mm,
        board_bend_mm=float(np.abs(used - flat).max()) * square_mm,
        left=_camera(solved.left, solved.rms_left),
        right=_camera(solved.right, solved.rms_right),
        rotation=solved.rotation.tolist(),
        translation_mm=(solved.translation.ravel() * square_mm).tolist(),
        rms_stereo_px=solved.rms,
        epipolar_mean_px=float(epipolar.mean()),
        epipolar_p95_px=float(np.quantile(epipolar, 0.95)),
        epipolar_p95_unseen_px=_unseen_p95(views, used),
        views_used=[view.name for view in views],
        views_dropped=dropped,
    )
    return Result(calibration, views, solved)


def _camera(lens: Lens, rms_px: float) -> Camera:
    return Camera(matrix=lens[0].tolist(), distortion=lens[1].ravel().tolist(), rms_px=rms_px)


def _settle(
    views: list[View], dropped: dict[str, str], board: Board, shape: Points
) -> tuple[list[View], dict[str, str], Solved]:
    """Solve, drop the view that stands out most, solve again, until none does."""
    dropped = dict(dropped)
    while True:
        if len(views) < MIN_VIEWS:
            reasons = "; ".join(f"{name}: {reason}" for name, reason in list(dropped.items())[:5])
            raise CalibrationError(
                f"only {len(views)} usable views, at least {MIN_VIEWS} are needed ({reasons or 'none dropped'}): "
                f"take more pictures of the {board[0]}x{board[1]} board, or check --board"
            )
        solved = solve(views, shape)
        worst = int(solved.view_rms.argmax())
        limit = max(OUTLIER * float(np.median(solved.view_rms)), LEAST_OUTLIER_PX)
        if solved.view_rms[worst] <= limit:
            return views, dropped, solved
        bad = views[worst]
        dropped[bad.name] = f"error {solved.view_rms[worst]:.2f} px, over {limit:.2f}: blurred, moving or bent board"
        views = [view for view in views if view is not bad]


def solve(views: list[View], shape: Points) -> Solved:
    """Both cameras and their place from the views of a board of that shape (n x 3, in squares)."""
    k3_fixed = _solve(views, shape, opencv().CALIB_FIX_K3)
    k3_free = _solve(views, shape, 0)
    return k3_free if k3_free.rms < K3_GAIN * k3_fixed.rms else k3_fixed


def _solve(views: list[View], shape: Points, flags: int) -> Solved:
    cv2 = opencv()
    points = [shape] * len(views)
    left, right = [v.left for v in views], [v.right for v in views]
    rms_left, lens_left = _alone(left, shape, _size(views), flags)
    rms_right, lens_right = _alone(right, shape, _size(views), flags)
    found = cv2.stereoCalibrateExtended(
        points, left, right, *lens_left, *lens_right, _size(views), np.eye(3), np.zeros((3, 1)),
        flags=cv2.CALIB_USE_INTRINSIC_GUESS | flags,
        criteria=(cv2.TERM_CRITERIA_EPS + cv2.TERM_CRITERIA_COUNT, 200, 1e-8),
    )  # fmt: skip
    rms, k1, d1, k2, d2, rotation, translation = found[:7]
    turns, shifts = found[9:11]
    residual: tuple[list[Array], list[Array]] = ([], [])
    for view, turn, shift in zip(views, turns, shifts, strict=True):
        at = cv2.Rodrigues(turn)[0]
        right_turn = cv2.Rodrigues(rotation @ at)[0]
        expected = cv2.projectPoints(shape, turn, shift, k1, d1)[0]
        residual[0].append((view.left - expected)[:, 0])
        expected = cv2.projectPoints(shape, right_turn, rotation @ shift + translation, k2, d2)[0]
        residual[1].append((view.right - expected)[:, 0])
    both = (np.array(residual[0]), np.array(residual[1]))
    view_rms = np.sqrt(sum((r**2).sum(axis=-1).mean(axis=-1) for r in both) / 2)
    return Solved((k1, d1), (k2, d2), rotation, translation, rms_left, rms_right, float(rms), view_rms, both)


def _alone(corners: list[Corners], shape: Points, size: tuple[int, int], flags: int) -> tuple[float, Lens]:
    """(rms px, lens) of one camera; first from the flat board, which needs no guess."""
    cv2 = opencv()
    flat = np.asarray(shape * np.array([1, 1, 0], np.float32))
    rms, k, d = cv2.calibrateCamera([flat] * len(corners), corners, size, None, None, flags=flags)[:3]
    if shape[:, 2].any():
        flags |= cv2.CALIB_USE_INTRINSIC_GUESS
        rms, k, d = cv2.calibrateCamera([shape] * len(corners), corners, size, k, d, flags=flags)[:3]
    return float(rms), (k, d)


def _size(views: list[View]) -> tuple[int, int]:
    height, width = views[0].pictures[0].shape
    return width, height


def epipolar_error(views: list[View], solved: Solved) -> Array:
    """|row in the left - row in the right picture| of every corner after rectification, in px of the taken pictures."""
    cv2 = opencv()
    r1, r2, p1, p2 = _rectified(views, solved)
    rows = [
        cv2.undistortPoints(v.left, *solved.left, R=r1, P=p1)[:, 0, 1]
        - cv2.undistortPoints(v.right, *solved.right, R=r2, P=p2)[:, 0, 1]
        for v in views
    ]
    return np.asarray(np.abs(np.concatenate(rows)) / _zoom(views, solved), np.float64)


def _rectified(views: list[View], solved: Solved) -> tuple[Array, Array, Array, Array]:
    found = opencv().stereoRectify(
        *solved.left, *solved.right, _size(views), solved.rotation, solved.translation, alpha=0
    )
    return found[0], found[1], found[2], found[3]


def _zoom(views: list[View], solved: Solved) -> float:
    return float(2 * _rectified(views, solved)[2][1, 1] / (solved.left[0][1, 1] + solved.right[0][1, 1]))


def _unseen_p95(views: list[View], shape: Points) -> float:
    """The 95th percentile of the epipolar error on views that the cameras were not solved from, in FOLDS rounds."""
    errors = []
    for fold in range(FOLDS):
        rest = [view for i, view in enumerate(views) if i % FOLDS != fold]
        errors.append(epipolar_error(views[fold::FOLDS], solve(rest, shape)))
    return float(np.quantile(np.concatenate(errors), 0.95))


def board_shape(views: list[View], board: Board, solved: Solved) -> Points | None:
    """The board as it really is (n x 3, in squares), or None: too few views, or the cameras do not confirm each other.

    A shape that fits one camera's errors does not help the other one; only the board's own does.
    """
    if len(views) < SHAPE_VIEWS:
        return None
    left, right = [v.left for v in views], [v.right for v in views]
    shapes = _released(left, board, _size(views)), _released(right, board, _size(views))
    flags = opencv().CALIB_FIX_K3
    crossed = (
        _alone(left, shapes[1], _size(views), flags)[0] / solved.rms_left,
        _alone(right, shapes[0], _size(views), flags)[0] / solved.rms_right,
    )
    return np.asarray((shapes[0] + shapes[1]) / 2, np.float32) if max(crossed) < SHAPE_GAIN else None


def _released(corners: list[Corners], board: Board, size: tuple[int, int]) -> Points:
    """The board that explains one camera's pictures best, laid onto the flat one by turning, shifting and scaling."""
    cv2 = opencv()
    flat = flat_board(board)
    found = cv2.calibrateCameraRO(
        [flat] * len(corners), corners, size, board[0] - 1, None, None,
        flags=cv2.CALIB_FIX_K3,
        criteria=(cv2.TERM_CRITERIA_EPS + cv2.TERM_CRITERIA_COUNT, 30, 1e-5),
    )[5]  # fmt: skip
    shape, target = found.reshape(-1, 3) - found.reshape(-1, 3).mean(axis=0), flat - flat.mean(axis=0)
    u, s, v = np.linalg.svd(shape.T.astype(np.float64) @ target)
    turn = u @ np.diag([1.0, 1.0, np.sign(np.linalg.det(u @ v))]) @ v
    scale = s.sum() / (shape**2).sum()
    return np.asarray(scale * shape @ turn + flat.mean(axis=0), np.float32)

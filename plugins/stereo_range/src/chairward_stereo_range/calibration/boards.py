"""A chessboard's inner corners in a pair of pictures: found, put in one order, and refined as seen from straight ahead.

Found by the classic detector and refined with a 7x7 half window, which measured best of all detectors (README).
Once the cameras are roughly known, each picture of the board is straightened (perspective and lens undone) and its
corners are refined there, where the saddle that the refinement looks for is square (Datta, Kim and Kanade 2009).
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import numpy.typing as npt

from chairward.stages import Image
from chairward_stereo_range.calibration_file import CalibrationError
from chairward_stereo_range.opencv import opencv

Corners = npt.NDArray[np.float32]
Points = npt.NDArray[np.float32]
Board = tuple[int, int]
"""Inner corners: columns, rows."""
Lens = tuple[npt.NDArray[np.float64], npt.NDArray[np.float64]]
"""3 x 3 matrix, distortion."""
REFINE_HALF_WINDOW = 7
STRAIGHT_HALF_WINDOW = 0.4
"""Of a square: as much of the edges as can be had without the next corner."""
MAX_MOVE = 0.15
"""Of a square: a corner that moves farther when it is straightened has caught something else."""


@dataclass(frozen=True, slots=True)
class View:
    """One pair in which both cameras saw the whole board; corners: n x 1 x 2 px, in the same order in both.

    pictures: left and right, h x w grey.
    """

    name: str
    left: Corners
    right: Corners
    pictures: tuple[Image, Image]


def find_corners(grey: Image, board: Board, *, fast: bool = False) -> Corners | None:
    """Inner corners of a board, n x 1 x 2 px, or None. fast: give up early where nothing looks like a board."""
    cv2 = opencv()
    flags = cv2.CALIB_CB_ADAPTIVE_THRESH | cv2.CALIB_CB_NORMALIZE_IMAGE | (cv2.CALIB_CB_FAST_CHECK if fast else 0)
    found, corners = cv2.findChessboardCorners(grey, board, flags=flags)
    if not found:
        return None
    half = min(REFINE_HALF_WINDOW, max(2, int(_spacing(corners, board) / 2.5)))
    return _refined(grey, corners, half)


def find_view(name: str, pictures: tuple[Image, Image], board: Board, *, fast: bool = False) -> View | str:
    """The view of a pair (h x w grey each), or why there is none."""
    left, right = (find_corners(picture, board, fast=fast) for picture in pictures)
    if left is None or right is None:
        missing = [side for side, corners in (("left", left), ("right", right)) if corners is None]
        return f"board not found in the {' and the '.join(missing)} picture"
    return View(name, left, same_order(left, right), pictures)


def read_views(pairs: list[tuple[Path, Path]], board: Board) -> tuple[list[View], dict[str, str]]:
    """(views, dropped name -> reason) of picture files. Raises CalibrationError on unreadable or unequal pictures."""
    views: list[View] = []
    dropped: dict[str, str] = {}
    size: tuple[int, int] | None = None
    for paths in pairs:
        pictures = (_read(paths[0]), _read(paths[1]))
        for path, picture in zip(paths, pictures, strict=True):
            shape = (int(picture.shape[1]), int(picture.shape[0]))
            size = size or shape
            if shape != size:
                raise CalibrationError(
                    f"{path}: is {shape[0]}x{shape[1]}, the others are {size[0]}x{size[1]}: use one size for all"
                )
        found = find_view(paths[0].name, pictures, board)
        if isinstance(found, View):
            views.append(found)
        else:
            dropped[paths[0].name] = found
    return views, dropped


def same_order(left: Corners, right: Corners) -> Corners:
    """The right corners, reversed if that makes them agree with the left ones.

    The detector may start at opposite ends of the board in the two pictures; what is left over after a shift tells.
    """
    reverse = np.ascontiguousarray(right[::-1])

    def spread(candidate: Corners) -> float:
        return float(np.var((left - candidate).reshape(-1, 2), axis=0).sum())

    return right if spread(right) <= spread(reverse) else reverse


def flat_board(board: Board) -> Points:
    """The corners of a perfect board of unit squares, n x 3."""
    points = np.zeros((board[0] * board[1], 3), np.float32)
    points[:, :2] = np.mgrid[0 : board[0], 0 : board[1]].T.reshape(-1, 2)
    return points


def straightened(view: View, board: Board, lenses: tuple[Lens, Lens]) -> View:
    """The view with its corners refined as seen from straight ahead, by cameras that are roughly known."""
    left = _straighten(view.pictures[0], view.left, board, lenses[0])
    return replace(view, left=left, right=_straighten(view.pictures[1], view.right, board, lenses[1]))


def _straighten(grey: Image, corners: Corners, board: Board, lens: Lens) -> Corners:
    cv2 = opencv()
    flat = flat_board(board)
    _, turn, shift = cv2.solvePnP(flat, corners, *lens)
    scale = max(_spacing(corners, board, np.median), _spacing(corners, board, np.median, axis=0))
    columns, rows = np.meshgrid(*(np.arange(int((n + 1) * scale)) for n in board))
    grid = np.stack([columns / scale - 1, rows / scale - 1, np.zeros(rows.shape)], axis=-1).reshape(-1, 3)
    seen = cv2.projectPoints(grid, turn, shift, *lens)[0].reshape(*rows.shape, 2).astype(np.float32)
    straight = cv2.remap(grey, seen[..., 0], seen[..., 1], cv2.INTER_CUBIC, borderMode=cv2.BORDER_REPLICATE)
    start = ((flat[:, :2] + 1) * scale).astype(np.float32).reshape(-1, 1, 2)
    found = _refined(straight, start.copy(), max(2, int(STRAIGHT_HALF_WINDOW * scale)))
    on_board = np.concatenate([found[:, 0] / scale - 1, np.zeros((len(found), 1))], axis=1)
    back = cv2.projectPoints(on_board, turn, shift, *lens)[0].astype(np.float32)
    strayed = np.abs(found - start).max(axis=(1, 2)) > MAX_MOVE * scale
    back[strayed] = corners[strayed]
    return np.asarray(back, np.float32)


def _refined(grey: Image, corners: Corners, half_window: int) -> Corners:
    cv2 = opencv()
    criteria = (cv2.TERM_CRITERIA_EPS + cv2.TERM_CRITERIA_COUNT, 60, 1e-4)
    refined = cv2.cornerSubPix(grey, corners, (half_window, half_window), (-1, -1), criteria)
    return np.asarray(refined, np.float32).reshape(-1, 1, 2)


def _spacing(corners: Corners, board: Board, of: Callable[[Points], object] = np.min, axis: int = 1) -> float:
    """The least (or median) distance of neighbours in a row (axis 1) or column (0), px."""
    grid = corners.reshape(board[1], board[0], 2)
    return float(of(np.linalg.norm(np.diff(grid, axis=axis), axis=-1)))  # type: ignore[arg-type]


def _read(path: Path) -> Image:
    cv2 = opencv()
    picture = cv2.imread(str(path), cv2.IMREAD_GRAYSCALE)
    if picture is None:
        raise CalibrationError(f"{path}: cannot be read as a picture")
    return np.asarray(picture, np.uint8)

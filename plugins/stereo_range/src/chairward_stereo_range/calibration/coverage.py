"""What the pictures of a board have covered so far, and what to ask the person who holds it for next.

Pure: corners in, words out. The terminal and the set-up page both show what `ask` says.
"Left" and "up" are the picture's: who faces the cameras moves the other way round, so the words name the picture.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np
import numpy.typing as npt

from chairward_stereo_range.calibration.boards import Board, Corners

COLUMNS, ROWS = 5, 4
"""Cells into which the picture is divided."""
WANTED = (
    frozenset((column, row) for column in range(1, COLUMNS) for row in range(ROWS)),
    frozenset((column, row) for column in range(COLUMNS - 1) for row in range(ROWS)),
)
"""Cells of the left and of the right picture: a near board in the outermost column is out of the other one's sight."""
ENOUGH_CELLS = 0.8
"""Of the wanted cells; the very corners are not always to be had."""
ENOUGH_VIEWS = 15
TURNED = 0.06
"""One side of the board must look so much longer than its opposite for the board to count as turned."""
NEAR, FAR = 0.5, 0.35
"""Width of the board as a part of the picture's: wider is near, narrower is far."""
STILL = 0.003
"""Of the picture's width: a board whose corners move less between two pictures is held still."""
NEW = 0.08
"""Of the picture's size: a board that is nearer than this, in place and size, to one taken teaches little."""

Turn = Literal["left", "right", "top", "bottom"]
TURNS: tuple[Turn, ...] = ("left", "right", "top", "bottom")
What = Literal["show", "move", "hold", "turn", "nearer", "farther", "vary", "done"]


@dataclass(frozen=True, slots=True)
class Seen:
    """A board in one picture, as parts of its size. x, y: its middle. width: of its box. turned: the nearer side."""

    x: float
    y: float
    width: float
    height: float
    turned: Turn | None
    cells: frozenset[tuple[int, int]]

    def apart(self, other: Seen) -> float:
        """How unlike two sightings are: 0 the same place, size and turn."""
        place = max(abs(self.x - other.x), abs(self.y - other.y), abs(self.width - other.width))
        return place if self.turned == other.turned else place + NEW


@dataclass(frozen=True, slots=True)
class Coverage:
    """What the views taken so far cover; cells: (column, row) of the left and of the right picture."""

    views: int = 0
    cells: tuple[frozenset[tuple[int, int]], frozenset[tuple[int, int]]] = (frozenset(), frozenset())
    turned: frozenset[Turn] = frozenset()
    near: bool = False
    far: bool = False
    taken: tuple[Seen, ...] = ()

    @property
    def share(self) -> float:
        """Part of the wanted cells of both pictures in which a corner has been."""
        there = sum(len(wanted & cells) for wanted, cells in zip(WANTED, self.cells, strict=True))
        return there / sum(len(wanted) for wanted in WANTED)

    def with_view(self, left: Seen, right: Seen) -> Coverage:
        """The coverage with one more view."""
        return Coverage(
            self.views + 1,
            (self.cells[0] | left.cells, self.cells[1] | right.cells),
            self.turned | ({left.turned} if left.turned else frozenset()),
            self.near or left.width >= NEAR,
            self.far or left.width <= FAR,
            (*self.taken, left),
        )

    def is_new(self, left: Seen) -> bool:
        """Whether a sighting (in the left picture) is unlike all that were taken."""
        return all(left.apart(other) >= NEW for other in self.taken)


@dataclass(frozen=True, slots=True)
class Ask:
    """What to ask for: text for people; what and direction ("up left", a side, or "") for programs."""

    what: What
    text: str
    direction: str = ""


def seen(corners: Corners, board: Board, size: tuple[int, int]) -> Seen:
    """The sighting of corners (n x 1 x 2 px, rows of the board in order) in a picture of size (width, height)."""
    pixels = corners.reshape(board[1], board[0], 2)
    grid = pixels / np.array(size, np.float32)
    low, high = grid.min(axis=(0, 1)), grid.max(axis=(0, 1))
    middle = (low + high) / 2
    cells = {
        (int(np.clip(x * COLUMNS, 0, COLUMNS - 1)), int(np.clip(y * ROWS, 0, ROWS - 1))) for x, y in grid.reshape(-1, 2)
    }
    return Seen(
        float(middle[0]),
        float(middle[1]),
        float(high[0] - low[0]),
        float(high[1] - low[1]),
        _turned(pixels),
        frozenset(cells),
    )


def _turned(grid: npt.NDArray[np.float32]) -> Turn | None:
    """The side of the board that is nearer to the camera (it looks longer), by the larger of both differences."""
    ends = [grid[0, 0], grid[0, -1], grid[-1, -1], grid[-1, 0]]
    sides = [(a, b) for a, b in zip(ends, ends[1:] + ends[:1], strict=True)]
    lengths = [float(np.linalg.norm(a - b)) for a, b in sides]
    first, second = sorted(range(4), key=lambda i: abs(lengths[i] / lengths[(i + 2) % 4] - 1))[-2:]
    longer = first if lengths[first] > lengths[second] else second
    if lengths[longer] < (1 + TURNED) * lengths[(longer + 2) % 4]:
        return None
    across, down = (sides[longer][0] + sides[longer][1]) / 2 - np.mean(ends, axis=0)
    if abs(across) >= abs(down):
        return "left" if across < 0 else "right"
    return "top" if down < 0 else "bottom"


def moved(before: Corners | None, now: Corners, size: tuple[int, int]) -> bool:
    """Whether the board has moved between two pictures (True where there is no picture before)."""
    return before is None or float(np.abs(now - before).max()) > STILL * size[0]


def ask(coverage: Coverage, left: Seen | None, right: Seen | None, *, still: bool = True) -> Ask:
    """What to ask for next, given what is covered and where the board is seen now (None: not in that picture)."""
    if is_done(coverage):
        return Ask("done", "enough: the whole picture is covered")
    if left is None and right is None:
        return Ask("show", "show the whole board to both cameras, flat, without glare")
    if left is None or right is None:
        # What only one camera sees is too far to one side, or partly outside: towards the middle both see it.
        there = left or right
        direction = "" if there is None else _direction(0.5 - there.x, 0.5 - there.y)
        name = "right" if right is None else "left"
        where = f"move it {direction}" if direction else "move it farther away"
        return Ask("move" if direction else "farther", f"the {name} camera does not see the board: {where}", direction)
    if coverage.is_new(left):
        return Ask("hold", "hold the board still" if not still else "good: keep it like this for a moment")
    return _missing_cell(coverage, left, right) or _missing_look(coverage)


def is_done(coverage: Coverage) -> bool:
    """Whether calibrating makes sense now."""
    return (
        coverage.views >= ENOUGH_VIEWS
        and coverage.share >= ENOUGH_CELLS
        and coverage.turned == frozenset(TURNS)
        and coverage.near
        and coverage.far
    )


def _missing_cell(coverage: Coverage, left: Seen, right: Seen) -> Ask | None:
    """Towards the uncovered cell that is nearest to the board's edge, in the picture that lacks more."""
    if coverage.share >= ENOUGH_CELLS:
        return None
    missing_of = [WANTED[side] - coverage.cells[side] for side in (0, 1)]
    side = 0 if len(missing_of[0]) >= len(missing_of[1]) else 1
    board, missing = (left, right)[side], missing_of[side]

    def way(cell: tuple[int, int]) -> tuple[float, float]:
        return (cell[0] + 0.5) / COLUMNS - board.x, (cell[1] + 0.5) / ROWS - board.y

    def beyond(cell: tuple[int, int]) -> float:
        right_by, down_by = way(cell)
        return max(abs(right_by) - board.width / 2, abs(down_by) - board.height / 2)

    nearest = min(missing, key=lambda cell: (beyond(cell), sum(map(abs, way(cell))), cell))
    direction = _direction(*way(nearest), board.width / 2, board.height / 2)
    return Ask("move", f"move the board {direction}", direction)


def _missing_look(coverage: Coverage) -> Ask:
    for turn in TURNS:
        if turn not in coverage.turned:
            return Ask("turn", f"turn the board so that its {turn} side is nearer to the cameras", turn)
    if not coverage.near:
        return Ask("nearer", "bring the board nearer, so that it fills half of the picture")
    if not coverage.far:
        return Ask("farther", "take the board farther away")
    return Ask("vary", f"{ENOUGH_VIEWS - coverage.views} more pictures: change the place and the tilt a little")


def _direction(right: float, down: float, half_width: float = 0.1, half_height: float = 0.1) -> str:
    """The way in the picture, e.g. "up left"; a part that is within the board itself is left out."""
    vertical = "" if abs(down) <= half_height else "down" if down > 0 else "up"
    sideways = "" if abs(right) <= half_width else "right" if right > 0 else "left"
    if not vertical and not sideways and half_width != 0.1:
        sideways = "right" if right > 0 else "left"
    return f"{vertical} {sideways}".strip()

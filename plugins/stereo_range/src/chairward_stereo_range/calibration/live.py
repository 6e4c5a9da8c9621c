"""Calibrating live: pictures come in, good views are kept, and each picture is answered with what to do next."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np

from chairward.components import DeviceLost, EndOfInput, Source
from chairward.stages import Image, StereoFrame
from chairward_stereo_range.calibration.boards import Board, Corners, View, find_corners, same_order
from chairward_stereo_range.calibration.coverage import COLUMNS, ROWS, Ask, Coverage, ask, moved, seen
from chairward_stereo_range.calibration_file import CalibrationError
from chairward_stereo_range.opencv import opencv

READ_S = 1.0
MAX_SILENT = 10
"""Reads in turn without a picture after which the cameras count as dead."""


@dataclass(frozen=True, slots=True)
class Progress:
    """What one pair of pictures came to. corners: as found (None: not seen). taken: it was kept as a view."""

    number: int
    pictures: tuple[Image, Image]
    corners: tuple[Corners | None, Corners | None]
    coverage: Coverage
    ask: Ask
    taken: bool

    def as_json(self) -> dict[str, Any]:
        """One line for a program that shows it: cells are rows of 0 and 1, top left first."""
        return {
            "picture": self.number,
            "board": {side: c is not None for side, c in zip(("left", "right"), self.corners, strict=True)},
            "views": self.coverage.views,
            "coverage": round(self.coverage.share, 3),
            "cells": {
                side: [[int((column, row) in cells) for column in range(COLUMNS)] for row in range(ROWS)]
                for side, cells in zip(("left", "right"), self.coverage.cells, strict=True)
            },
            "turned": sorted(self.coverage.turned),
            "near": self.coverage.near,
            "far": self.coverage.far,
            "ask": self.ask.what,
            "direction": self.ask.direction,
            "text": self.ask.text,
            "taken": self.taken,
            "done": self.ask.what == "done",
        }


class Session:
    """Collects views. still: so many pictures in turn must show the board unmoved before one is kept (0: any)."""

    def __init__(self, board: Board, still: int = 3) -> None:
        self._board, self._still = board, still
        self._size: tuple[int, int] | None = None
        self._before: Corners | None = None
        self._unmoved = 0
        self._number = 0
        self.coverage = Coverage()
        self.views: list[View] = []

    def look(self, left: Image, right: Image) -> Progress:
        """Take in a pair (h x w x 3 BGR or h x w grey, equal shapes). Raises CalibrationError when its size changes."""
        self._number += 1
        pictures = _grey(left), _grey(right)
        height, width = pictures[0].shape
        if self._size not in (None, (width, height)) or pictures[1].shape != pictures[0].shape:
            raise CalibrationError(
                f"picture {self._number}: {width}x{height} left, {pictures[1].shape[1]}x{pictures[1].shape[0]} right, "
                f"{'x'.join(map(str, self._size or (width, height)))} before: use one size for all"
            )
        self._size = (width, height)
        corners = [find_corners(picture, self._board, fast=True) for picture in pictures]
        a, b = corners
        if a is not None and b is not None:
            b = same_order(a, b)
        where = [None if c is None else seen(c, self._board, self._size) for c in (a, b)]
        still = a is not None and not moved(self._before, a, self._size)
        self._unmoved = self._unmoved + 1 if still else 0
        self._before = a
        taken = False
        wanted = ask(self.coverage, where[0], where[1], still=still or self._still == 0)
        if wanted.what == "hold" and self._unmoved >= self._still and a is not None and b is not None:
            view = View(f"picture {self._number}", a, b, pictures)
            self.views.append(view)
            if where[0] is not None and where[1] is not None:
                self.coverage = self.coverage.with_view(where[0], where[1])
            taken = True
            wanted = ask(self.coverage, where[0], where[1])
        return Progress(self._number, pictures, (a, b), self.coverage, wanted, taken)


def follow(source: Source, session: Session, show: Callable[[Progress], None]) -> None:
    """Read until enough is covered, the source ends, or the person interrupts. Raises CalibrationError."""
    try:
        source.open()
        for frame in _frames(source):
            if frame.geometry is not None:
                raise CalibrationError(
                    "these pictures are rectified already: give the cameras' own pictures (a source without geometry)"
                )
            progress = session.look(frame.left, frame.right)
            show(progress)
            if progress.ask.what == "done":
                return
    except DeviceLost as error:
        raise CalibrationError(str(error)) from error
    except KeyboardInterrupt:
        return  # the person has seen enough: what was collected is used
    finally:
        source.close()


def _frames(source: Source) -> Iterator[StereoFrame]:
    silent = 0
    while True:
        try:
            item = source.read(READ_S)
        except EndOfInput:
            return
        silent = 0 if item is not None else silent + 1
        if silent >= MAX_SILENT:
            raise CalibrationError(f"no pictures for {MAX_SILENT * READ_S:.0f} s: check the cameras")
        if isinstance(item, StereoFrame):
            yield item


def preview(progress: Progress) -> Image:
    """Both pictures side by side, h x 2w x 3 BGR: covered cells tinted, corners marked."""
    cv2 = opencv()
    shown = []
    for grey, cells, corners in zip(progress.pictures, progress.coverage.cells, progress.corners, strict=True):
        picture = cv2.cvtColor(grey, cv2.COLOR_GRAY2BGR)
        height, width = grey.shape
        for column, row in cells:
            x, y = (
                slice(n * i // of, n * (i + 1) // of) for n, i, of in ((width, column, COLUMNS), (height, row, ROWS))
            )
            picture[y, x] = picture[y, x] // 4 * 3 + np.array([0, 60, 0], np.uint8)
        for at in () if corners is None else corners[:, 0]:
            cv2.circle(picture, (round(float(at[0])), round(float(at[1]))), 3, (0, 200, 255), 1, cv2.LINE_AA)
        shown.append(picture)
    return np.asarray(np.hstack(shown), np.uint8)


def _grey(picture: Image) -> Image:
    cv2 = opencv()
    return picture if picture.ndim == 2 else np.asarray(cv2.cvtColor(picture, cv2.COLOR_BGR2GRAY), np.uint8)

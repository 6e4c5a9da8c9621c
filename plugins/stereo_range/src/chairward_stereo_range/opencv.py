"""OpenCV, imported late (it takes 0.2 s) and untyped (its stubs differ between versions 4 and 5)."""

from __future__ import annotations

from functools import cache
from typing import Any


@cache
def opencv() -> Any:
    """The module cv2, told to use one thread: a lane shares its cores with other lanes."""
    import cv2

    cv2.setNumThreads(1)
    return cv2

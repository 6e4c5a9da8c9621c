"""Which two pictures belong together: pure decisions about two free-running cameras."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from chairward.stages import Image


@dataclass(frozen=True, slots=True, kw_only=True)
class Picture:
    """One camera's picture: h x w x 3 uint8 BGR, captured_ns on CLOCK_MONOTONIC, number counts from 1."""

    image: Image
    captured_ns: int
    number: int


def newest_pair(left: Sequence[Picture], right: Sequence[Picture], max_skew_ns: int) -> tuple[Picture, Picture] | None:
    """The pair whose *older* picture is newest, of all whose skew is allowed; the smaller skew decides between equals.

    left, right: the unused pictures of each camera, oldest first. None when no two of them are close enough.
    """
    pairs = [(a, b) for a in left for b in right if abs(a.captured_ns - b.captured_ns) <= max_skew_ns]
    if not pairs:
        return None
    return max(pairs, key=lambda p: (min(q.captured_ns for q in p), -abs(p[0].captured_ns - p[1].captured_ns)))


def captured_ns(position_ms: float, now_ns: int, period_ns: int) -> int:
    """When a picture was taken: the driver's own stamp if it is a plausible CLOCK_MONOTONIC time, else a careful guess.

    position_ms: CAP_PROP_POS_MSEC, which OpenCV fills from the V4L2 buffer's stamp (0 or -1 where there is none).
    now_ns: when the picture came. A stamp is plausible when it is not in the future and at most two seconds old;
    the guess is one frame period before the picture came, the time its exposure and its transfer may have taken.
    """
    stamp_ns = round(position_ms * 1e6)
    return stamp_ns if 0 <= now_ns - stamp_ns <= 2_000_000_000 else now_ns - period_ns

"""A doubt of a moment does not stop a chair: where the way was seen to be clear just now, it is clear still.

Most doubts (something plain *could* be nearer than what is measured) last a picture or two: a patch loses its
texture, a rim is matched wrongly. The way that was measured clear in the picture before, and into which the chair has
only driven since, is known. So a doubt is put off, for a short and bounded time. What is measured counts at once, as
ever; faults of the cameras and too little texture are no doubts and are never put off; and who doubts most of the time
cannot see.
"""

from __future__ import annotations

from collections import deque

BRIDGE_S = 0.4
"""So long after the last picture without a doubt the way is known."""
LOOK_BACK_S, SURE_SHARE = 1.0, 0.5
"""Of the pictures of so long a time this share must have been without a doubt."""
LEAST_PICTURES = 3
FASTEST_MM_S = 1000.0
"""The chair's speed where the floor does not tell it."""
FARTHEST_MM = 1500.0
"""Farther than this the way is not called known."""
NEEDED_MM = 700.0
"""So much known way must be left: the stop distance and the error of a reading."""
SAME_MM = 100.0
"""What is measured within so much of where the known way should end is what ended it: so far the way is known still."""
ASIDE_MM = 150.0
"""The floor ahead has gone so far sideways: what was seen is no longer the way."""


class KnownClear:
    """Call `step` once for every picture, in order."""

    def __init__(self) -> None:
        self._pictures: deque[tuple[float, bool]] = deque()
        self._known_mm = 0.0
        self._aside_mm = 0.0
        self._sure_s = 0.0

    def step(
        self, time_s: float, sure: bool, ahead_mm: float, driven_mm: float | None, sideways_mm: float = 0.0
    ) -> bool:
        """Is the way known to be clear though this picture leaves a doubt?

        sure: this picture leaves none. ahead_mm: of the nearest thing measured in it, inf where there is none.
        driven_mm, sideways_mm: how the floor came nearer and went to the side since the last picture; None unknown.
        """
        last_s = self._pictures[-1][0] if self._pictures else time_s
        self._pictures.append((time_s, sure))
        while time_s - self._pictures[0][0] > LOOK_BACK_S:
            self._pictures.popleft()
        if sure:
            self._known_mm, self._aside_mm, self._sure_s = min(ahead_mm, FARTHEST_MM), 0.0, time_s
            return False
        self._known_mm -= FASTEST_MM_S * (time_s - last_s) if driven_mm is None else max(driven_mm, 0.0)
        if self._known_mm < ahead_mm <= self._known_mm + SAME_MM:
            self._known_mm = ahead_mm
        self._aside_mm += sideways_mm
        surely = sum(was for _, was in self._pictures)
        return (
            len(self._pictures) >= LEAST_PICTURES
            and surely >= SURE_SHARE * len(self._pictures)
            and time_s - self._sure_s <= BRIDGE_S
            and self._known_mm >= NEEDED_MM
            and abs(self._aside_mm) <= ASIDE_MM
        )

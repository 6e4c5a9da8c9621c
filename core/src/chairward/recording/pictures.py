"""Pictures for a recording: taken from the lanes' frame rings a few times a second, and packed as PNG.

They show the home of the person who drives, and whoever is in it. So they are kept round a protective stop only,
unless the person's profile says otherwise; what is not kept never leaves this process's memory.
"""

from __future__ import annotations

import struct
import zlib
from collections import deque
from collections.abc import Iterator, Mapping
from enum import StrEnum

import numpy as np

from chairward.frames import FrameReader
from chairward.stages import Image

BEFORE_NS, AFTER_NS = 20_000_000_000, 10_000_000_000
"""What is kept round a stop: 30 s."""


class Keep(StrEnum):
    """Which pictures are kept."""

    NEVER = "never"
    STOPS = "stops"
    ALWAYS = "always"


COARSE = 0xF8
"""Bits of a colour that are kept: camera noise is in the others, and makes a picture twice as large."""


def png(image: Image) -> bytes:
    """An image (h x w grey or h x w x 3 BGR, uint8) as PNG in 32 shades a colour, packed quickly rather than small."""
    rows, columns = image.shape[:2]
    colour = 2 if image.ndim == 3 else 0
    pixels = np.ascontiguousarray(image[..., ::-1] if colour else image).reshape(rows, -1) & COARSE
    up = np.diff(pixels, axis=0, prepend=np.zeros((1, pixels.shape[1]), np.uint8))
    raw = np.hstack([np.full((rows, 1), 2, np.uint8), up]).tobytes()  # filter 2: the difference to the row above

    def chunk(name: bytes, body: bytes) -> bytes:
        return struct.pack(">I", len(body)) + name + body + struct.pack(">I", zlib.crc32(name + body))

    head = struct.pack(">IIBBBBB", columns, rows, 8, colour, 0, 0, 0)
    return b"\x89PNG\r\n\x1a\n" + chunk(b"IHDR", head) + chunk(b"IDAT", zlib.compress(raw, 1)) + chunk(b"IEND", b"")


Shot = tuple[int, str, str, bytes]
"""When it was captured (CLOCK_MONOTONIC ns), lane, pane, PNG."""


class Album:
    """The pictures that are to be kept."""

    def __init__(self, keep: Keep, rings: Mapping[str, int], panes: tuple[str, ...]) -> None:
        self._keep, self._panes = keep, panes
        self._readers = {lane: FrameReader(fd) for lane, fd in rings.items()} if keep is not Keep.NEVER else {}
        self._waiting: deque[Shot] = deque()
        self._keep_until_ns = 0

    def stopped(self, now_ns: int) -> None:
        """A protective stop: keep what was seen before it, and what will be seen after it."""
        self._keep_until_ns = now_ns + AFTER_NS

    def look(self, now_ns: int) -> Iterator[Shot]:
        """Take the newest pictures; gives those that are to be written now."""
        for lane, reader in self._readers.items():
            for name, pane in (reader.newest() or {}).items():
                if name in self._panes:
                    self._waiting.append((pane.captured_ns, lane, name, png(pane.image)))
        if self._keep is Keep.ALWAYS or now_ns <= self._keep_until_ns:
            while self._waiting:
                yield self._waiting.popleft()
        while self._waiting and self._waiting[0][0] < now_ns - BEFORE_NS:
            self._waiting.popleft()

    def close(self) -> None:
        """Let go of the rings."""
        for reader in self._readers.values():
            reader.close()
        self._readers.clear()

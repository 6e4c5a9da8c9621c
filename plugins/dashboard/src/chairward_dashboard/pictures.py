"""The newest picture of each name from all lanes, as JPEG, encoded at most once for each size and only when asked."""

from __future__ import annotations

from collections.abc import Mapping

import cv2
import numpy as np

from chairward.frames import FrameReader
from chairward.stages import Image, Pane


class Pictures:
    """Reads the lanes' rings. Not thread-safe: lives in the server's thread."""

    def __init__(self, rings: Mapping[str, int], quality: int) -> None:
        cv2.setNumThreads(1)
        self._readers = [FrameReader(fd) for fd in rings.values()]
        self._quality = quality
        self._panes: dict[str, Pane] = {}
        self._encoded: dict[tuple[str, int], tuple[int, bytes]] = {}

    def look(self) -> None:
        """Take what the lanes have laid down since the last look."""
        for reader in self._readers:
            self._panes.update(reader.newest() or {})

    def newest(self, name: str) -> Pane | None:
        """The newest pane of that name, if any lane has ever laid one down."""
        self.look()
        return self._panes.get(name)

    def jpeg(self, name: str, width_px: int) -> tuple[int, bytes] | None:
        """(captured_ns, JPEG) of the newest pane of that name, at most width_px wide; None where there is none."""
        pane = self._panes.get(name)
        if pane is None:
            return None
        kept = self._encoded.get((name, width_px))
        if kept is not None and kept[0] == pane.captured_ns:
            return kept
        data = encode(pane.image, width_px, self._quality)
        self._encoded[name, width_px] = (pane.captured_ns, data)
        return pane.captured_ns, data

    def close(self) -> None:
        """Unmap the rings."""
        for reader in self._readers:
            reader.close()
        self._readers = []


def encode(image: Image, width_px: int, quality: int) -> bytes:
    """JPEG of h x w (x 3, BGR) uint8, shrunk to width_px if wider."""
    height, width = image.shape[:2]
    if width > width_px:
        image = np.asarray(
            cv2.resize(image, (width_px, max(1, height * width_px // width)), interpolation=cv2.INTER_AREA), np.uint8
        )
    ok, data = cv2.imencode(".jpg", image, [cv2.IMWRITE_JPEG_QUALITY, quality])
    return data.tobytes() if ok else b""

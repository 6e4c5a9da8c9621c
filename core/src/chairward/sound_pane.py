"""The last seconds of sound as a pane, so that a screen can record a word through the chair's own microphone.

A recognizer lays it on the bench beside its messages; like pictures it lies in the lane's ring only, is overwritten
within seconds and never stored by the core.
"""

from __future__ import annotations

from collections import deque

import numpy as np

from chairward.stages import AudioBlock, Floats, Pane

NAME = "sound"
SECONDS = 4.0


class RecentSound:
    """Keeps the last seconds; `pane` packs them. Lost samples are not made up: what follows a gap begins anew."""

    def __init__(self) -> None:
        self._blocks: deque[AudioBlock] = deque()
        self._size = 0

    def push(self, block: AudioBlock) -> None:
        """The next block."""
        if block.lost_samples or (self._blocks and block.rate_hz != self._blocks[-1].rate_hz):
            self._blocks.clear()
            self._size = 0
        self._blocks.append(block)
        self._size += len(block.samples)
        while self._size - len(self._blocks[0].samples) >= SECONDS * block.rate_hz:
            self._size -= len(self._blocks.popleft().samples)

    def pane(self) -> Pane | None:
        """16 bit samples behind 4 bytes of rate (little-endian); captured_ns: of the first sample."""
        if not self._blocks:
            return None
        first = self._blocks[0]
        samples = np.concatenate([block.samples for block in self._blocks])
        pcm = (np.clip(samples, -1.0, 1.0) * 32767.0).astype("<i2")
        data = np.array([first.rate_hz], "<u4").tobytes() + pcm.tobytes()
        return Pane(name=NAME, image=np.frombuffer(data, np.uint8), captured_ns=first.captured_ns)


def unpack(pane: Pane) -> tuple[Floats, int]:
    """Samples in -1..1 and their rate in Hz."""
    data = pane.image.tobytes()
    rate_hz = int.from_bytes(data[:4], "little")
    return np.frombuffer(data, "<i2", offset=4).astype(np.float32) / np.float32(32767.0), rate_hz

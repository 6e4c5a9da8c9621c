"""Pictures for people: one sealed memfd ring a lane, written by the lane, mapped read-only by observers.

A slot holds all panes of one item. Each slot has a sequence (odd while it is being written), so a reader knows when
what it copied is whole. The memory has no name, cannot be shrunk under a reader, and dies with its last user
(multiprocessing.shared_memory was tried: an unrelated reader's exit deletes it).
"""

from __future__ import annotations

import fcntl
import mmap
import os
import struct
from collections.abc import Mapping

import msgspec
import numpy as np

from chairward.stages import Image, Pane

SLOTS = 4
SLOT_BYTES = 5 * 1024 * 1024
_HEAD = struct.Struct("<QII")
_RING_BYTES = 64
_LATEST = struct.Struct("<Q")


class _PaneHead(msgspec.Struct, array_like=True):
    name: str
    shape: list[int]
    captured_ns: int
    size: int


_heads = msgspec.msgpack.Decoder(list[_PaneHead])


def create() -> int:
    """A new ring's descriptor, sealed against shrinking and growing."""
    fd = os.memfd_create("chairward-frames", os.MFD_CLOEXEC | os.MFD_ALLOW_SEALING)
    os.ftruncate(fd, _RING_BYTES + SLOTS * SLOT_BYTES)
    fcntl.fcntl(fd, fcntl.F_ADD_SEALS, fcntl.F_SEAL_SHRINK | fcntl.F_SEAL_GROW | fcntl.F_SEAL_SEAL)
    return fd


def read_only(fd: int) -> int:
    """A second descriptor of the same ring through which nothing can be written."""
    return os.open(f"/proc/self/fd/{fd}", os.O_RDONLY | os.O_CLOEXEC)


class FrameWriter:
    """The lane's end."""

    def __init__(self, fd: int) -> None:
        self._map = mmap.mmap(fd, _RING_BYTES + SLOTS * SLOT_BYTES)
        self._count = 0
        self.dropped = 0

    def write(self, panes: Mapping[str, Pane]) -> None:
        """Publish all panes of one item; an item too large for a slot is counted in `dropped`."""
        blobs = [np.ascontiguousarray(p.image).tobytes() for p in panes.values()]
        head = msgspec.msgpack.encode(
            [
                _PaneHead(p.name, list(p.image.shape), p.captured_ns, len(b))
                for p, b in zip(panes.values(), blobs, strict=True)
            ]
        )
        body = b"".join(blobs)
        if _HEAD.size + len(head) + len(body) > SLOT_BYTES:
            self.dropped += 1
            return
        self._count += 1
        start = _RING_BYTES + (self._count % SLOTS) * SLOT_BYTES
        _HEAD.pack_into(self._map, start, 2 * self._count + 1, len(head), len(body))
        self._map[start + _HEAD.size : start + _HEAD.size + len(head) + len(body)] = head + body
        _LATEST.pack_into(self._map, start, 2 * self._count)
        _LATEST.pack_into(self._map, 0, self._count)

    def close(self) -> None:
        """Unmap."""
        self._map.close()


class FrameReader:
    """An observer's end."""

    def __init__(self, fd: int) -> None:
        self._map = mmap.mmap(fd, _RING_BYTES + SLOTS * SLOT_BYTES, prot=mmap.PROT_READ)
        self.count = 0
        self.spoiled = 0
        """Slots whose content was not what a writer writes."""

    def newest(self) -> dict[str, Pane] | None:
        """The newest panes by name, None when there is nothing new or the writer was faster than the reader."""
        (count,) = _LATEST.unpack_from(self._map, 0)
        if count == self.count:
            return None
        start = _RING_BYTES + (count % SLOTS) * SLOT_BYTES
        before, head_size, body_size = _HEAD.unpack_from(self._map, start)
        if before != 2 * count or _HEAD.size + head_size + body_size > SLOT_BYTES:
            return None
        data = self._map[start + _HEAD.size : start + _HEAD.size + head_size + body_size]
        if _LATEST.unpack_from(self._map, start)[0] != before:
            return None
        self.count = count
        try:
            return _unpack(data, head_size)
        except (msgspec.DecodeError, ValueError, OverflowError, RecursionError):  # written over by somebody
            self.spoiled += 1
            return None

    def close(self) -> None:
        """Unmap."""
        self._map.close()


def _unpack(data: bytes, head_size: int) -> dict[str, Pane]:
    panes, at = {}, head_size
    for head in _heads.decode(data[:head_size]):
        image: Image = np.frombuffer(data, np.uint8, head.size, at).reshape(head.shape)
        panes[head.name] = Pane(name=head.name, image=image, captured_ns=head.captured_ns)
        at += head.size
    return panes

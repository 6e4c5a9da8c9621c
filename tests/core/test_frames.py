"""The frame ring: readers get whole pictures, cannot write, and cannot be hurt by a hostile writer's truncation."""

from __future__ import annotations

import mmap
import os

import msgspec
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from chairward import frames
from chairward.frames import FrameReader, FrameWriter
from chairward.stages import Pane


def pane(name: str, value: int, shape: tuple[int, ...] = (24, 32, 3)) -> Pane:
    return Pane(name=name, image=np.full(shape, value, np.uint8), captured_ns=value)


def test_a_reader_gets_the_newest_panes_once() -> None:
    fd = frames.create()
    writer, reader = FrameWriter(fd), FrameReader(frames.read_only(fd))
    assert reader.newest() is None
    for value in range(1, 10):
        writer.write({"left": pane("left", value), "disparity": pane("disparity", value, (24, 32))})
    got = reader.newest()
    assert got is not None
    assert got["left"].image.shape == (24, 32, 3)
    assert int(got["disparity"].image.max()) == int(got["left"].image.min()) == 9
    assert reader.newest() is None
    os.close(fd)


def test_a_read_only_descriptor_cannot_be_mapped_for_writing() -> None:
    fd = frames.create()
    other = frames.read_only(fd)
    with pytest.raises(PermissionError):
        mmap.mmap(other, 4096)
    os.close(fd)
    os.close(other)


def test_the_ring_cannot_be_shrunk_under_its_readers() -> None:
    fd = frames.create()
    with pytest.raises(PermissionError):
        os.ftruncate(fd, 10)
    os.close(fd)


def test_a_slot_that_is_being_written_is_not_read() -> None:
    fd = frames.create()
    writer, reader = FrameWriter(fd), FrameReader(fd)
    writer.write({"left": pane("left", 1)})
    start = frames._RING_BYTES + 1 * frames.SLOT_BYTES
    writer._map[start : start + 8] = (3).to_bytes(8, "little")
    assert reader.newest() is None
    os.close(fd)


def test_panes_too_large_for_a_slot_are_counted_not_written() -> None:
    fd = frames.create()
    writer, reader = FrameWriter(fd), FrameReader(fd)
    writer.write({"left": pane("left", 1, (2000, 3000))})
    assert writer.dropped == 1
    assert reader.newest() is None
    os.close(fd)


ODD = st.recursive(st.integers(-(2**63), 2**64 - 1) | st.text(max_size=4), lambda inner: st.lists(inner, max_size=5))


@given(st.binary(max_size=200) | ODD.map(msgspec.msgpack.encode), st.integers(0, 2**32 - 1))
def test_whatever_a_process_gone_wild_writes_over_the_pictures_its_readers_live(head: bytes, size: int) -> None:
    fd = frames.create()
    writer, reader = FrameWriter(fd), FrameReader(frames.read_only(fd))
    writer.write({"left": pane("left", 1)})
    wild = mmap.mmap(fd, 0)
    slot = frames._RING_BYTES + frames.SLOT_BYTES
    wild[slot : slot + frames._HEAD.size + len(head)] = frames._HEAD.pack(2, len(head), size) + head
    found = reader.newest()
    assert found is None or all(isinstance(pane, Pane) for pane in found.values())
    wild[slot : slot + frames._HEAD.size] = frames._HEAD.pack(2, size, size)
    reader.count = 0
    reader.newest()
    wild.close()
    writer.close()
    reader.close()
    os.close(fd)

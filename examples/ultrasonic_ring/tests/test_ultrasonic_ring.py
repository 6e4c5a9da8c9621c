"""The ring keeps every promise of a range sensor, against a simulated board on a pty."""

from __future__ import annotations

from collections.abc import Iterator
from itertools import cycle
from pathlib import Path

import pytest
from chairward_ultrasonic_ring import chairward_sources
from chairward_ultrasonic_ring.line import WAYS, decode, encode, newest
from hypothesis import given
from hypothesis import strategies as st

from chairward.messages import Way
from chairward.testing import FrozenContract, PtyDevice, SensorContract, SensorRig
from chairward.testing.pty_device import damaged


class RingRig(SensorRig):
    """The ring and its board."""

    component = chairward_sources()[0]
    way = Way.BEHIND

    def __init__(self, folder: Path) -> None:
        self.name = str(folder / "ring")
        self.settings = {"port": self.name}
        self.count, self.ways = 0, dict.fromkeys(WAYS, 2000)
        self.board = PtyDevice(folder / "ring", self.truth)

    def truth(self) -> bytes:
        self.count += 1
        return encode(self.count, self.ways)

    def show(self, distance_mm: int | None) -> None:
        self.ways["behind"] = distance_mm or 0
        self.board.send(self.truth)

    def blind(self) -> None:
        self.ways["behind"] = -1
        self.board.send(self.truth)

    def silence(self) -> None:
        self.board.send(lambda: b"")

    def noise(self) -> None:
        self.board.send(lambda: damaged(self.truth()))

    def half(self) -> None:
        pieces = iter([self.truth()[:9]])
        self.board.send(lambda: next(pieces, b""))

    def impossible(self) -> None:
        lies = cycle(encode(count, dict.fromkeys(WAYS, mm)) for count, mm in enumerate((-7, 65535, 10**30, 3)))
        self.board.send(lambda: next(lies))

    def flood(self) -> None:
        self.board.send(lambda: b"".join(self.truth() for _ in range(20)), period_s=0.002)

    def freeze(self) -> None:
        line = self.truth()
        self.board.send(lambda: line)

    def unplug(self) -> None:
        self.board.unplug()

    def plug(self) -> None:
        self.board.plug()

    def close(self) -> None:
        self.board.close()


class TestUltrasonicRing(SensorContract, FrozenContract):
    """All of both contracts."""

    @pytest.fixture
    def rig(self, tmp_path: Path) -> Iterator[RingRig]:
        rig = RingRig(tmp_path)
        yield rig
        rig.close()


@given(st.integers(0, 65535), st.lists(st.sampled_from([-1, 0, 20, 734, 6000]), min_size=4, max_size=4))
def test_a_line_says_what_was_written(count: int, echoes: list[int]) -> None:
    ways = dict(zip(WAYS, echoes, strict=True))
    read = decode(encode(count, ways).strip())
    assert read is not None
    assert (read.count, dict(read.ways)) == (count, {way: None if mm == -1 else mm for way, mm in ways.items()})


@given(st.binary(max_size=200))
def test_whatever_comes_in_the_newest_whole_line_is_found(before: bytes) -> None:
    first, rest = newest(before + b"\n" + encode(7, dict.fromkeys(WAYS, 734)) + b"$R,8,1")
    assert first is not None
    assert (first.count, rest) == (7, b"$R,8,1")

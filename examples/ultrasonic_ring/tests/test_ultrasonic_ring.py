"""The ring keeps every promise of a range sensor, against a simulated board on a pty."""

from __future__ import annotations

from collections.abc import Iterator
from itertools import cycle
from pathlib import Path

import pytest
from chairward_ultrasonic_ring import chairward_sources
from chairward_ultrasonic_ring.line import WAYS, decode, encode, newest
from chairward_ultrasonic_ring.simulated import SimulatedRing, damaged
from hypothesis import given
from hypothesis import strategies as st

from chairward.messages import Way
from chairward.testing import FrozenContract, SensorContract, SensorRig


class RingRig(SensorRig):
    """The ring and its board."""

    component = chairward_sources()[0]
    way = Way.BEHIND

    def __init__(self, folder: Path) -> None:
        self.name = str(folder / "ring")
        self.settings = {"port": self.name}
        self.ring = SimulatedRing(folder / "ring")

    def show(self, distance_mm: int | None) -> None:
        self.ring.ways["behind"] = distance_mm or 0
        self.ring.send(self.ring.truth)

    def blind(self) -> None:
        self.ring.ways["behind"] = -1
        self.ring.send(self.ring.truth)

    def silence(self) -> None:
        self.ring.send(lambda: b"")

    def noise(self) -> None:
        self.ring.send(lambda: damaged(self.ring.truth()))

    def half(self) -> None:
        pieces = iter([self.ring.truth()[:9]])
        self.ring.send(lambda: next(pieces, b""))

    def impossible(self) -> None:
        lies = cycle(encode(count, dict.fromkeys(WAYS, mm)) for count, mm in enumerate((-7, 65535, 10**30, 3)))
        self.ring.send(lambda: next(lies))

    def flood(self) -> None:
        self.ring.send(lambda: b"".join(self.ring.truth() for _ in range(20)), period_s=0.002)

    def freeze(self) -> None:
        line = self.ring.truth()
        self.ring.send(lambda: line)

    def unplug(self) -> None:
        self.ring.unplug()

    def plug(self) -> None:
        self.ring.plug()

    def close(self) -> None:
        self.ring.close()


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

"""What every source of items promises (cameras, microphones): a stage after it can trust numbers and times."""

from __future__ import annotations

import time
from collections.abc import Sequence
from itertools import pairwise
from typing import Any, ClassVar

from chairward.components import DeviceLost, EndOfInput
from chairward.testing.device_contract import DeviceContract, anything, rising
from chairward.testing.device_rig import PATIENCE_S, DeviceRig, Piped, S, opened


class Items(Piped):
    """A source read for its items: what a lane would lay on the bench."""

    messages: ClassVar[bool] = False

    def read(self, timeout_s: float) -> Sequence[Any]:
        """The next item, or nothing."""
        item = self.source.read(timeout_s)
        return [] if item is None else [item]


class SourceRig(DeviceRig):
    """A source and its device. kind: the type of its items (chairward.stages). fresh_s: how old an item may be."""

    kind: type[Any]
    fresh_s: float = 1.0

    def make(self) -> Items:
        """A fresh source."""
        return Items(super().make().source)


class SourceContract(DeviceContract):
    """All of it, for live devices. A source's test class inherits this and gives the fixture `rig`, a `SourceRig`."""

    def test_it_yields_items_of_its_kind_each_once(self, rig: SourceRig) -> None:
        with opened(rig) as reader:
            for _ in range(5):
                reader.until(anything, "an item")
            assert {type(item) for item in reader.said} == {rig.kind}
            assert rig.kind in rig.component.gives, "Component.gives says what it yields: chair files are checked by it"
            rising(reader)

    def test_what_waited_while_nobody_read_is_not_called_fresh(self, rig: SourceRig) -> None:
        with opened(rig) as reader:
            reader.until(anything, "an item")
            rig.wait(2 * rig.fresh_s)
            caught_up_ns = time.monotonic_ns()
            reader.until(lambda item: item.captured_ns >= caught_up_ns, "an item captured now: keep the newest")
            stamps = [item.captured_ns for item in reader.said]
            assert all(a <= b for a, b in pairwise(stamps)), "an older capture after a newer one"

    def test_an_unplugged_device_gives_nothing_more(self, rig: SourceRig) -> None:
        with opened(rig) as reader:
            reader.until(anything, "an item")
            rig.unplug()
            gone_ns = time.monotonic_ns()
            reader.loss()
            late = [item for item in reader.said if item.captured_ns > gone_ns + int(rig.fresh_s * S)]
            assert not late, f"captured {late[0].captured_ns - gone_ns} ns after its device was gone"


class FiniteSourceContract:
    """For sources that come to an end (files): they say so, every time they are asked."""

    def test_it_ends_and_stays_ended(self, rig: SourceRig) -> None:
        thing = rig.make()
        thing.open()
        try:
            for _ in range(3):
                _read_to_its_end(thing)
        finally:
            thing.close()


def _read_to_its_end(thing: Piped) -> None:
    end = time.monotonic() + PATIENCE_S
    while time.monotonic() < end:
        try:
            thing.read(0.1)
        except EndOfInput:
            return
        except DeviceLost as lost:
            raise AssertionError(f"an end is EndOfInput, not a lost device: {lost}") from lost
    raise AssertionError(f"no EndOfInput within {PATIENCE_S:.0f} s")

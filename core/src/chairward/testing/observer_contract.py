"""What every observer promises: it takes whatever records come, however many are missing, and never fails the run."""

from __future__ import annotations

import time
from abc import ABC, abstractmethod
from collections.abc import Mapping
from typing import Any

import msgspec

from chairward import records
from chairward.components import Component, Context, Observer
from chairward.messages import Button, Command
from chairward.records import Record
from chairward.testing.ride import PANEL, Ride, recorded

SLOW_CALL_S = 1.0
"""No single call may take longer; on average a hundredth of it: an observer that falls behind misses records."""


class ObserverRig(ABC):
    """An observer and what the run would tell it."""

    component: Component
    settings: Mapping[str, Any]
    context: Context

    def make(self) -> Observer:
        """A fresh observer, as its process makes it."""
        observer: Observer = self.component.make(
            self.component.settings.model_validate(dict(self.settings)), self.context
        )
        return observer

    @abstractmethod
    def close(self) -> None:
        """Clean up."""


class ObserverContract:
    """All of it. An observer's test class inherits this and gives the fixture `rig`, an `ObserverRig`."""

    def test_every_setting_says_what_it_is(self, rig: ObserverRig) -> None:
        fields = rig.component.settings.model_fields
        assert [name for name, field in fields.items() if not field.description] == []
        assert rig.component.summary

    def test_it_takes_every_record_of_a_ride(self, rig: ObserverRig) -> None:
        self._takes(rig, ride(200))

    def test_it_takes_a_run_without_any_record(self, rig: ObserverRig) -> None:
        self._takes(rig, [])

    def test_it_takes_a_ride_with_gaps(self, rig: ObserverRig) -> None:
        some = [msgspec.structs.replace(record, missed=4) for record in ride(200)[::5]]
        self._takes(rig, some)

    def test_it_takes_the_same_record_twice_and_an_older_one_after_a_newer(self, rig: ObserverRig) -> None:
        whole = ride(20)
        self._takes(rig, [*whole, whole[-1], *whole[:5]])

    def test_it_takes_a_latched_chair_and_a_lost_controller(self, rig: ObserverRig) -> None:
        self._takes(rig, ride(50, silent=True))

    def test_closing_twice_is_harmless(self, rig: ObserverRig) -> None:
        observer = rig.make()
        observer.close()
        observer.close()

    def test_it_keeps_up_with_the_guard(self, rig: ObserverRig) -> None:
        data = [records.encode(record) for record in ride(500)]
        observer = rig.make()
        start = time.monotonic()
        for one in data:
            before = time.monotonic()
            observer.observe(one)
            assert time.monotonic() - before < SLOW_CALL_S
        took_s = time.monotonic() - start
        observer.close()
        assert took_s < len(data) * SLOW_CALL_S / 100, f"{took_s / len(data) * 1e3:.1f} ms a record; one comes every 20"

    def _takes(self, rig: ObserverRig, ridden: list[Record]) -> None:
        observer = rig.make()
        try:
            for record in ridden:
                observer.observe(records.encode(record))
        finally:
            observer.close()


def ride(ticks: int, *, silent: bool = False) -> list[Record]:
    """The records of a ride: armed, told to go, and (silent) its stop device lost after half of it."""
    chair, done = Ride(), []
    for tick in range(ticks):
        if silent and tick == ticks // 2:
            chair.silent.add(PANEL)
        before, press = chair.state, {2: [Button.RESET], 4: [Button.ARM]}.get(tick, [])
        heard = [Command.FRONT] if tick == 10 else []
        chair.tick(*heard, press=press)
        done.append(recorded(tick, before, chair.newest_facts, chair.limits))
    return done

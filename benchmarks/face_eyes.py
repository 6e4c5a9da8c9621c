"""A plugin for benchmarks/face.py: always sees 4 m, and lays four noisy pictures of 320 x 240 on the bench."""

from __future__ import annotations

import time
from collections.abc import Iterable, Sequence

import numpy as np

from chairward.components import Bench, Component, Context, NoSettings
from chairward.hookspecs import hookimpl
from chairward.messages import Message, RangeReading
from chairward.stages import Pane

CHAIRWARD_API = 1
FPS = 15.0
PANES = ("left", "right", "obstacle", "disparity")


class Tick:
    """There is a new picture."""


class Ticks:
    """The source: one Tick a frame."""

    def __init__(self, settings: NoSettings, context: Context) -> None:
        del settings, context
        self._due = 0.0

    def open(self) -> None:
        self._due = time.monotonic()

    def read(self, timeout_s: float) -> Tick | None:
        wait = self._due - time.monotonic()
        time.sleep(max(0.0, min(wait, timeout_s)))
        if wait > timeout_s:
            return None
        self._due += 1.0 / FPS
        return Tick()

    def close(self) -> None:
        pass


class Eyes:
    """The stage."""

    def __init__(self, settings: NoSettings, context: Context) -> None:
        del settings, context
        rng, self._seq = np.random.default_rng(1), 0
        self._noise = [rng.integers(0, 256, (30, 40, 3), np.uint8).repeat(8, 0).repeat(8, 1) for _ in range(8)]

    def process(self, bench: Bench) -> Iterable[Message]:
        if bench.get(Tick) is None:
            return []
        self._seq += 1
        now_ns = time.monotonic_ns()
        for nth, name in enumerate(PANES):
            bench.put(Pane(name=name, image=self._noise[(self._seq + nth) % 8], captured_ns=now_ns))
        return [
            RangeReading(seq=self._seq, captured_ns=now_ns, can_see=True, ahead_mm=4000, left_mm=4000, right_mm=4000)
        ]

    def close(self) -> None:
        pass


@hookimpl
def chairward_sources() -> Sequence[Component]:
    return [Component(name="face_ticks", settings=NoSettings, make=Ticks, gives=(Tick,))]


@hookimpl
def chairward_sensors() -> Sequence[Component]:
    return [Component(name="face_eyes", settings=NoSettings, make=Eyes, needs=(Tick,), gives=(RangeReading,))]

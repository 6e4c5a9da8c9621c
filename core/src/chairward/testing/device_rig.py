"""What the contracts of sensors, recognizers and sources share: a component, its device, and reading as a lane does.

Times are real: the device runs beside the test. Upper bounds are generous, since test machines are busy; what is
held exactly is what a component *claims* (sequence, times, distances), which no busy machine can spoil.
"""

from __future__ import annotations

import os
import threading
import time
from abc import ABC, abstractmethod
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, ClassVar

import msgspec

from chairward import wire
from chairward.components import Bench, Component, Context, DeviceLost, Footprint, Processor, Source
from chairward.messages import Message, Parcel
from chairward.stages import Pose

MS = 1_000_000
S = 1_000_000_000
PATIENCE_S = 8.0
"""How long a contract waits for what must come: far more than any working device needs."""
SLACK_S = 1.0
"""By how much a call may outstay its time-out on a busy machine."""


@dataclass(slots=True)
class Piped:
    """A source and the stages after it, as one source of messages: what a lane of the chair file does.

    messages: False where `read` gives items for the bench (see `Items`).
    """

    messages: ClassVar[bool] = True
    source: Source
    stages: Sequence[Processor] = ()
    bench: Bench = field(default_factory=Bench)

    def open(self) -> None:
        """Open the source."""
        self.source.open()

    def read(self, timeout_s: float) -> Sequence[Message]:
        """One item through all stages."""
        item = self.source.read(timeout_s)
        self.bench.clear()
        messages: list[Message] = []
        if isinstance(item, list | tuple):
            messages += item
        elif isinstance(item, msgspec.Struct):
            messages.append(item)  # type: ignore[arg-type]  # the border checks it
        elif item is not None:
            self.bench.put(item)
        for stage in self.stages:
            messages += stage.process(self.bench)
        return messages

    def close(self) -> None:
        """Close all."""
        self.source.close()
        for stage in self.stages:
            stage.close()


class DeviceRig(ABC):
    """A component under test and the device it reads.

    component: as the plugin offers it. settings: for it. name: what every sentence about the lost device must hold
    (its port, its number). context: what the lane would tell it.
    """

    component: Component
    settings: Mapping[str, Any]
    name: str
    context: Context = Context(
        lane="front",
        run_dir=Path(),
        chair_dir=Path(),
        pose=Pose(x_mm=450.0, z_mm=400.0),
        footprint=Footprint(front_mm=450.0, rear_mm=450.0, half_width_mm=300.0),
    )

    @abstractmethod
    def unplug(self) -> None:
        """Take the device away, as pulling its cable out does."""

    @abstractmethod
    def plug(self) -> None:
        """Bring it back under the same name."""

    @abstractmethod
    def close(self) -> None:
        """End the device. The component was closed before."""

    def make(self) -> Piped:
        """A fresh component, as a lane makes it; a stage's rig puts its source before it."""
        return Piped(self.component.make(self.component.settings.model_validate(dict(self.settings)), self.context))

    def wait(self, seconds: float) -> None:
        """Let time pass for the device; nobody reads meanwhile."""
        threading.Event().wait(seconds)


@dataclass(slots=True)
class Reader:
    """Reads a component as a lane does and keeps what it says; every message must pass the guard's own decoder."""

    thing: Piped
    said: list[Any] = field(default_factory=list)

    def step(self, timeout_s: float = 0.1) -> Sequence[Any]:
        """One read. Raises DeviceLost. Fails when it outstays its time-out or says what the guard would refuse."""
        start = time.monotonic()
        messages = self.thing.read(timeout_s)
        took = time.monotonic() - start
        assert took < timeout_s + SLACK_S, (
            f"read({timeout_s}) came back after {took:.2f} s: wait for the device with the time-out you are given"
        )
        if self.thing.messages:
            for message in messages:
                accepted(message)
        self.said += messages
        return messages

    def until(self, wanted: Callable[[Any], bool], what: str, patience_s: float = PATIENCE_S) -> Any:
        """Read until a message fits; fails with what was said instead. Raises DeviceLost."""
        end = time.monotonic() + patience_s
        recent: list[Message] = []
        while time.monotonic() < end:
            for message in self.step():
                if wanted(message):
                    return message
                recent = [*recent[-4:], message]
        said = ", then ".join(brief(message) for message in recent[-2:]) or "nothing"
        raise AssertionError(f"{what} did not come within {patience_s:.0f} s; the last it said: {said}")

    def during(self, seconds: float) -> list[Any]:
        """Everything said while reading that long; a lost device ends it."""
        end, first = time.monotonic() + seconds, len(self.said)
        try:
            while time.monotonic() < end:
                self.step(0.05)
        except DeviceLost:
            pass  # whoever reads on asserts that it was told
        return list(self.said[first:])

    def loss(self, patience_s: float = PATIENCE_S) -> str:
        """Read until the device is told to be lost; its sentence."""
        end = time.monotonic() + patience_s
        try:
            while time.monotonic() < end:
                self.step()
        except DeviceLost as lost:
            return str(lost)
        raise AssertionError(f"no DeviceLost within {patience_s:.0f} s: raise it with the device's name and what to do")


@contextmanager
def opened(rig: DeviceRig) -> Iterator[Reader]:
    """A fresh component, open, and closed in the end."""
    thing = rig.make()
    try:
        thing.open()
        yield Reader(thing)
    finally:
        thing.close()


def accepted(message: Message) -> None:
    """Fails when the guard's border would refuse to decode the message."""
    assert isinstance(message, msgspec.Struct), f"{message!r} is no message of chairward.messages"
    try:
        data = wire.encode_parcel(Parcel(stage="stage", body=message))
        wire.decode_parcel(data)
    except (msgspec.MsgspecError, TypeError, OverflowError) as error:
        raise AssertionError(f"the guard would refuse {message}: {error}") from error
    assert len(data) <= wire.MAX_MESSAGE_BYTES


def brief(message: object) -> str:
    """A message without what it leaves unsaid."""
    if not isinstance(message, msgspec.Struct):
        return type(message).__name__
    fields = msgspec.structs.fields(message)
    told = [(f.name, getattr(message, f.name)) for f in fields if f.name not in ("seq", "captured_ns")]
    unsaid = {f.name: f.default for f in fields}
    return f"{type(message).__name__}({', '.join(f'{n}={v!r}' for n, v in told if unsaid[n] != v)})"


def says_who_and_what_to_do(sentence: str, name: str) -> None:
    """One sentence that names the device, fits into `Lost.reason`, and says more than the name."""
    assert name in sentence, f"name the device ({name}) in: {sentence!r}"
    assert 0 < len(sentence) <= 200, f"keep it under 200 characters, people read it while they sit there: {sentence!r}"
    assert "\n" not in sentence
    assert len(sentence.replace(name, "").split()) >= 4, f"say what happened and what to do: {sentence!r}"


def held_open() -> tuple[int, int]:
    """(open descriptors, running threads) of this process."""
    return len(os.listdir("/proc/self/fd")), threading.active_count()

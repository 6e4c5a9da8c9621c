"""A plugin of animals for the fault tests: good citizens, and what each of them can turn into while the chair drives.

A citizen behaves until the file `run_dir/turn-<lane>` appears; then it does what that file says (`chairward_zoo_ways`).
It runs in a lane like any third party's source.
"""

from __future__ import annotations

import json
import os
import socket
import sys
import time
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import msgspec
from chairward_zoo_ways import WAYS_TO_FAIL
from pydantic import Field

from chairward.components import Component, Context, Settings
from chairward.hookspecs import hookimpl
from chairward.messages import Alive, Button, Command, Intent, Message, Press, RangeReading

CHAIRWARD_API = 1


class CitizenSettings(Settings):
    """How a good citizen behaves."""

    ahead_mm: int = Field(default=4000, description="what a range citizen sees")
    period_ms: int = Field(default=33, description="between two messages")
    word_ms: int = Field(default=500, description="between two words of a voice citizen")
    press_ms: int = Field(default=150, description="between two presses of a panel citizen")


class Citizen:
    """A source that sends messages of its own; subclasses say which."""

    def __init__(self, settings: CitizenSettings, context: Context) -> None:
        self.settings, self.context = settings, context
        self.seq = 0
        self.due = time.monotonic()
        self.trigger = context.run_dir / f"turn-{context.lane}"
        self.kept: list[Any] = []

    def open(self) -> None:
        self.due = time.monotonic()

    def close(self) -> None:
        pass

    def read(self, timeout_s: float) -> object | None:
        self.due += self.settings.period_ms / 1000.0
        time.sleep(max(0.0, self.due - time.monotonic()))
        if self.trigger.exists():
            how = self.trigger.read_text().strip()
            if how:
                return WAYS_TO_FAIL[how](self)
        return self.good()

    def good(self, **changes: Any) -> object:
        raise NotImplementedError

    def lines(self) -> dict[str, int]:
        """The descriptors of this process, by whom they lead to."""
        return dict(json.loads(sys.argv[1]))

    def raw(self, data: bytes) -> None:
        """Past the lane, straight at the guard: what hostile code in this process can do."""
        end = socket.socket(fileno=os.dup(self.lines()["guard"]))
        try:
            end.send(data)
        except (BlockingIOError, ConnectionError):
            pass  # the guard is not listening to this lane any more: just what the tests want
        finally:
            end.close()

    def raw_fields(self, **fields: object) -> None:
        """A range message whose fields may be impossible."""
        self.seq += 1
        body = {"type": "range", "seq": self.seq, "captured_ns": time.monotonic_ns(), "can_see": True, **fields}
        self.raw(msgspec.msgpack.encode({"stage": "range_citizen", "body": body}))


class RangeCitizen(Citizen):
    """A sensor that sees one obstacle ahead."""

    def good(self, **changes: Any) -> object:
        self.seq += 1
        fields = {
            "seq": self.seq,
            "captured_ns": time.monotonic_ns(),
            "can_see": True,
            "left_mm": 4000,
            "right_mm": 4000,
        }
        return RangeReading(**{**fields, "ahead_mm": self.settings.ahead_mm, **changes})


class VoiceCitizen(Citizen):
    """Somebody who says "front" again and again, with a heartbeat."""

    next_word = 0.0

    def good(self, **changes: Any) -> object:
        self.seq += 1
        now = time.monotonic_ns()
        messages: list[Message] = [Alive(seq=self.seq, captured_ns=now)]
        if self.due >= self.next_word:
            self.next_word = self.due + self.settings.word_ms / 1000.0
            self.seq += 1
            messages.append(Intent(seq=self.seq, captured_ns=now, command=Command.FRONT, word="front"))
        return messages


class PanelCitizen(Citizen):
    """A stop device that presses RESET and ARM in turn, again and again, until told otherwise."""

    pressed = Button.ARM
    next_press = 0.0

    def good(self, **changes: Any) -> object:
        self.seq += 1
        now = time.monotonic_ns()
        messages: list[Message] = [Alive(seq=self.seq, captured_ns=now)]
        if not (self.context.run_dir / "no-arm").exists() and self.due >= self.next_press:
            self.next_press = self.due + self.settings.press_ms / 1000.0
            self.seq += 1
            button = Button.ARM if self.pressed is Button.RESET else Button.RESET
            self.pressed = button
            messages.append(Press(seq=self.seq, captured_ns=now, button=button))
        return messages


def _make(kind: type[Citizen]) -> Callable[[CitizenSettings, Context], Citizen]:
    return kind


@hookimpl
def chairward_sources() -> Sequence[Component]:
    """The three good citizens."""
    return [
        Component(name="range_citizen", settings=CitizenSettings, make=_make(RangeCitizen), gives=(RangeReading,)),
        Component(name="voice_citizen", settings=CitizenSettings, make=_make(VoiceCitizen), gives=(Intent, Alive)),
        Component(name="panel_citizen", settings=CitizenSettings, make=_make(PanelCitizen), gives=(Alive, Press)),
    ]


def install(folder: Path) -> Path:
    """Lay this plugin out as an installed distribution in `folder`: put the folder on PYTHONPATH to have it found."""
    info = folder / "chairward_zoo-0.1.dist-info"
    info.mkdir(parents=True)
    (info / "METADATA").write_text("Metadata-Version: 2.1\nName: chairward-zoo\nVersion: 0.1\n")
    (info / "entry_points.txt").write_text("[chairward.plugins]\nzoo = chairward_zoo\n")
    for module in Path(__file__).parent.glob("chairward_zoo*.py"):
        (folder / module.name).write_text(module.read_text())
    return folder

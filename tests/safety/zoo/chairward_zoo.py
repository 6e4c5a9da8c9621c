"""A plugin of animals for the fault tests: good citizens, and what each of them can turn into while the chair drives.

A citizen behaves until the file `run_dir/turn-<lane>` appears; then it does what that file says (see WAYS_TO_FAIL).
It runs in a lane like any third party's source.
"""

from __future__ import annotations

import contextlib
import ctypes
import json
import math
import os
import re
import resource
import signal
import socket
import sys
import time
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import msgspec
from pydantic import Field

from chairward import wire
from chairward.components import Component, Context, DeviceLost, Settings
from chairward.hookspecs import hookimpl
from chairward.messages import Alive, Button, Command, Ended, Intent, Lost, Message, Parcel, Press, RangeReading

CHAIRWARD_API = 1
MS = 1_000_000


class CitizenSettings(Settings):
    """How a good citizen behaves."""

    ahead_mm: int = Field(default=4000, description="what a range citizen sees")
    period_ms: int = Field(default=33, description="between two messages")
    word_ms: int = Field(default=2000, description="between two words of a voice citizen")
    press_ms: int = Field(default=500, description="between two presses of a panel citizen")


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


# ---- the ways to fail ---------------------------------------------------------------------------------------------


def hang(_: Citizen) -> object:
    while True:
        time.sleep(1.0)


def spin(_: Citizen) -> object:
    while True:
        pass


def hold_gil(_: Citizen) -> object:
    return re.match(r"(a+)+$", "a" * 40 + "b")


def raise_(_: Citizen) -> object:
    raise RuntimeError("the animal bites")


def exit_(_: Citizen) -> object:
    os._exit(3)


def kill_itself(_: Citizen) -> object:
    os.kill(os.getpid(), signal.SIGKILL)
    return None


def stop_itself(_: Citizen) -> object:
    os.kill(os.getpid(), signal.SIGSTOP)
    return None


def segfault(_: Citizen) -> object:
    return ctypes.string_at(0)


def lose(_: Citizen) -> object:
    raise DeviceLost("animal 7 was unplugged: plug it in again")


def silent(_: Citizen) -> object:
    return None


def wall(animal: Citizen) -> object:
    """No failure at all: something is near."""
    return animal.good(ahead_mm=100)


def flood(animal: Citizen) -> object:
    animal.due = time.monotonic()
    return [animal.good() for _ in range(200)]


def flood_stops(animal: Citizen) -> object:
    """Anybody may ask for a stop; nobody may keep the guard busy with it."""
    animal.due, now = time.monotonic(), time.monotonic_ns()
    animal.seq += 200
    return [Intent(seq=animal.seq - nth, captured_ns=now, command=Command.STOP) for nth in reversed(range(200))]


def shout_stop(animal: Citizen) -> object:
    """Not a flood: with each good reading a word that anybody may say."""
    good = animal.good()
    animal.seq += 1
    return [good, Intent(seq=animal.seq, captured_ns=time.monotonic_ns(), command=Command.STOP)]


def flood_losses(animal: Citizen) -> object:
    animal.due, now = time.monotonic(), time.monotonic_ns()
    return [Lost(seq=1, captured_ns=now, reason=f"leg {nth} was torn out") for nth in range(200)]


def flood_ends(animal: Citizen) -> object:
    animal.due, now = time.monotonic(), time.monotonic_ns()
    return [Ended(seq=1, captured_ns=now)] * 200


def flood_supervisor(animal: Citizen) -> object:
    """The line that is meant for its heartbeat; its own readings stay good."""
    with contextlib.suppress(BlockingIOError), socket.socket(fileno=os.dup(animal.lines()["control"])) as end:
        for _ in range(1_000):
            animal.seq += 1
            end.send(msgspec.msgpack.encode(wire.Note(f"lie {animal.seq}")))
    animal.due = time.monotonic()
    return animal.good()


def future(animal: Citizen) -> object:
    return animal.good(captured_ns=time.monotonic_ns() + 3600_000 * MS)


def past(animal: Citizen) -> object:
    return animal.good(captured_ns=time.monotonic_ns() - 3600_000 * MS)


def frozen(animal: Citizen) -> object:
    animal.kept = animal.kept or [time.monotonic_ns()]
    return animal.good(captured_ns=animal.kept[0])


def repeat(animal: Citizen) -> object:
    animal.kept = animal.kept or [animal.good()]
    return animal.kept[0]


def backwards(animal: Citizen) -> object:
    animal.seq -= 2
    return animal.good()


def nan(animal: Citizen) -> object:
    return animal.raw_fields(ahead_mm=math.nan)


def infinite(animal: Citizen) -> object:
    return animal.raw_fields(ahead_mm=math.inf)


def negative(animal: Citizen) -> object:
    return animal.raw_fields(ahead_mm=-5)


def huge(animal: Citizen) -> object:
    return animal.raw_fields(ahead_mm=10**9)


def wrong_type(animal: Citizen) -> object:
    return animal.raw_fields(ahead_mm="far away")


def wrong_unit(animal: Citizen) -> object:
    """Metres."""
    return animal.good(ahead_mm=animal.settings.ahead_mm // 1000)


def fraction(animal: Citizen) -> object:
    return animal.raw_fields(ahead_mm=4.0)


def unknown_field(animal: Citizen) -> object:
    return animal.raw_fields(ahead_mm=4000, ahead_m=4)


def random_bytes(animal: Citizen) -> object:
    animal.raw(os.urandom(64))
    return None


def half_message(animal: Citizen) -> object:
    whole = msgspec.msgpack.encode(Parcel(stage="range_citizen", body=RangeReading(seq=1, captured_ns=1, can_see=True)))
    animal.raw(whole[: len(whole) // 2])
    return None


def oversized(animal: Citizen) -> object:
    animal.raw(b"\x00" * 60_000)
    return None


def empty(animal: Citizen) -> object:
    """What a closed line reads as."""
    animal.raw(b"")
    return None


def give_descriptors(animal: Citizen) -> object:
    """To a guard that has not asked for any: its table must not fill up."""
    with contextlib.suppress(BlockingIOError), socket.socket(fileno=os.dup(animal.lines()["guard"])) as end:
        socket.send_fds(end, [b"a present"], [end.fileno()] * 200)
    return None


def deep(animal: Citizen) -> object:
    animal.raw(b"\x91" * 4000)
    return None


def impostor(animal: Citizen) -> object:
    animal.seq += 1
    body = RangeReading(seq=animal.seq, captured_ns=time.monotonic_ns(), can_see=True, ahead_mm=5000)
    animal.raw(msgspec.msgpack.encode(Parcel(stage="somebody_else", body=body)))
    return None


def close_socket(animal: Citizen) -> object:
    os.close(animal.lines()["guard"])
    time.sleep(60.0)
    return None


def fork(animal: Citizen) -> object:
    """Children that keep every descriptor open; the parent then dies, so its end is not read as closed."""
    for _ in range(3):
        if os.fork() == 0:
            time.sleep(20.0)
            os._exit(0)
    os._exit(5)


def eat_memory(animal: Citizen) -> object:
    """To its limit: until there is none left for the next message either."""
    used = int(Path("/proc/self/statm").read_text().split()[0]) * os.sysconf("SC_PAGE_SIZE")
    resource.setrlimit(resource.RLIMIT_AS, (used + 200_000_000, used + 200_000_000))
    while True:
        animal.kept.append(bytearray(8_000_000))


def scribble(animal: Citizen) -> object:
    """Over the pictures of every process of this run that lets itself be reached; its own readings stay good."""
    for link in Path("/proc").glob("[0-9]*/fd/*"):
        with contextlib.suppress(OSError):
            mine = str(animal.context.run_dir).encode() in (link.parents[1] / "cmdline").read_bytes()
            if mine and "chairward-frames" in os.readlink(link):
                with link.open("r+b", buffering=0) as ring:
                    ring.write(os.urandom(4096))
    return animal.good()


def press(animal: Citizen) -> object:
    """Buttons that a sensor's lane may not press."""
    animal.seq += 3
    now = time.monotonic_ns()
    return [
        Press(seq=animal.seq + nth, captured_ns=now, button=button)
        for nth, button in enumerate((Button.ARM, Button.RESET))
    ]


def command(animal: Citizen) -> object:
    """A motion that a sensor may not ask for."""
    animal.seq += 1
    return Intent(seq=animal.seq, captured_ns=time.monotonic_ns(), command=Command.FRONT, held=True)


def leak_descriptors(animal: Citizen) -> object:
    with contextlib.suppress(OSError):  # its own table is full: its own problem
        animal.kept.extend(os.pipe())
    return animal.good()


WAYS_TO_FAIL: dict[str, Callable[[Citizen], object]] = {
    name.rstrip("_"): way
    for name, way in list(globals().items())
    if callable(way) and getattr(way, "__annotations__", {}).get("return") == "object" and not isinstance(way, type)
}
"""Every function above by its name."""


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
    (folder / "chairward_zoo.py").write_text(Path(__file__).read_text())
    return folder

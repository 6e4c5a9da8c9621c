"""What a citizen of the zoo can turn into, in its own process: one function each, in place of its next reading."""

from __future__ import annotations

import contextlib
import ctypes
import inspect
import math
import os
import re
import resource
import signal
import socket
import time
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING

import msgspec

from chairward import wire
from chairward.components import DeviceLost
from chairward.messages import Button, Command, Ended, Intent, Lost, Parcel, Press, RangeReading

if TYPE_CHECKING:
    from chairward_zoo import Citizen

MS = 1_000_000


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
    if inspect.isfunction(way) and way.__module__ == __name__
}
"""Every function above by its name."""

"""What is at the far end of the serial line: the checked model of the firmware, or something else."""

from __future__ import annotations

import fcntl
import os
import select
import threading
import tty
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from doctor_world import World


@contextmanager
def controller(world: World, folder: Path) -> Iterator[None]:
    """What is at the far end of the serial line."""
    if world.pic == "missing":
        yield
        return
    from chairward_drive_pic_serial.engine import ModelEngine

    ours, theirs = os.openpty()
    tty.setraw(theirs)
    os.set_blocking(ours, False)
    (folder / "pic").symlink_to(os.ttyname(theirs))
    engine = ModelEngine(battery=world.battery)
    engine.set_inputs(stop=world.stop_input, charger=world.charger)
    over = threading.Event()

    def answer(data: bytes) -> bytes:
        if world.pic == "silent":
            return b""
        if world.pic == "garbage":  # what a line at another speed amounts to
            return bytes(b | 0x81 for b in data)
        if world.pic == "other":
            from chairward_drive_pic_serial import wire

            return wire.encode(b"OK ready") if data else b""
        engine.feed(data)
        engine.advance(20_000)
        said = engine.take()
        return _newer(said) if world.pic == "newer" else said

    def work() -> None:
        while not over.is_set():
            readable, _, _ = select.select([ours], [], [], 0.01)
            data = os.read(ours, 4096) if readable else b""
            if world.pic != "model" or data:
                reply = answer(data) if data else b""
            else:
                engine.advance(10_000)
                reply = engine.take()
            if reply:
                os.write(ours, reply)

    thread = threading.Thread(target=work)
    thread.start()
    taken = os.open(folder / "pic", os.O_RDWR | os.O_NOCTTY) if world.pic == "taken" else -1
    try:
        if taken >= 0:
            fcntl.flock(taken, fcntl.LOCK_EX)
        yield
    finally:
        over.set()
        thread.join()
        for fd in (ours, theirs, *([taken] if taken >= 0 else [])):
            os.close(fd)


def _newer(said: bytes) -> bytes:
    """The same answers from a firmware of a later protocol."""
    from chairward_drive_pic_serial import wire

    out = b""
    for frame in said.split(b"\0"):
        payload = wire.payload(frame) if frame else None
        if payload is not None and payload[0] == wire.Reply.HELLO:
            payload = payload[:2] + bytes([wire.PROTOCOL + 1]) + payload[3:]
        if payload is not None:
            out += wire.encode(payload)
    return out

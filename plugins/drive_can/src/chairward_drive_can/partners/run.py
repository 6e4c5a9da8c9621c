"""Running a simulated controller: on a pty that behaves like an slcan adapter, or on any CAN interface."""

from __future__ import annotations

import contextlib
import os
import pty
import select
import time
import tty
from collections.abc import Callable
from pathlib import Path
from typing import Protocol

from chairward.shared_state import SharedState
from chairward_drive_can import slcan
from chairward_drive_can.bus import Bus
from chairward_drive_can.frames import Frame
from chairward_drive_can.partners.body import Body

STEP_S = 0.002


class Partner(Protocol):
    """A simulated controller: frames in, frames out, told what time it is."""

    body: Body
    moves_heard: int

    def hear(self, frame: Frame, now_ns: int) -> list[Frame]:
        """What a frame brings about."""

    def tick(self, now_ns: int) -> list[Frame]:
        """What is due now."""


class AdapterPty:
    """The far end of an slcan adapter: a pty (linked to `link`) on one side, a `Bus` for the partner on the other."""

    def __init__(self, link: Path, *, acknowledges: bool = True) -> None:
        self._master, self._slave = pty.openpty()
        tty.setraw(self._slave)
        os.set_blocking(self._master, False)
        self._link, self._acknowledges = link, acknowledges
        self._lines = slcan.LineSplitter()
        self._open = False
        self.unanswered = 0
        with contextlib.suppress(FileNotFoundError):
            link.unlink()
        link.symlink_to(os.ttyname(self._slave))

    def fileno(self) -> int:
        return self._master

    def send(self, frame: Frame) -> None:
        if self._open:
            self._write(slcan.encode(frame))

    def receive(self) -> list[Frame]:
        frames = []
        for line in self._lines.feed(self._read()):
            if frame := slcan.decode(line):
                frames.append(frame)
                if self._acknowledges:
                    self._write(b"Z\r" if frame.extended else b"z\r")
            elif line[:1] in (b"O", b"L", b"C"):
                self._open = line[:1] != b"C"
                self._write(b"\r")
            elif line:
                self._write(b"\r")
        return frames

    def close(self) -> None:
        """Unplug: the port vanishes."""
        if self._master >= 0:
            with contextlib.suppress(FileNotFoundError):
                self._link.unlink()
            os.close(self._slave)
            os.close(self._master)
            self._master = -1

    def _read(self) -> bytes:
        try:
            return os.read(self._master, 4096)
        except BlockingIOError:
            return b""

    def _write(self, data: bytes) -> None:
        # An adapter whose host does not read loses frames; it does not wait.
        with contextlib.suppress(BlockingIOError):
            os.write(self._master, data)


def turn_round(partner: Partner, bus: Bus, now_ns: int) -> None:
    """One round: hear everything, say what is due."""
    for frame in bus.receive():
        for answer in partner.hear(frame, now_ns):
            bus.send(answer)
    for frame in partner.tick(now_ns):
        bus.send(frame)


def publish(pins: SharedState, body: Body, now_ns: int) -> None:
    """The controller's outputs, under the names of every simulated controller."""
    pins.write(
        time_ns=now_ns,
        drive_duty=min(1.0, abs(body.forward)),
        drive_in1=body.forward > 0,
        drive_in2=body.forward < 0,
        steer_duty=min(1.0, abs(body.left)),
        steer_in1=body.left > 0,
        steer_in2=body.left < 0,
        brake=body.standing,
    )


def serve(partner: Partner, bus: Bus, stopping: Callable[[], bool], pins: SharedState | None = None) -> None:
    """Turn round every 2 ms, and at once when something comes in, until `stopping`."""
    while not stopping():
        descriptor = bus.fileno()
        if descriptor >= 0:
            select.select([descriptor], [], [], STEP_S)
        else:
            time.sleep(STEP_S)  # an interface without a descriptor can only be asked again
        now_ns = time.monotonic_ns()
        turn_round(partner, bus, now_ns)
        if pins is not None:
            publish(pins, partner.body, now_ns)

"""The rig of the drive contract: the real drive on a pty, an engine at the other end, time in steps of 1 ms.

Used by tests and benchmarks (needs pytest through `chairward.testing`), by nothing that drives.
"""

from __future__ import annotations

import os
import tty
from collections.abc import Callable, Sequence
from pathlib import Path

from chairward.components import STILL, Drive, Motion
from chairward.testing.drive_rig import DriveRig, Heard
from chairward_drive_pic_serial import wire
from chairward_drive_pic_serial.drive import PicSerialDrive
from chairward_drive_pic_serial.engine import Engine
from chairward_drive_pic_serial.settings import PicSerialSettings


class PicRig(DriveRig):
    """pty + engine + drive. The clock is virtual: it moves only in `run`."""

    stop_s = 1.2

    def __init__(
        self, engine: Engine, folder: Path, *, step_us: int = 1000, tap: Callable[[bytes], bytes] | None = None
    ) -> None:
        super().__init__()
        self._step_us = step_us
        self.engine = engine
        self.link = folder / "pic"
        self.port = str(self.link)
        self.settings = PicSerialSettings(port=self.port)
        self.drive: Drive = PicSerialDrive(self.settings)
        self.full = Motion(self.settings.full_speed_mm_s, self.settings.full_turn_deg_s)
        self.t_ns = 5_000_000_000
        self.frozen = False
        self._tap = tap
        self._master = self._slave = -1
        self._splitter = wire.Splitter()
        self._alter: Callable[[bytes], bytes] = lambda data: data
        self._heard: list[Heard] = []
        self.engine.advance(30_000)
        self.engine.take()
        self.plug()

    def now_ns(self) -> int:
        """The virtual clock."""
        return self.t_ns

    def run(self, seconds: float) -> None:
        """Carry bytes both ways and let the engine run, 1 ms at a time."""
        left_us = round(seconds * 1e6)
        while left_us > 0:
            step = min(left_us, self._step_us)
            left_us -= step
            self.step(step)

    def step(self, microseconds: int) -> None:
        """One step."""
        if self._master >= 0 and not self.frozen:
            data = self._read()
            if data:
                self._note(data)
                self.engine.feed(self._tap(data) if self._tap else data)
        self.engine.advance(microseconds)
        self.t_ns += microseconds * 1000
        data = self._alter(self.engine.take())
        if data and self._master >= 0 and not self.frozen:
            os.write(self._master, data)

    def wheels(self) -> Motion:
        """From the pins."""
        pins = self.engine.pins()
        steer = (pins.steer_in1 - pins.steer_in2) * pins.steer_duty * wire.FULL
        drive = (pins.drive_in1 - pins.drive_in2) * pins.drive_duty * wire.FULL
        return Motion(drive * self.full.drive_mm_s / wire.FULL, steer * self.full.turn_deg_s / wire.FULL)

    def braked(self) -> bool:
        """Brake pin, or both motors short-braked."""
        pins = self.engine.pins()
        short = pins.steer_in1 == pins.steer_in2 and pins.drive_in1 == pins.drive_in2
        return bool(pins.brake) or (short and pins.steer_duty > 0.0 and pins.drive_duty > 0.0)

    def heard(self) -> Sequence[Heard]:
        """Motion frames that came out of the pty."""
        return self._heard

    def unplug(self) -> None:
        """Close the pty and take its name away."""
        self.link.unlink(missing_ok=True)
        for fd in (self._master, self._slave):
            if fd >= 0:
                os.close(fd)
        self._master = self._slave = -1

    def plug(self) -> None:
        """A new pty under the same name."""
        self._master, self._slave = os.openpty()
        tty.setraw(self._slave)
        os.set_blocking(self._master, False)
        self.link.unlink(missing_ok=True)
        self.link.symlink_to(os.ttyname(self._slave))

    def freeze(self) -> None:
        """Nothing passes the wire."""
        self.frozen = True

    def thaw(self) -> None:
        """Everything passes again."""
        self.frozen = False

    def restart(self) -> None:
        """Reset pin."""
        self.engine.restart()

    def press_stop(self, pressed: bool) -> None:
        """RB0."""
        self.engine.set_inputs(stop=pressed)

    def charger(self, connected: bool) -> None:
        """RB1."""
        self.engine.set_inputs(charger=connected)

    def battery(self, fraction: float) -> None:
        """AN0."""
        self.engine.set_inputs(battery=self.settings.battery_counts(fraction))

    def rival(self) -> Drive:
        """Another drive on the same pty."""
        return PicSerialDrive(self.settings)

    def other_version(self) -> None:
        """The controller's HELLO replies say protocol 2."""
        splitter = wire.Splitter()

        def alter(data: bytes) -> bytes:
            told = b""
            for payload in splitter.feed(data):
                if payload[0] == wire.Reply.HELLO:
                    payload = payload[:2] + bytes([wire.PROTOCOL + 1]) + payload[3:]
                told += wire.encode(payload)
            return told

        self._alter = alter

    def close(self) -> None:
        """End all."""
        self.drive.close()
        self.unplug()
        self.engine.close()

    def _read(self) -> bytes:
        try:
            return os.read(self._master, 4096)
        except BlockingIOError:
            return b""

    def _note(self, data: bytes) -> None:
        for payload in self._splitter.feed(data):
            if payload[0] == wire.Ask.DRIVE and len(payload) == 4:
                motion = self.settings.motion(wire.signed(payload[2]), wire.signed(payload[3]))
                self._heard.append(Heard(self.t_ns, motion))
            elif payload[0] in (wire.Ask.BRAKE, wire.Ask.ESTOP):
                self._heard.append(Heard(self.t_ns, STILL))

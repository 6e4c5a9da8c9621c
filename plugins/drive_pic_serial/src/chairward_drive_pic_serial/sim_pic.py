"""The simulated PIC as a companion: an engine behind a pty at run_dir/pic, its pins in run_dir/pins, in real time."""

from __future__ import annotations

import logging
import os
import select
import time
import tty
from collections.abc import Callable
from pathlib import Path
from typing import Literal

from pydantic import Field

from chairward.components import Settings
from chairward.shared_state import PIN_NAMES, SharedState
from chairward_drive_pic_serial import bridge
from chairward_drive_pic_serial.engine import Engine, ModelEngine

PRIORITY = 40
WAKE_S = 0.002
"""Pins are published at least this often."""
WATCH_S = 0.05
BEHIND_NS = 50_000_000
"""gpsim only: when this far behind real time, give the lost time up instead of racing after it."""


log = logging.getLogger(__name__)


class SimPicSettings(Settings):
    """Which engine, and what its inputs say."""

    engine: Literal["model", "gpsim"] = Field(
        default="model",
        description="model: the Python model that the tests hold against the firmware; gpsim: the real firmware "
        "(needs the Debian packages gpsim and gputils).",
    )
    bridge: bool = Field(
        default=True,
        description="gpsim: run it on a pty of its own where gpsim-dev and g++ are installed (more punctual); false: "
        "in slices from here.",
    )
    battery: int = Field(default=214, ge=0, le=255, description="Battery input as the PIC's ADC sees it, 0..255.")


def make_engine(settings: SimPicSettings) -> Engine:
    """The engine by name, never another one silently. Raises FirmwareError."""
    if settings.engine == "gpsim":
        from chairward_drive_pic_serial.gpsim import Gpsim

        return Gpsim(battery=settings.battery)
    return ModelEngine(battery=settings.battery)


class PtyEnd:
    """The controller's end of a pty, and its name as a link. Never waits; what nobody reads is dropped."""

    def __init__(self, link: Path) -> None:
        self.link = link
        self.fd, self._slave = os.openpty()
        tty.setraw(self._slave)  # kept open: the wire is there before a host opens it and after it has closed
        os.set_blocking(self.fd, False)
        part = link.with_name(f"{link.name}.part")
        part.unlink(missing_ok=True)
        part.symlink_to(os.ttyname(self._slave))
        part.replace(link)

    def read(self) -> bytes:
        """What the host has written."""
        try:
            return os.read(self.fd, 4096)
        except BlockingIOError:
            return b""

    def write(self, data: bytes) -> int:
        """To the host; how much it took."""
        try:
            return os.write(self.fd, data)
        except BlockingIOError:
            return 0

    def close(self) -> None:
        """Take the name away."""
        self.link.unlink(missing_ok=True)
        os.close(self.fd)
        os.close(self._slave)


class SimPic:
    """A `chairward.components.Companion`."""

    def __init__(self, settings: SimPicSettings, run_dir: Path, link: Path | None = None) -> None:
        self._settings = settings
        self._run_dir = run_dir
        self._link = run_dir / "pic" if link is None else link

    def run(self, ready: Callable[[], None], stopping: Callable[[], bool]) -> None:
        """A PIC in real time until told to stop. Raises FirmwareError."""
        if self._settings.engine == "gpsim" and self._settings.bridge and bridge.available():
            self._run_on_pty(ready, stopping)
        else:
            self._carry(ready, stopping)

    def _run_on_pty(self, ready: Callable[[], None], stopping: Callable[[], bool]) -> None:
        """gpsim does it all by itself; only watch over it."""
        pins = self._run_dir / "pins"
        SharedState.create(pins, PIN_NAMES).close()
        gpsim = bridge.GpsimOnPty(self._link, pins, battery=self._settings.battery)
        try:
            _as_punctual_as_a_chip(gpsim.process.pid)
            while not gpsim.ready() and not stopping():
                select.select([], [], [], WAKE_S)
            ready()
            while gpsim.ready() and not stopping():
                select.select([], [], [], WATCH_S)
        finally:
            gpsim.close()

    def _carry(self, ready: Callable[[], None], stopping: Callable[[], bool]) -> None:
        """Carry bytes between pty and engine."""
        engine = make_engine(self._settings)
        pty = PtyEnd(self._link)
        pins = SharedState.create(self._run_dir / "pins", PIN_NAMES)
        try:
            if isinstance(engine, ModelEngine):
                _as_punctual_as_a_chip(0)
            _publish(pins, engine)
            ready()
            then_ns = time.monotonic_ns()
            while not stopping():
                readable, _, _ = select.select([pty.fd], [], [], max(0.0, min(WAKE_S, engine.line_clear_s())))
                now_ns = time.monotonic_ns()
                then_ns = _pace(engine, then_ns, now_ns)
                if readable:
                    engine.feed(pty.read())
                if data := engine.take():
                    pty.write(data)
                _publish(pins, engine)
        finally:
            pty.close()
            pins.close()
            engine.close()


def _as_punctual_as_a_chip(pid: int) -> None:
    """A PIC is never held up by other programs: below the guard's priority, above everybody else's, where allowed."""
    try:
        os.sched_setscheduler(pid, os.SCHED_FIFO | os.SCHED_RESET_ON_FORK, os.sched_param(PRIORITY))
    except PermissionError:
        log.info("no real-time priority: on a busy machine the simulated PIC may stop by itself now and then")


def _pace(engine: Engine, then_ns: int, now_ns: int) -> int:
    """Bring the engine to now; what its clock says then. The model always catches up; gpsim may be too slow to."""
    if isinstance(engine, ModelEngine):
        engine.advance((now_ns - then_ns) / 1000)
        return now_ns
    step_us = (now_ns - then_ns) // 1000
    if step_us > 0:
        engine.advance(min(step_us, BEHIND_NS // 1000))
    return now_ns if now_ns - then_ns > BEHIND_NS else then_ns + step_us * 1000


def _publish(shared: SharedState, engine: Engine) -> None:
    pins = engine.pins()
    state, fault = engine.registers()
    shared.write(
        time_ns=time.monotonic_ns(),
        drive_duty=pins.drive_duty,
        drive_in1=pins.drive_in1,
        drive_in2=pins.drive_in2,
        steer_duty=pins.steer_duty,
        steer_in1=pins.steer_in1,
        steer_in2=pins.steer_in2,
        brake=pins.brake,
        state=state,
        fault=fault,
    )

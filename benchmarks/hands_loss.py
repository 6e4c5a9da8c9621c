"""The host is killed, stopped or unplugged, or the firmware hangs, at full speed: when are the outputs off, in firmware
cycles, and how far does the chair's body roll?

    python benchmarks/hands_loss.py [--runs 200]              writes benchmarks/results/hands_loss.json

The real drive in a process of its own drives the real firmware in gpsim over a pty, in real time; what happens on the
PIC's pins is read from gpsim's log, cycle by cycle, and replayed to the simulator's body on the level and downhill.
Goes on where it was ended (--minutes), as long as the sources are the same. Needs gpsim-dev and g++.
"""

from __future__ import annotations

import gc
import os
import random
import signal
import tempfile
import time
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Annotated, Any

import typer
from report import machine, of_sources, save, saved, spread

from chairward.components import STILL, DriveError, Motion
from chairward.shared_state import PIN_NAMES, SharedState
from chairward.stopping import decel_on_slope_mm_s2, stopping_distance_mm
from chairward_drive_pic_serial import wire
from chairward_drive_pic_serial.bridge import GpsimOnPty
from chairward_drive_pic_serial.drive import PicSerialDrive
from chairward_drive_pic_serial.model import TIMEOUT_MS
from chairward_drive_pic_serial.settings import PicSerialSettings
from chairward_simulator.body import Body, BodyLaw, pins_from

CYCLES_PER_MS = 5_000
CASES = ("killed", "stopped", "unplugged", "hang")
LIMIT_MS = {"killed": TIMEOUT_MS + 10, "stopped": TIMEOUT_MS + 10, "unplugged": TIMEOUT_MS + 10, "hang": 300}
"""From the last byte of the last frame that the PIC obeyed; a hang: from the byte that brings it about."""
HANG = wire.encode(bytes([0x7E, 4]))
SPEED_MM_S = 500.0
FULL_SPEED_MM_S = 700.0
SOURCES = ("firmware/drive.asm", "bridge/__init__.py", "bridge/pty_bridge.cc", "drive.py", "wire.py", "port.py")


@dataclass(frozen=True, slots=True)
class Ground:
    """slope: downhill, percent. decel, watchdog, wire: as [stopping] of the shipped chair files has them."""

    name: str
    slope_percent: float
    decel_mm_s2: float

    def proven_mm(self, silence_ms: float) -> float:
        """How far the chair may go from the last command until it stands, as its profile proves it."""
        decel = decel_on_slope_mm_s2(self.decel_mm_s2, self.slope_percent)
        return stopping_distance_mm(SPEED_MM_S, silence_ms / 1000.0, decel)


WIRE_MS, WATCHDOG_MS, HANG_MS = 4, 200, 300
GROUNDS = (Ground("level", 0.0, 600.0), Ground("downhill_9_percent", 9.0, 1500.0))
"""The level of sim.toml, and the steepest slope of any shipped chair (rnet.toml)."""


@dataclass(frozen=True, slots=True)
class Event:
    """A line of gpsim's log: a byte that has arrived, or the pins after a change."""

    cycle: int
    byte: int | None
    pins: dict[str, float]


def read_log(path: Path, start: int) -> tuple[list[Event], int]:
    """The whole lines from `start`, and where the next begin."""
    with path.open(encoding="ascii") as file:
        file.seek(start)
        text = file.read()
    whole, _, rest = text.rpartition("\n")
    events = []
    for line in whole.splitlines():
        kind, cycle, *values = line.split()
        if kind == "byte":
            events.append(Event(int(cycle), int(values[0]), {}))
        else:
            events.append(Event(int(cycle), None, dict(zip(PIN_NAMES[1:], map(float, values), strict=True))))
    return events, start + len(text) - len(rest)


def host(port: str) -> None:
    """A guard's loop, as short as it can be; never returns."""
    drive = PicSerialDrive(PicSerialSettings(port=port, full_speed_mm_s=FULL_SPEED_MM_S, accel_mm_s2=5000.0))
    while True:
        now = time.monotonic_ns()
        try:
            status = drive.poll(now)
            if not status.linked:
                drive.connect(now)
            elif not status.armed:
                drive.arm(now)
            drive.command(now, Motion(SPEED_MM_S, 0.0) if status.armed else STILL)
        except DriveError:
            pass  # unplugged, or the firmware has stopped by itself: connect again
        time.sleep(0.02)


def start_host(port: str) -> int:
    """As a process of its own; its id."""
    gc.freeze()
    child = os.fork()
    if child == 0:
        try:
            host(port)
        finally:
            os._exit(1)
    return child


def drives(pins: dict[str, float]) -> bool:
    return pins["drive_in1"] != pins["drive_in2"]


def one(case: str, gpsim: GpsimOnPty, pins: SharedState, port: Path, chance: random.Random) -> None:
    """Drive until the speed is steady, then let it happen; returns when the motor has been off for a while."""
    gpsim.plug()
    wait(gpsim.ready)
    child = start_host(str(port))
    try:
        wait(lambda: drives(pins.read()) and pins.read()["drive_duty"] >= SPEED_MM_S / FULL_SPEED_MM_S - 0.02)
        time.sleep(0.1 + chance.random() * 0.02)  # at any moment between two frames
        if case == "killed":
            os.kill(child, signal.SIGKILL)
        elif case == "stopped":
            os.kill(child, signal.SIGSTOP)
        elif case == "unplugged":
            gpsim.unplug()
        else:
            with port.open("wb", buffering=0) as line:
                line.write(b"\0" + HANG)
        wait(lambda: not drives(pins.read()))
    finally:
        os.kill(child, signal.SIGKILL)  # or it would connect again
        os.waitpid(child, 0)
    time.sleep(0.1)


def wait(done: Any) -> None:
    """Raises TimeoutError after 20 s."""
    end = time.monotonic() + 20.0
    while not done():
        if time.monotonic() > end:
            raise TimeoutError("the simulated PIC did not get there within 20 s")
        time.sleep(0.002)


def off_after(case: str, events: Sequence[Event]) -> tuple[float, int] | None:
    """(ms, start): cycles from the last byte of the frame that counts until the outputs were off.

    None where something else stopped the motor: on a busy machine the host itself may brake just before it is lost.
    """
    moving = [i for i, event in enumerate(events) if event.byte is None and drives(event.pins)]
    after = [e for e in events[moving[-1] + 1 :] if e.byte is None]
    off = after[0]
    before = [i for i, e in enumerate(events) if e.byte == 0 and e.cycle < off.cycle]
    ends = [i for i in before if case != "hang" or _is_hang(events, i)]
    start = events[ends[-1]].cycle if ends else off.cycle
    if case == "hang":
        by_itself = any(e.pins["state"] == wire.State.BOOT for e in after)
    else:
        by_itself = bool(int(off.pins["fault"]) & wire.Fault.SILENCE)
    return ((off.cycle - start) / CYCLES_PER_MS, start) if by_itself else None


def _is_hang(events: Sequence[Event], end: int) -> bool:
    """The bytes up to this one are the frame that hangs the firmware."""
    bytes_ = [e.byte for e in events[: end + 1] if e.byte is not None]
    return bytes(bytes_[-len(HANG) :]) == HANG


def rolled_mm(events: Sequence[Event], start: int, ground: Ground) -> float:
    """How far the body rolls from the cycle `start` until it stands."""
    law = BodyLaw(drive=replace(BodyLaw().drive, full=FULL_SPEED_MM_S), slope_percent=-ground.slope_percent)
    body, at, gone = Body(x_mm=0.0, y_mm=0.0, heading_deg=0.0), start, 0.0
    changes = [e for e in events if e.byte is None]
    before = [e for e in changes if e.cycle <= start]
    pins = pins_from(before[-1].pins)
    for _ in range(2000):  # the speed that it has with these pins on this ground
        body = body.step(pins, 0.001, law)
    body = replace(body, x_mm=0.0)
    for _ in range(20_000):
        for event in changes:
            if at - CYCLES_PER_MS < event.cycle <= at:
                pins = pins_from(event.pins)
        body = body.step(pins, 0.001, law)
        at += CYCLES_PER_MS
        if body.speed_mm_s == 0.0:
            return max(gone, body.x_mm)
        gone = max(gone, body.x_mm)
    raise AssertionError("the body does not come to rest")


def main(
    runs: int = 200,
    minutes: Annotated[float, typer.Option(help="end after so long and go on the next time")] = 3.5,
) -> None:
    """See above."""
    sources = of_sources(*SOURCES)
    done = saved("hands_loss", sources).get("raw", {})
    raw: dict[str, list[list[float]]] = {case: done.get(case, []) for case in CASES}
    until, failed = time.monotonic() + minutes * 60, False
    for case in CASES:
        with tempfile.TemporaryDirectory() as name:
            folder = Path(name)
            shared = SharedState.create(folder / "pins", PIN_NAMES)
            defines = ("HANGTEST",) if case == "hang" else ()
            gpsim = GpsimOnPty(folder / "pic", folder / "pins", defines=defines, log=folder / "log")
            try:
                wait(gpsim.ready)
                pins, at = SharedState.attach(folder / "pins"), 0
                while len(raw[case]) < runs and time.monotonic() < until:
                    one(case, gpsim, pins, folder / "pic", random.Random(len(raw[case])))
                    events, at = read_log(folder / "log", at)
                    found = off_after(case, events)
                    if found is None:
                        continue
                    ms, start = found
                    raw[case].append([ms, *(round(rolled_mm(events, start, g), 1) for g in GROUNDS)])
                pins.close()
            finally:
                gpsim.close()
                shared.close()
        save("hands_loss", told(raw, sources))
        failed |= any(ms > LIMIT_MS[case] for ms, *_ in raw[case])
        print(f"{case}: {len(raw[case])} of {runs} runs", spread([ms for ms, *_ in raw[case]]) if raw[case] else "")
    if failed:
        raise typer.Exit(1)


def told(raw: dict[str, list[list[float]]], sources: str) -> dict[str, Any]:
    """The result with its figures."""
    cases: dict[str, Any] = {}
    for case, values in raw.items():
        if not values:
            continue
        silence_ms = HANG_MS if case == "hang" else WATCHDOG_MS + WIRE_MS
        cases[case] = {
            "outputs_off_after_ms": spread([ms for ms, *_ in values]),
            "limit_ms": LIMIT_MS[case],
            "within_limit": sum(ms <= LIMIT_MS[case] for ms, *_ in values),
        }
        for index, ground in enumerate(GROUNDS, 1):
            rolled, proven = [v[index] for v in values], ground.proven_mm(silence_ms)
            cases[case][ground.name] = {
                "rolled_mm": [min(rolled), max(rolled)],
                "proven_mm": round(proven, 1),
                "within": sum(mm <= proven for mm in rolled),
            }
    return {
        "what": "real firmware in gpsim, real drive in a process that is lost at a steady 500 mm/s",
        "cases": cases,
        "sources": sources,
        **machine(),
        "raw": raw,
    }


if __name__ == "__main__":
    typer.run(main)

"""How soon a stop is on the PIC's pins, and what the drive costs, in real time.

    python benchmarks/hands_latency.py [--engine gpsim|model]     writes benchmarks/results/hands_latency_ENGINE.json

Latency: from the call `command(..., hard_stop=True)` to both bridge inputs low, at random moments of a drive at speed.
In between are the drive, the pty, the line at 57600 baud and the firmware; with gpsim the parts are told too. A pty's
bytes are carried by a worker of the kernel that has no priority and so waits on a busy machine; a real port has none.
Both ends with SCHED_FIFO where that is allowed.
"""

from __future__ import annotations

import contextlib
import os
import random
import select
import sys
import tempfile
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any, Literal

import typer
from report import machine, save, spread

from chairward import realtime
from chairward.components import STILL, DriveError, Motion
from chairward.shared_state import PIN_NAMES, SharedState
from chairward_drive_pic_serial import bridge
from chairward_drive_pic_serial.drive import PicSerialDrive
from chairward_drive_pic_serial.settings import PicSerialSettings
from chairward_drive_pic_serial.sim_pic import SimPic, SimPicSettings

Engine = Literal["gpsim", "model"]
SPEED = Motion(400.0, 0.0)
CYCLES_PER_MS, BYTE_CYCLES = 5_000, 868
MEMORY = Path("/dev/shm")
"""gpsim's log must not wait for a disk."""


def live(engine: Engine, body: Callable[[PicSerialDrive, SharedState], None]) -> list[float]:
    """A simulated PIC in a process of its own, and the drive here. gpsim: what `line_and_firmware` says."""
    with tempfile.TemporaryDirectory(dir=MEMORY if MEMORY.is_dir() else None) as name:
        folder = Path(name)
        if engine == "gpsim" and bridge.available():
            SharedState.create(folder / "pins", PIN_NAMES).close()
            gpsim = bridge.GpsimOnPty(folder / "pic", folder / "pins", log=folder / "log")
            try:
                with contextlib.suppress(PermissionError):
                    os.sched_setscheduler(gpsim.process.pid, os.SCHED_FIFO, os.sched_param(40))
                while not gpsim.ready():
                    time.sleep(0.05)
                drive_it(folder, body)
            finally:
                gpsim.close()
            return line_and_firmware(folder / "log")
        child = os.fork()
        if child == 0:
            parent = os.getppid()
            try:
                SimPic(SimPicSettings(engine=engine), folder).run(
                    (folder / "ready").touch, lambda: os.getppid() != parent or (folder / "end").exists()
                )
            finally:
                os._exit(0)
        try:
            end = time.monotonic() + 60.0
            while not (folder / "ready").exists() and time.monotonic() < end:
                time.sleep(0.05)
            drive_it(folder, body)
        finally:
            (folder / "end").touch()
            os.waitpid(child, 0)
        return []


def drive_it(folder: Path, body: Callable[[PicSerialDrive, SharedState], None]) -> None:
    """The drive on folder/pic, with the pins."""
    pins = SharedState.attach(folder / "pins")
    drive = PicSerialDrive(PicSerialSettings(port=str(folder / "pic"), accel_mm_s2=5000.0))
    body(drive, pins)
    drive.close()
    pins.close()


def line_and_firmware(log: Path) -> list[float]:
    """Milliseconds from the first start bit of each frame that stopped the motor to the pins, in firmware cycles."""
    taken, frame, moving = [], [], False
    for line in log.read_text(encoding="ascii").splitlines():
        kind, cycle, *values = line.split()
        if kind == "byte":
            if frame and int(cycle) - frame[-1] > 1.5 * BYTE_CYCLES:
                frame = []
            frame.append(int(cycle))
            continue
        was, moving = moving, values[1] != values[2]
        if was and not moving and frame:
            taken.append((int(cycle) - frame[0] + BYTE_CYCLES) / CYCLES_PER_MS)
    return taken


def tick(drive: PicSerialDrive, motion: Motion) -> bool:
    """One call of the guard's; armed?"""
    now = time.monotonic_ns()
    try:
        status = drive.poll(now)
        if not status.linked:
            drive.connect(now)
        elif not status.armed:
            drive.arm(now)
        drive.command(now, motion if status.armed else STILL)
    except DriveError as error:
        print(error, file=sys.stderr)
        return False
    return status.armed


def stops(engine: Engine, runs: int) -> dict[str, Any]:
    """Milliseconds of each stop and of its parts, and the runs that were lost because the machine was away."""
    taken: list[float] = []
    called: list[float] = []
    lost = 0

    def body(drive: PicSerialDrive, pins: SharedState) -> None:
        nonlocal lost
        chance = random.Random(1)
        for _ in range(runs):
            end = time.monotonic() + 20.0
            while not (tick(drive, SPEED) and pins.read()["drive_in1"]) and time.monotonic() < end:
                time.sleep(0.02)
            time.sleep(0.005 + chance.random() * 0.01)
            try:
                drive.poll(time.monotonic_ns())
                start = time.monotonic_ns()
                drive.command(start, STILL, hard_stop=True)
                called.append((time.monotonic_ns() - start) / 1e6)
            except DriveError:
                lost += 1
                continue
            while (seen := pins.read())["drive_in1"]:
                if time.monotonic_ns() - start > 1_000_000_000:
                    raise SystemExit("the pin did not fall within 1 s")
                time.sleep(0.0002)
            taken.append((seen["time_ns"] - start) / 1e6)

    line = live(engine, body)
    told = {"stop_to_pin_ms": spread(taken), "runs_lost_to_the_machine": lost, "of_it_the_call_ms": spread(called)}
    return told | ({"of_it_line_and_firmware_ms": spread(line)} if line else {})


def calls(runs: int) -> list[float]:
    """CPU time of `poll` and `command`, in microseconds: the guard's tick waits for them."""
    took: list[float] = []

    def body(drive: PicSerialDrive, _pins: SharedState) -> None:
        for _ in range(100):
            tick(drive, STILL)
            time.sleep(0.01)
        for _ in range(runs):
            start = time.thread_time_ns()
            tick(drive, Motion(200.0, 10.0))
            took.append((time.thread_time_ns() - start) / 1e3)
            time.sleep(0.002)

    live("model", body)
    return took


def cost(engine: Engine, seconds: float) -> float:
    """Share of a core that the simulated PIC takes while it is driven at 50 Hz."""

    def body(drive: PicSerialDrive, _pins: SharedState) -> None:
        end = time.monotonic() + seconds
        while time.monotonic() < end:
            tick(drive, Motion(300.0, 0.0))
            select.select([], [], [], 0.02)

    before = os.times()
    live(engine, body)
    after = os.times()
    used = after.children_user + after.children_system - before.children_user - before.children_system
    return used / seconds


def main(engine: Engine = "gpsim", runs: int = 300, fifo: bool = True) -> None:
    """See above."""
    granted = realtime.claim(30) if fifo else None
    found = stops(engine, runs)
    took = calls(2000)
    result: dict[str, Any] = {
        "what": "hard stop called to both bridge inputs low; real drive, pty, 57600 baud",
        "engine": engine,
        "pty_bridge": engine == "gpsim" and bridge.available(),
        "sched_fifo": bool(granted and granted.fifo),
        **found,
        "poll_and_command_cpu_us": spread(took),
        "simulated_pic_share_of_a_core": round(cost(engine, 5.0), 3),
    }
    save(f"hands_latency_{engine}", result | machine())
    print(result)


if __name__ == "__main__":
    typer.run(main)

"""Measures the hands: `python benchmarks/hands.py COMMAND`; each prints one line of figures (see --help).

All but `latency` and `cpu` run in firmware time, so a busy machine makes them slower, not worse.
"""

from __future__ import annotations

import importlib
import inspect
import os
import random
import resource
import select
import statistics
import sys
import tempfile
import threading
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import typer

from chairward.components import STILL, DriveError, Motion
from chairward.shared_state import SharedState
from chairward_drive_pic_serial import wire
from chairward_drive_pic_serial.agreement import Pair, disagreement
from chairward_drive_pic_serial.corruption import corrupt
from chairward_drive_pic_serial.describe import describe
from chairward_drive_pic_serial.drive import PicSerialDrive
from chairward_drive_pic_serial.engine import Engine, ModelEngine
from chairward_drive_pic_serial.gpsim import Gpsim
from chairward_drive_pic_serial.rig import PicRig
from chairward_drive_pic_serial.settings import PicSerialSettings
from chairward_drive_pic_serial.sim_pic import SimPic, SimPicSettings

app = typer.Typer(add_completion=False, no_args_is_help=True, help=__doc__)


def _engine(name: str) -> Engine:
    return Gpsim() if name == "gpsim" else ModelEngine()


def _spread(name: str, values: list[float], unit: str = "ms") -> str:
    ordered = sorted(values)
    at = [ordered[min(len(ordered) - 1, int(len(ordered) * p))] for p in (0.5, 0.99)]
    return f"{name}: n {len(ordered)}, p50 {at[0]:.2f}, p99 {at[1]:.2f}, max {ordered[-1]:.2f} {unit}"


@app.command()
def agreement(sequences: int = 2000, steps: int = 10) -> None:
    """Model against gpsim over random sequences: replies, state, fault, pins after every step."""
    start, pair, wrong = time.monotonic(), Pair(), 0
    for seed in range(sequences):
        if differs := disagreement(pair, seed, steps):
            wrong += 1
            print(differs)
            pair.close()
            pair = Pair()
        if (seed + 1) % 250 == 0:
            print(f"{seed + 1} sequences, {wrong} differ, {time.monotonic() - start:.0f} s", file=sys.stderr)
    pair.close()
    print(f"agreement: {sequences} sequences of {steps} steps, {wrong} differ, {time.monotonic() - start:.0f} s")
    if wrong:
        raise typer.Exit(1)


@app.command()
def corruption(engine: str = "model", frames: int = 100_000, seed: int = 1) -> None:
    """Damaged frames, each followed by a good one, to a driving controller."""
    pic, start = _engine(engine), time.monotonic()
    tally = corrupt(pic, frames, seed)
    pic.close()
    print(f"corruption {engine}: {tally}, {time.monotonic() - start:.0f} s")
    if tally.accepted or tally.good_lost:
        raise typer.Exit(1)


@app.command()
def silence(engine: str = "model", runs: int = 200, seed: int = 1) -> None:
    """The host dies, or its cable is pulled, at a random moment at full speed: firmware time until the motor is off."""
    chance, off = random.Random(seed), []
    with tempfile.TemporaryDirectory() as folder:
        rig = PicRig(_engine(engine), Path(folder))
        for number in range(runs):
            rig.go(Motion(rig.full.drive_mm_s, 0.0), 0.1)
            rig.drive.command(rig.now_ns(), Motion(rig.full.drive_mm_s, 0.0))
            rig.step(chance.randint(1, 1000))
            start = rig.now_ns()
            if number % 2:
                rig.unplug()
            while rig.wheels() != STILL:
                rig.step(500)
            off.append((rig.now_ns() - start) / 1e6)
            assert rig.braked()
            if number % 2:
                rig.plug()
            rig.connect(5.0)
        rig.close()
    print(_spread(f"silence {engine}: last frame written to motor off and braked", off))


@app.command()
def hang(runs: int = 200) -> None:
    """The firmware's loop hangs with the motor on (gpsim): firmware time until the watchdog has switched it off."""
    off = []
    pic = Gpsim(("HANGTEST",))
    for number in range(runs):
        pic.advance(20_000 + number % 17 * 61)
        pic.feed(wire.ask(wire.Ask.HELLO, 1, 1, 1) + wire.ask(wire.Ask.DRIVE, 2, 0, 0))
        pic.feed(wire.ask(wire.Ask.DRIVE, 3, 0, 90))
        pic.advance(120_000)
        assert pic.pins().drive_in1, "did not drive"
        pic.feed(wire.encode(bytes([0x7E, 4])))
        us = 0
        while pic.pins().drive_in1:
            pic.advance(1000)
            us += 1000
        off.append(us / 1000)
    pic.close()
    print(_spread("hang gpsim: hanging frame sent to motor off", off))


def _live(engine: str, body: Callable[[PicSerialDrive, SharedState], None]) -> None:
    """A simulated PIC in a child process, and the drive connected and armed here."""
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        child = os.fork()
        if child == 0:
            parent = os.getppid()
            try:
                SimPic(SimPicSettings.model_validate({"engine": engine}), folder).run(
                    lambda: None, lambda: os.getppid() != parent or (folder / "end").exists()
                )
            finally:
                os._exit(0)
        try:
            pins = SharedState.attach(folder / "pins", 10.0)
            drive = PicSerialDrive(PicSerialSettings(port=str(folder / "pic"), accel_mm_s2=5000.0))
            body(drive, pins)
            drive.close()
        finally:
            (folder / "end").touch()
            os.waitpid(child, 0)


def _tick(drive: PicSerialDrive, motion: Motion, *, hard_stop: bool = False) -> bool:
    """One call of the guard's; armed?"""
    now = time.monotonic_ns()
    try:
        status = drive.poll(now)
        if not status.linked:
            drive.connect(now)
        elif not status.armed:
            drive.arm(now)
        drive.command(now, motion if status.armed else STILL, hard_stop=hard_stop)
    except DriveError as error:
        print(error, file=sys.stderr)
        return False
    return status.armed


@app.command()
def latency(engine: str = "model", runs: int = 200, fifo: bool = True) -> None:
    """Hard-stop call to the bridge input falling, in real time (pty, line time, firmware; read the pins' own stamp)."""
    taken: list[float] = []
    if fifo:
        try:
            os.sched_setscheduler(0, os.SCHED_FIFO, os.sched_param(30))
        except PermissionError:
            print("no permission for SCHED_FIFO: figures without it", file=sys.stderr)

    def body(drive: PicSerialDrive, pins: SharedState) -> None:
        chance = random.Random(1)
        for _ in range(runs):
            end = time.monotonic() + 2.0
            while not (pins.read()["drive_in1"] and _tick(drive, Motion(400.0, 0.0))) and time.monotonic() < end:
                _tick(drive, Motion(400.0, 0.0))
                time.sleep(0.02)
            time.sleep(0.005 + chance.random() * 0.01)
            try:
                drive.poll(time.monotonic_ns())
                start = time.monotonic_ns()
                drive.command(start, STILL, hard_stop=True)
            except DriveError as error:  # the machine was away for 200 ms: not what is measured here
                print(error, file=sys.stderr)
                continue
            while (seen := pins.read())["drive_in1"]:
                if time.monotonic_ns() - start > 1_000_000_000:
                    raise SystemExit("the pin did not fall within 1 s")
                time.sleep(0.0002)
            taken.append((seen["time_ns"] - start) / 1e6)

    _live(engine, body)
    print(_spread(f"latency {engine}{' FIFO' if fifo else ''}: hard stop called to bridge input off", taken))


@app.command()
def cpu(engine: str = "model", seconds: float = 10.0) -> None:
    """What the simulated PIC costs while it is driven at 50 Hz."""

    def body(drive: PicSerialDrive, _pins: SharedState) -> None:
        end = time.monotonic() + seconds
        while time.monotonic() < end:
            _tick(drive, Motion(300.0, 0.0))
            select.select([], [], [], 0.02)

    before = resource.getrusage(resource.RUSAGE_CHILDREN)
    _live(engine, body)
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    used = after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime
    print(f"cpu {engine}: {used / seconds * 100:.1f} % of a core")


@app.command()
def calls(runs: int = 5000) -> None:
    """How long `command` + `poll` take (the guard's tick waits for them)."""
    took: list[float] = []

    def body(drive: PicSerialDrive, _pins: SharedState) -> None:
        for _ in range(100):
            _tick(drive, STILL)
            time.sleep(0.01)
        for _ in range(runs):
            start = time.thread_time_ns()
            _tick(drive, Motion(200.0, 10.0))
            took.append((time.thread_time_ns() - start) / 1e3)
            time.sleep(0.002)

    _live("model", body)
    print(_spread("calls: poll + command, CPU time", took, "us"), f"mean {statistics.mean(took):.1f} us")
    assert threading.active_count() == 1


def _named(error: DriveError, port: str) -> None:
    if port not in str(error):
        raise AssertionError(f"does not name its port: {error}")


@app.command()
def fuzz(seconds: int = 60) -> None:
    """Coverage-guided fuzzing of the host's parser and drive (needs atheris: `pip install atheris`).

    Whatever bytes a controller sends, in whatever pieces: no exception but DriveError, never armed without arm().
    """
    try:
        atheris: Any = importlib.import_module("atheris")
    except ImportError:
        print("atheris is not installed: pip install atheris", file=sys.stderr)
        raise typer.Exit(1) from None
    for owner in (wire, wire.Splitter, PicSerialDrive):
        for function in vars(owner).values():
            if inspect.isfunction(function) and function.__module__.startswith("chairward_drive_pic_serial"):
                function.__code__ = atheris.instrument_func(function).__code__
    master, slave = os.openpty()
    os.set_blocking(master, False)
    settings = PicSerialSettings(port=os.ttyname(slave))

    def one(data: bytes) -> None:
        provider = atheris.FuzzedDataProvider(data)
        drive, now = PicSerialDrive(settings), 1_000_000_000
        try:
            drive.connect(now)
            while provider.remaining_bytes():
                raw = provider.ConsumeBytes(provider.ConsumeIntInRange(1, 24))
                if provider.ConsumeBool():  # a sound frame around what was found
                    raw = wire.encode(raw[:10])
                os.write(master, raw)
                now += 7_000_000
                try:
                    assert not drive.poll(now).armed
                    drive.command(now, Motion(100.0, 0.0))
                except DriveError as error:
                    _named(error, settings.port)
                for payload in wire.Splitter().feed(raw):
                    assert describe(payload)
                try:
                    os.read(master, 65536)
                except BlockingIOError:
                    continue
        except DriveError as error:
            _named(error, settings.port)
        finally:
            drive.close()

    atheris.Setup([sys.argv[0], f"-max_total_time={seconds}", "-max_len=400"], one)
    atheris.Fuzz()


if __name__ == "__main__":
    app()

"""A simulated PIC in a process of its own, which outlives any run and whose cable can be pulled while it goes on.

    python controller.py FOLDER        SIGUSR1 pulls the cable, SIGUSR2 puts it back, SIGTERM ends it

Its port is FOLDER/pic, its pins are in FOLDER/pins, stamped by itself; so is when the drive motor went off.
"""

from __future__ import annotations

import contextlib
import os
import select
import signal
import sys
import time
from pathlib import Path

from chairward.shared_state import SharedState
from chairward_drive_pic_serial.engine import ModelEngine
from chairward_drive_pic_serial.sim_pic import PRIORITY, PtyEnd

NAMES = ("time_ns", "off_ns", "drive_duty", "drive_in1", "drive_in2", "brake")
STEP_S = 0.001


def main(folder: Path) -> None:
    """Carry bytes between pty and firmware model in real time."""
    asked: list[signal.Signals] = []
    for number in (signal.SIGUSR1, signal.SIGUSR2, signal.SIGTERM):
        signal.signal(number, lambda n, _: asked.append(signal.Signals(n)))
    with contextlib.suppress(PermissionError):
        os.sched_setscheduler(0, os.SCHED_FIFO, os.sched_param(PRIORITY))  # no chip waits for other programs
    engine, pins = ModelEngine(), SharedState.create(folder / "pins", NAMES)
    pty: PtyEnd | None = PtyEnd(folder / "pic")
    then = off_ns = time.monotonic_ns()
    drove = False
    while signal.SIGTERM not in asked:
        if asked and pty is not None and asked[0] is signal.SIGUSR1:
            pty.close()
            pty = None
        elif asked and pty is None and asked[0] is signal.SIGUSR2:
            pty = PtyEnd(folder / "pic")
        del asked[:1]
        readable, _, _ = select.select([] if pty is None else [pty.fd], [], [], STEP_S)
        now = time.monotonic_ns()
        engine.advance((now - then) / 1000)
        then = now
        if pty is not None and readable:
            engine.feed(pty.read())
        if (data := engine.take()) and pty is not None:
            pty.write(data)
        out = engine.pins()
        drives = out.drive_duty > 0.0 and out.drive_in1 != out.drive_in2 and not out.brake
        off_ns = now if drove and not drives else off_ns
        drove = drives
        pins.write(
            time_ns=now,
            off_ns=off_ns,
            drive_duty=out.drive_duty,
            drive_in1=out.drive_in1,
            drive_in2=out.drive_in2,
            brake=out.brake,
        )
    if pty is not None:
        pty.close()


if __name__ == "__main__":
    main(Path(sys.argv[1]))

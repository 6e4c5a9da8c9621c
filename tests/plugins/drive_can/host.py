"""A guard in miniature, as a process that can be killed: connects, arms, drives; says "driving" when it does.

Arguments: the adapter's port, the takeover. Arms again and again until SIGUSR1: a busy machine may hold it up so long
that the chair has stopped it before it drove.
"""

from __future__ import annotations

import select
import signal
import sys
import time
from pathlib import Path

from chairward.components import STILL, DriveError, Motion
from chairward_drive_can.make import make
from chairward_drive_can.settings import CanSettings
from chairward_drive_can.takeover import MODES


def main(port: str, takeover: str) -> None:
    settings = CanSettings.model_validate(
        {
            "dialect": "rnet",
            "interface": "slcan",
            "channel": port,
            "acknowledged": True,
            "silence_stop_ms": 200,
            "silence_stop_measured": "2026-11-22",
            "watchdog_relay": "K1",
            "accel_mm_s2": 0,  # a machine that holds it up must not keep it from ever getting to speed
            "rnet": {"takeover": takeover, "hazard_accepted": MODES[takeover].accept, "settle_ms": 300},
        }
    )
    drive = make(settings, Path())
    over: list[int] = []
    signal.signal(signal.SIGUSR1, lambda number, _: over.append(number))
    said, due = False, time.monotonic_ns()
    while True:
        waiting = [drive.fileno()] if drive.fileno() >= 0 else []
        select.select(waiting, [], [], max(0.0, (due - time.monotonic_ns()) / 1e9))
        now = time.monotonic_ns()
        try:
            status = drive.poll(now)
            if not status.linked and now >= due:
                drive.connect(now)
            if now < due:
                continue
            if status.linked and not (status.armed or over):
                drive.arm(now)
            if status.linked:
                drive.command(now, Motion(250.0, 0.0) if status.armed else STILL)
            if status.armed and not said:
                said = True
                sys.stdout.write("driving\n")
                sys.stdout.flush()
        except DriveError:
            pass  # as the guard does: it would say so, and goes on trying
        due = max(due + drive.period_ns, now - drive.period_ns)


if __name__ == "__main__":
    main(*sys.argv[1:])

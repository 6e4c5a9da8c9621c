"""Period of the R-Net joystick frames that the drive sends, as they arrive at the other end of an slcan adapter's pty.

    python benchmarks/rnet_period.py [--seconds 60] [--busy 2] [--no-fifo]   writes benchmarks/results/rnet_period.json

The sender is a guard's loop in a process of its own (takeover jsm_error: one frame a tick), with SCHED_FIFO and locked
memory where allowed; --busy starts that many processes that never rest. The receiver only stamps lines.
"""

from __future__ import annotations

import argparse
import contextlib
import multiprocessing
import select
import sys
import tempfile
import time
from itertools import pairwise
from pathlib import Path

from report import machine, save

from chairward import realtime
from chairward.components import STILL, DriveError, Motion
from chairward_drive_can import rnet
from chairward_drive_can.frames import Frame
from chairward_drive_can.make import make
from chairward_drive_can.partners.rnet import RnetChair
from chairward_drive_can.partners.run import AdapterPty, turn_round
from chairward_drive_can.settings import CanSettings
from chairward_drive_can.takeover import MODES

PERIOD_MS, TOLERANCE_MS = 10.0, 0.5


def never_rest() -> None:
    while True:
        sum(range(1000))


def send(port: str, seconds: float, fifo: bool) -> None:
    """The guard's loop, as short as it can be."""
    settings = CanSettings.model_validate(
        {
            "dialect": "rnet",
            "interface": "slcan",
            "channel": port,
            "acknowledged": True,
            "watchdog_relay": "bench",
            "rnet": {"takeover": "jsm_error", "hazard_accepted": MODES["jsm_error"].accept, "settle_ms": 300},
        }
    )
    drive = make(settings, Path())
    if fifo:
        granted = realtime.claim(50)
        for why in granted.why:
            sys.stderr.write(f"{why}\n")
    started = time.monotonic()
    sent_ns: list[int] = []
    due = time.monotonic_ns() + drive.period_ns
    while time.monotonic() - started < seconds + 1.0:
        waiting = [drive.fileno()] if drive.fileno() >= 0 else []
        select.select(waiting, [], [], max(0.0, (due - time.monotonic_ns()) / 1e9))
        now = time.monotonic_ns()
        status = drive.poll(now)
        if now < due:
            continue
        due += drive.period_ns * (1 + (now - due) // drive.period_ns)
        if not status.linked:
            drive.connect(now)
        elif not status.armed and time.monotonic() - started > 0.6:
            with contextlib.suppress(DriveError):  # the joystick must have rested long enough: tried again
                drive.arm(now)
        if status.linked:
            drive.command(now, Motion(100.0, 0.0) if status.armed else STILL)
            if status.armed:
                sent_ns.append(time.monotonic_ns())
    drive.close()
    Path(port).with_suffix(".sent").write_text(" ".join(map(str, sent_ns)))


class Stamps:
    """The simulated chair, writing down when each motion frame came."""

    def __init__(self) -> None:
        self.chair = RnetChair()
        self.body = self.chair.body
        self.moves_heard = 0
        self.at_ns: list[int] = []

    def hear(self, frame: Frame, now_ns: int) -> list[Frame]:
        event = rnet.decode(frame)
        if isinstance(event, rnet.Joystick) and event.y:
            self.at_ns.append(now_ns)
        return self.chair.hear(frame, now_ns)

    def tick(self, now_ns: int) -> list[Frame]:
        return self.chair.tick(now_ns)


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--seconds", type=float, default=60.0)
    parser.add_argument("--busy", type=int, default=2)
    parser.add_argument("--no-fifo", action="store_true")
    options = parser.parse_args()
    context = multiprocessing.get_context("spawn")
    with tempfile.TemporaryDirectory() as folder:
        end, stamps = AdapterPty(Path(folder) / "can"), Stamps()
        busy = [context.Process(target=never_rest, daemon=True) for _ in range(options.busy)]
        sender = context.Process(target=send, args=(f"{folder}/can", options.seconds, not options.no_fifo), daemon=True)
        for process in [*busy, sender]:
            process.start()
        if not options.no_fifo:
            realtime.claim(40)
        while sender.is_alive():
            select.select([end.fileno()], [], [], 0.002)
            turn_round(stamps, end, time.monotonic_ns())
        for process in busy:
            process.kill()
        end.close()
        sent_ns = [int(word) for word in Path(folder, "can.sent").read_text().split()]
    result = {
        "what": "gaps between two R-Net joystick frames, milliseconds; 10 is wanted",
        "busy_neighbours": options.busy,
        "sched_fifo": not options.no_fifo,
        "left_the_drive": told(sent_ns),
        "arrived_behind_the_pty": told(stamps.at_ns),
    }
    print(result)
    if not options.no_fifo:
        save("rnet_period", result | machine())
    return 0


def told(at_ns: list[int]) -> dict[str, float]:
    """Quantiles of the gaps, and how many of them are off."""
    gaps = sorted((then - now) / 1e6 for now, then in pairwise(at_ns))
    at = {"p1": 0.01, "p50": 0.5, "p99": 0.99, "p99_9": 0.999, "max": 1.0}
    quantiles = {name: round(gaps[int((len(gaps) - 1) * share)], 3) for name, share in at.items()}
    outside = sum(abs(gap - PERIOD_MS) > TOLERANCE_MS for gap in gaps)
    return {"n": len(gaps), **quantiles, "off_by_more_than_0.5_ms": outside}


if __name__ == "__main__":
    sys.exit(main())

"""Coverage-guided fuzzing of the host's frame parser, drive and monitor of the serial PIC.

    pip install atheris; python benchmarks/fuzz_pic.py [seconds]     writes benchmarks/results/fuzz_pic.json

Whatever bytes a controller sends, in whatever pieces: no exception but DriveError, which names its port; never armed
without arm(). Ends with an error at the first input that breaks one of these.
"""

from __future__ import annotations

import inspect
import os
import sys
from typing import Any

from fuzzing import fuzz

from chairward.components import DriveError, Motion
from chairward_drive_pic_serial import wire
from chairward_drive_pic_serial.describe import describe
from chairward_drive_pic_serial.drive import PicSerialDrive
from chairward_drive_pic_serial.settings import PicSerialSettings


def functions() -> list[Any]:
    """What is fuzzed."""
    found = [f for owner in (wire, wire.Splitter, PicSerialDrive) for f in vars(owner).values()]
    return [f for f in found if inspect.isfunction(f) and f.__module__.startswith("chairward_drive_pic_serial")]


def main() -> int:
    """Until the seconds are over."""
    master, slave = os.openpty()
    os.set_blocking(master, False)
    settings = PicSerialSettings(port=os.ttyname(slave))

    def one(_data: bytes, provider: Any) -> None:
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
                    named(error)
                for payload in wire.Splitter().feed(raw):
                    assert describe(payload)
                try:
                    os.read(master, 65536)
                except BlockingIOError:
                    continue
        except DriveError as error:
            named(error)
        finally:
            drive.close()

    def named(error: DriveError) -> None:
        assert settings.port in str(error), f"does not name its port: {error}"

    return fuzz("fuzz_pic", functions(), one, max_len=400)


if __name__ == "__main__":
    sys.exit(main())

"""`chairward run` in a process of its own, as people start it, with or without a terminal."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

from rig import PERSON, duty, outside


@dataclass(slots=True)
class Started:
    """A `chairward run` in a process of its own; terminal: the far end of its terminal, if it has one."""

    process: subprocess.Popen[bytes]
    terminal: int | None = None

    @property
    def pid(self) -> int:
        return self.process.pid

    @property
    def returncode(self) -> int | None:
        return self.process.returncode

    def poll(self) -> int | None:
        return self.process.poll()

    def wait(self, seconds: float) -> int:
        return self.process.wait(seconds)

    def send_signal(self, number: signal.Signals) -> None:
        self.process.send_signal(number)


@contextmanager
def chairward_run(folder: Path, *, terminal: bool = False, more: str = "") -> Iterator[Started]:
    """`chairward run` as people start it, driving the chair of `outside(folder)` and `more`; what is left is ended."""
    for name, text in (("chairs/zoo", outside(folder) + more), ("people/keeper", PERSON)):
        (folder / name).parent.mkdir(exist_ok=True)
        (folder / f"{name}.toml").write_text(text)
    (folder / "tmp").mkdir(exist_ok=True)
    command = [sys.executable, "-m", "chairward", "run", "--chair", "zoo", "--person", "keeper", "--no-record"]
    environment = {**os.environ, "CHAIRWARD_PROFILES": str(folder), "TMPDIR": str(folder / "tmp")}
    with (folder / "run.err").open("wb") as err:
        if terminal:
            far_end, near_end = os.openpty()
            take_terminal = [sys.executable, "-c", TAKE_TERMINAL]
            process = subprocess.Popen(
                [*take_terminal, *command], env=environment, stdin=near_end, stdout=near_end, stderr=near_end
            )
            os.close(near_end)
        else:
            process = subprocess.Popen([*command, "--headless"], env=environment, stdout=err, stderr=err)
    try:
        end = time.monotonic() + 90.0
        while duty(folder / "pins") == 0.0:
            assert process.poll() is None, (folder / "run.err").read_text()
            assert time.monotonic() < end, f"the chair does not drive: {(folder / 'run.err').read_text()}"
            time.sleep(0.002)
        yield Started(process, far_end if terminal else None)
    finally:
        process.kill()
        process.wait(10.0)


TAKE_TERMINAL = """
import fcntl, os, sys, termios
os.setsid()
fcntl.ioctl(0, termios.TIOCSCTTY, 0)
os.execv(sys.argv[1], sys.argv[1:])
"""
"""A shell's part: a session of its own whose terminal is standard input. When that is closed, SIGHUP comes."""


def processes_of(folder: Path) -> list[int]:
    """The processes whose command line names a folder."""
    found = []
    for path in Path("/proc").glob("[0-9]*/cmdline"):
        try:
            if str(folder).encode() in path.read_bytes():
                found.append(int(path.parent.name))
        except OSError:
            continue  # it has just ended
    return found

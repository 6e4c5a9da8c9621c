"""Starting and ending the processes of a run: each in a group of its own, what it says in a log file."""

from __future__ import annotations

import contextlib
import os
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from pathlib import Path

import msgspec

Process = subprocess.Popen[bytes]

BACK_OFF_S = (0.2, 0.5, 1.0, 2.0, 5.0)
FORGIVEN_S = 10.0
"""What has worked this long is started again after the shortest pause when it dies the next time."""
LOG_BYTES = 1_000_000
"""Of what a process says, the last of so much is kept, and what came after it; small, for it is copied in one go."""


@dataclass(slots=True)
class Restarted:
    """A process that is started again when it dies, after pauses that grow; restart_at_s: 0 while it runs."""

    process: Process
    started_s: float = field(default_factory=time.monotonic, kw_only=True)
    deaths: int = field(default=0, kw_only=True)
    deaths_in_a_row: int = field(default=0, kw_only=True)
    restart_at_s: float = field(default=0.0, kw_only=True)

    def end(self, now: float) -> float:
        """End it with all that it has started, if it still lives; returns the pause until it is to be started again."""
        kill_group(self.process)  # reaped by a later poll, never waited for
        if now - self.started_s > FORGIVEN_S:
            self.deaths_in_a_row = 0
        pause_s = BACK_OFF_S[min(self.deaths_in_a_row, len(BACK_OFF_S) - 1)]
        self.deaths += 1
        self.deaths_in_a_row += 1
        self.restart_at_s = now + pause_s
        return pause_s

    def may_start(self, now: float) -> bool:
        """Whether the pause is over and nothing is left of it."""
        return now >= self.restart_at_s and self.process.poll() is not None

    def runs_as(self, process: Process) -> None:
        """It has been started again."""
        self.process, self.started_s, self.restart_at_s = process, time.monotonic(), 0.0


def spawn(run_dir: Path, module: str, options: msgspec.Struct, name: str, fds: list[int]) -> Process:
    """A Python process that inherits these descriptors; what it says goes to run_dir/NAME.log."""
    with (run_dir / f"{name}.log").open("ab") as log_file:
        return subprocess.Popen(
            [sys.executable, "-m", module, msgspec.json.encode(options).decode()],
            pass_fds=fds,
            process_group=0,
            stdin=subprocess.DEVNULL,
            stdout=log_file,
            stderr=log_file,
            env={**os.environ, "OMP_NUM_THREADS": "1", "OPENBLAS_NUM_THREADS": "1", "NUMBA_NUM_THREADS": "1"},
        )


def bound_log(run_dir: Path, name: str) -> None:
    """Cut a log that has grown beyond LOG_BYTES: its end goes to NAME.old.log, and it begins anew.

    By copying, for its process holds the file open and appends to it. What it says meanwhile is lost.
    """
    path = run_dir / f"{name}.log"
    with contextlib.suppress(OSError):  # a log that cannot be cut is no reason to end a run
        if path.stat().st_size > LOG_BYTES:
            with path.open("r+b") as log_file:
                log_file.seek(-LOG_BYTES, os.SEEK_END)
                end = log_file.read(LOG_BYTES)
                log_file.truncate(0)
            (run_dir / f"{name}.old.log").write_bytes(end)


def plain(text: str) -> str:
    """What a plugin says, fit for a terminal: one line, with nothing that moves the cursor or clears the screen."""
    return "".join(letter if letter.isprintable() else " " for letter in text)


def last_words(run_dir: Path, name: str) -> str:
    """The last line a process wrote: usually the error that ended it."""
    for path in (run_dir / f"{name}.log", run_dir / f"{name}.old.log"):  # the first may just have been cut
        if path.exists():
            with path.open("rb") as log_file:
                log_file.seek(max(0, path.stat().st_size - 4096))
                lines = [line.strip() for line in log_file.read().decode(errors="replace").splitlines() if line.strip()]
            if lines:
                return lines[-1][:300]
    return "it said nothing"


def terminate(process: Process) -> None:
    """Ask it to leave."""
    if process.poll() is None:
        process.terminate()
        os.kill(process.pid, signal.SIGCONT)  # a stopped process could not leave


def kill_group(process: Process) -> None:
    """The process and all that it has started."""
    with contextlib.suppress(ProcessLookupError):
        os.killpg(process.pid, signal.SIGKILL)


def wait_all(processes: Mapping[str, Process], seconds: float, note: Callable[[str], None]) -> None:
    """Wait so long for all together; then end what is left of each, children included."""
    end = time.monotonic() + seconds
    for name, process in processes.items():
        try:
            process.wait(max(0.01, end - time.monotonic()))
        except subprocess.TimeoutExpired:
            note(f"{name} did not leave in time and was killed")
        kill_group(process)
        try:
            process.wait(1.0)
        except subprocess.TimeoutExpired:
            note(f"{name} cannot be ended: it waits for a device")


def end_of(process: Process, run_dir: Path, name: str) -> str:
    """How it ended, in words, and what it said last; "" while it lives."""
    code = process.poll()
    if code is None:
        return ""
    how = f"was killed by {signal.Signals(-code).name}" if code < 0 else f"ended with code {code}"
    return f"its process {how}: {last_words(run_dir, name)}"

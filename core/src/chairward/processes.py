"""Starting and ending the processes of a run: each in a group of its own, what it says in a log file."""

from __future__ import annotations

import contextlib
import os
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Mapping
from pathlib import Path

import msgspec

Process = subprocess.Popen[bytes]


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


def plain(text: str) -> str:
    """What a plugin says, fit for a terminal: one line, with nothing that moves the cursor or clears the screen."""
    return "".join(letter if letter.isprintable() else " " for letter in text)


def last_words(run_dir: Path, name: str) -> str:
    """The last line a process wrote: usually the error that ended it."""
    path = run_dir / f"{name}.log"
    if not path.exists():
        return "it said nothing"
    with path.open("rb") as log_file:
        log_file.seek(max(0, path.stat().st_size - 4096))
        lines = [line.strip() for line in log_file.read().decode(errors="replace").splitlines() if line.strip()]
    return lines[-1][:300] if lines else "it said nothing"


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


def how(code: int) -> str:
    """How a process ended, in words."""
    return f"was killed by {signal.Signals(-code).name}" if code < 0 else f"ended with code {code}"

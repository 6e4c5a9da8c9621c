"""Starting the companions of a run: stand-ins for the outside world, each a process, there before anything else."""

from __future__ import annotations

import os
import select
import time
from collections.abc import Callable
from pathlib import Path

from chairward.options import BesideOptions
from chairward.plan import Plan
from chairward.processes import Process, last_words, spawn

READY_S = 120.0


class RunError(RuntimeError):
    """The run cannot start or go on: one sentence that names what failed."""


def plan_file(run_dir: Path) -> Path:
    """Where the processes of a run read the plan."""
    return run_dir / "plan.json"


def start(plan: Plan, run_dir: Path, started: dict[str, Process], stopping: Callable[[], bool]) -> None:
    """Start all of the plan's (already written to `plan_file`) and wait until each is ready, or until `stopping`.

    Every process is in `started` as soon as it exists, also when this raises RunError.
    """
    waiting: dict[int, str] = {}
    for name in plan.companions:
        ours, theirs = os.pipe()
        options = BesideOptions(str(plan_file(run_dir)), str(run_dir), "companion", name, theirs)
        started[name] = spawn(run_dir, "chairward.beside", options, name, [theirs])
        os.close(theirs)
        waiting[ours] = name
    end = time.monotonic() + READY_S
    try:
        while waiting and not stopping():
            readable, _, _ = select.select(list(waiting), [], [], 0.1)
            for fd in readable:
                name = waiting.pop(fd)
                said = os.read(fd, 16)
                os.close(fd)
                if not said:
                    raise RunError(f"companion '{name}' could not start: {last_words(run_dir, name)}")
            if time.monotonic() > end:
                raise RunError(f"companion '{', '.join(waiting.values())}' was not ready within {READY_S:.0f} s")
    finally:
        for fd in waiting:
            os.close(fd)

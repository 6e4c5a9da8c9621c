"""What a process asks of the machine to be on time; each thing that is not permitted is told, never fatal."""

from __future__ import annotations

import contextlib
import ctypes
import gc
import os
import signal
import time
from collections.abc import Iterator
from dataclasses import dataclass

_MCL_CURRENT_AND_FUTURE = 3
_PR_SET_PDEATHSIG = 1


@dataclass(frozen=True, slots=True)
class Granted:
    """What the machine allowed; why: a sentence with the fix for each thing it did not."""

    fifo: bool
    memory_locked: bool
    why: tuple[str, ...]


def claim(priority: int = 50) -> Granted:
    """Ask for SCHED_FIFO and locked memory, and take the garbage collector under control."""
    why = []
    try:
        os.sched_setscheduler(0, os.SCHED_FIFO, os.sched_param(priority))
        fifo = True
    except OSError as error:
        fifo = False
        why.append(f"no real-time priority ({error.strerror}): allow it with 'rtprio 60' in /etc/security/limits.d")
    locked = ctypes.CDLL(None, use_errno=True).mlockall(_MCL_CURRENT_AND_FUTURE) == 0
    if not locked:
        why.append("memory is not locked: allow it with 'memlock unlimited' in /etc/security/limits.d")
    gc.collect()
    gc.freeze()
    gc.disable()
    return Granted(fifo, locked, tuple(why))


@contextlib.contextmanager
def a_little_ahead(priority: int = 10) -> Iterator[None]:
    """A low real-time priority for this thread, not for what it starts; where it is not permitted, none."""
    try:
        os.sched_setscheduler(0, os.SCHED_FIFO | os.SCHED_RESET_ON_FORK, os.sched_param(priority))
    except OSError:
        yield
        return
    try:
        yield
    finally:
        os.sched_setscheduler(0, os.SCHED_OTHER, os.sched_param(0))


def die_with_parent() -> None:
    """Let the kernel end this process when its parent dies (not for the guard: it must first stop the chair)."""
    ctypes.CDLL(None).prctl(_PR_SET_PDEATHSIG, signal.SIGKILL)


def suspended_ns() -> int:
    """How long this machine has been suspended since boot: CLOCK_BOOTTIME goes on, CLOCK_MONOTONIC does not."""
    return time.clock_gettime_ns(time.CLOCK_BOOTTIME) - time.clock_gettime_ns(time.CLOCK_MONOTONIC)

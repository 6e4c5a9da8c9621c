"""The processes that evaluate compute in one thread each, and none of them outlives the one that started it."""

from __future__ import annotations

import os
import subprocess
import sys

from chairward_voice_dtw.workers import THREADS, workers

STARTS_AND_WAITS = """
import os, sys, time
from chairward_voice_dtw.workers import workers
if __name__ == "__main__":
    with workers(1) as pool:
        print(pool.submit(os.getpid).result(), flush=True)
        time.sleep(600)
"""


def test_workers_compute_in_one_thread_and_leave_the_environment_as_it_was() -> None:
    before = dict(os.environ)
    with workers(1) as pool:
        assert [pool.submit(os.getenv, name).result() for name in THREADS] == ["1"] * len(THREADS)
    assert dict(os.environ) == before


def test_a_worker_ends_when_the_one_that_started_it_is_killed() -> None:
    with subprocess.Popen([sys.executable, "-c", STARTS_AND_WAITS], stdout=subprocess.PIPE, text=True) as process:
        assert process.stdout is not None
        assert int(process.stdout.readline()) != process.pid
        process.kill()
        # the worker holds the same standard output: it is at its end when nobody is left who could write to it
        assert process.stdout.read() == ""

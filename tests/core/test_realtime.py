"""What the machine does not permit is told with its fix, and is never fatal."""

from __future__ import annotations

import json
import os
import subprocess
import sys

from chairward.realtime import a_little_ahead

NOBODY = 65534
UNPRIVILEGED = f"""
import gc, json, os, resource
from chairward.realtime import a_little_ahead, claim

resource.setrlimit(resource.RLIMIT_RTPRIO, (0, 0))
resource.setrlimit(resource.RLIMIT_MEMLOCK, (0, 0))
if os.getuid() == 0:
    os.setuid({NOBODY})
with a_little_ahead():
    ahead = os.sched_getscheduler(0)
granted = claim()
print(json.dumps([granted.fifo, granted.memory_locked, granted.why, gc.isenabled(), ahead]))
"""


def test_a_machine_that_permits_nothing_says_what_to_permit_and_the_guard_goes_on() -> None:
    run = subprocess.run([sys.executable, "-c", UNPRIVILEGED], capture_output=True, text=True, timeout=60, check=False)
    assert run.returncode == 0, run.stderr
    fifo, locked, why, collects, ahead = json.loads(run.stdout)
    assert (fifo, locked, collects, ahead) == (False, False, False, os.SCHED_OTHER)
    assert len(why) == 2
    assert "no real-time priority" in why[0]
    assert "rtprio" in why[0]
    assert "memory is not locked" in why[1]
    assert "memlock" in why[1]


def test_what_is_started_from_a_process_that_is_a_little_ahead_is_not_ahead_and_afterwards_neither_is_it() -> None:
    with a_little_ahead():
        child = subprocess.run(
            [sys.executable, "-c", "import os; print(os.sched_getscheduler(0))"], capture_output=True, check=True
        )
    assert int(child.stdout) == os.SCHED_OTHER
    assert os.sched_getscheduler(0) == os.SCHED_OTHER

"""Processes beside the guard and the lanes: companions (stand-ins for the outside world) and observers.

Neither can hold the guard up: a companion never talks to it, an observer only gets copies that it may miss.
"""

from __future__ import annotations

import os
import signal
import sys
import threading
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import msgspec

from chairward import plan, wire
from chairward.components import Companion, Observer, Pose
from chairward.options import BesideOptions
from chairward.plugins import discover_only
from chairward.realtime import die_with_parent


def _companion(companion: Companion, ready_fd: int) -> int:
    stopping = threading.Event()
    signal.signal(signal.SIGTERM, lambda *_: stopping.set())
    companion.run(lambda: _say_ready(ready_fd), stopping.is_set)
    return 0


def _say_ready(fd: int) -> None:
    os.write(fd, b"ready\n")
    os.close(fd)


def _observer(observer: Observer, records_fd: int) -> int:
    signal.signal(signal.SIGTERM, signal.SIG_IGN)  # an observer ends when the guard's end of the line closes
    end = wire.adopt(records_fd)
    end.setblocking(True)
    try:
        while data := end.recv(wire.RECORD_BYTES):
            observer.observe(data)
    finally:
        observer.close()
    return 0


def main(argv: Sequence[str] | None = None) -> int:
    """The process of one companion or observer."""
    options = msgspec.json.decode((argv or sys.argv[1:])[0], type=BesideOptions)
    if options.kind == "companion":
        die_with_parent()  # an observer outlives a supervisor that crashed: the last second is what is wanted
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    the_plan = plan.read(Path(options.plan))
    run_dir = Path(options.run_dir)
    parts = the_plan.companions if options.kind == "companion" else the_plan.observers
    part = parts[options.name]
    component = discover_only([part.plugin]).get(options.kind, part.component)
    settings = component.settings.model_validate(plan.fill_run_dir(part.settings, run_dir))
    context = replace(the_plan.context(options.name, Pose(), run_dir), frames=options.rings)
    thing = component.make(settings, context)
    return _companion(thing, options.pipe) if options.kind == "companion" else _observer(thing, options.pipe)


if __name__ == "__main__":
    code = main()
    sys.stdout.flush()
    sys.stderr.flush()
    os._exit(code)  # everything is closed; the interpreter's own tear-down of compiled code takes seconds

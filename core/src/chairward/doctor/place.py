"""The process that makes the checks of one place, one after the other, and writes what they find as lines of JSON."""

from __future__ import annotations

import json
import os
import sys
from collections.abc import Sequence
from dataclasses import asdict
from pathlib import Path
from typing import Any

import msgspec

from chairward import plan as plans
from chairward.doctor.examine import Options, Task, site, tasks
from chairward.findings import Finding, Site, advised
from chairward.plugins import discover_only
from chairward.realtime import die_with_parent


def look(task: Task, where: Site) -> list[Finding]:
    """What one check finds; what it raises is a finding too, and so is that it found nothing wrong."""
    name = task.check.name
    try:
        found = list(task.check.look(where))
    except Exception as error:  # noqa: BLE001 - a third party's check may raise anything; the others go on
        text = str(error) or type(error).__name__
        report = "report this to whoever made that plugin"
        fix = f"see that it is there, and that [settings.{task.part.component}] is right" if task.part else report
        what, fix = advised(f"{task.place}: {text}", fix)
        return [Finding(name, False, what, fix)]
    return found or [Finding(name, True, f"{task.place}: nothing is wrong")]


def main(argv: Sequence[str] | None = None) -> int:
    """A place's process; for a lane or drive it imports only the plugins of that place."""
    options = msgspec.json.decode((argv or sys.argv[1:])[0], type=Options)
    die_with_parent()
    plan = plans.read(Path(options.plan)) if options.plan else None
    registry = discover_only(options.plugins)
    run_dir = Path(options.plan).parent if options.plan else Path()
    mine = [task for task in tasks(registry, plan) if task.place == options.place]

    def say(**fields: Any) -> None:
        os.write(options.pipe, json.dumps(fields).encode() + b"\n")

    for task in mine[options.done :]:
        say(begins=task.check.name, timeout_s=task.check.timeout_s)
        for finding in look(task, site(task, registry, plan, Path(options.root), run_dir)):
            say(**asdict(finding))
        say(ended=task.check.name)
    return 0


if __name__ == "__main__":
    code = main()
    sys.stdout.flush()
    sys.stderr.flush()
    os._exit(code)  # a device's driver must not keep the process that has said everything

"""The doctor, measured: how long an examination takes, which seeded faults it finds, and a healthy chair is left alone.

    .venv/bin/python benchmarks/doctor.py [--healthy 10] [--only PART]

Each time it is the whole examination that `chairward doctor --chair NAME` makes, every place of the chair in a process
of its own. The chair and its faults are those of tests/core/doctor; to root every file is open, so the rights to pass
permissions by are given up first. Writes benchmarks/results/doctor.json.
"""

from __future__ import annotations

import argparse
import ctypes
import json
import os
import platform
import re
import sys
import tempfile
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

ROOT = Path(__file__).resolve().parents[1]
sys.path.insert(0, str(ROOT / "tests" / "core" / "doctor"))

from doctor_controller import controller  # noqa: E402 - found where the line above says
from doctor_faults import FAULTS, everything  # noqa: E402
from doctor_world import World  # noqa: E402

from chairward.doctor import Finding  # noqa: E402
from chairward.doctor.examine import examine  # noqa: E402

RESULTS = Path(__file__).parent / "results" / "doctor.json"
SOON_S = 10.0
PR_CAPBSET_DROP, DAC_OVERRIDE, DAC_READ_SEARCH = 24, 1, 2


def examined(change: Callable[[World], None]) -> tuple[float, list[Finding]]:
    """Seconds, and what is wrong."""
    world = World()
    change(world)
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        chair = world.build(folder)
        with controller(world, folder):
            if world.locked:
                (folder / world.locked).chmod(0)
            began = time.perf_counter()
            found = list(examine(everything(), str(chair), str(folder / "people" / "me.toml")))
            return time.perf_counter() - began, [f for f in found if not f.ok]


def names_it(found: list[Finding], check: str, says: str) -> bool:
    """Whether the check that is for it has found it, in its own words."""
    return any(f.check in (check, check.split()[0]) and re.search(says, f"{f.what}: {f.fix}") for f in found)


def main() -> None:
    """Measure and write."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--healthy", type=int, default=10, help="so many examinations of the healthy chair")
    parser.add_argument("--only", default="", help="only faults whose name has this in it; writes nothing")
    given = parser.parse_args()
    if os.geteuid() == 0:
        for right in (DAC_OVERRIDE, DAC_READ_SEARCH):
            ctypes.CDLL(None).prctl(PR_CAPBSET_DROP, right, 0, 0, 0)
    everything()
    healthy = [examined(lambda _: None) for _ in range(given.healthy)]
    faults: dict[str, Any] = {}
    for name, (change, check, says) in FAULTS.items():
        if given.only in name:
            seconds, found = examined(change)
            faults[name] = {"found": names_it(found, check, says), "seconds": round(seconds, 1)}
            print(name, faults[name], flush=True)
    soon = sum(one["found"] and one["seconds"] < SOON_S for one in faults.values())
    result = {
        "what": "whole examinations of a chair by the doctor, each place in a process of its own",
        "python": platform.python_version(),
        "cpus": os.cpu_count(),
        "load_1min": round(os.getloadavg()[0], 2),
        "healthy": {
            "examinations": len(healthy),
            "with_a_finding": sum(any(f.needed for f in found) for _, found in healthy),
            "findings": sorted({f.what for _, found in healthy for f in found}),
            "seconds": sorted(round(seconds, 1) for seconds, _ in healthy),
        },
        "faults": len(faults),
        "found": sum(one["found"] for one in faults.values()),
        "found_within_10_s": soon,
        "found_within_10_s_percent": round(100.0 * soon / max(1, len(faults)), 1),
        "each": faults,
    }
    text = json.dumps(result, indent=1)
    if not given.only:
        RESULTS.write_text(text + "\n")
    print(text)


if __name__ == "__main__":
    main()

"""The guard's figures: tick lateness, message sent to command written, with and without busy neighbours.

    ./run python benchmarks/guard.py [--seconds 60] [--neighbours 0,2,4] [--out benchmarks/results/guard.json]

Real processes: zoo citizens as lanes (tests/safety/zoo), the real serial drive, a simulated PIC. Percentiles only.
"""

from __future__ import annotations

import argparse
import json
import multiprocessing
import platform
import sys
import tempfile
import time
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
sys.path[:0] = [str(ROOT / "tests" / "safety"), str(ROOT / "tests" / "safety" / "zoo")]

from chairward.durations import percentiles_ms  # noqa: E402


def busy() -> None:
    """A neighbour that never rests."""
    while True:
        sum(i * i for i in range(10_000))


def measure(folder: Path, seconds: float, neighbours: int) -> dict[str, object]:
    """Drive for a while with so many busy neighbours."""
    from rig import load, running

    hogs = [multiprocessing.Process(target=busy, daemon=True) for _ in range(neighbours)]
    with running(load(folder), folder / f"run-{neighbours}") as rig:
        for hog in hogs:
            hog.start()
        began = rig.records[-1].facts.now_ns
        time.sleep(seconds)
        records = [r for r in list(rig.records) if r.facts.now_ns > began]
        up = rig.supervisor.up
        for hog in hogs:
            hog.terminate()
            hog.join()
    sent, wire = 0, []
    for record in records:
        if record.newest_sent_ns > sent:
            sent = record.newest_sent_ns
            wire.append(record.wrote_ns - sent)
    return {
        "neighbours": neighbours,
        "seconds": seconds,
        "sched_fifo": bool(up and up.fifo),
        "memory_locked": bool(up and up.memory_locked),
        "tick_lateness_ms": percentiles_ms([r.woke_ns - r.due_ns for r in records if r.periodic]),
        "message_to_wire_ms": percentiles_ms(wire),
        "decide_and_write_ms": percentiles_ms([r.wrote_ns - r.woke_ns for r in records]),
    }


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--seconds", type=float, default=60.0)
    parser.add_argument("--neighbours", default="0,2,4")
    parser.add_argument("--out", type=Path, default=ROOT / "benchmarks" / "results" / "guard.json")
    options = parser.parse_args()
    import os

    import chairward_zoo

    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        os.environ["PYTHONPATH"] = str(chairward_zoo.install(folder / "zoo"))
        sys.path.insert(0, os.environ["PYTHONPATH"])
        rows = [measure(folder, options.seconds, int(n)) for n in options.neighbours.split(",")]
    result = {"python": platform.python_version(), "machine": platform.machine(), "cores": os.cpu_count(), "rows": rows}
    options.out.parent.mkdir(parents=True, exist_ok=True)
    options.out.write_text(json.dumps(result, indent=1) + "\n")
    print(json.dumps(result, indent=1))


if __name__ == "__main__":
    main()

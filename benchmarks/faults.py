"""Two hundred runs of each fault while a chair drives: how long until it is told to stop, or its wheels are off.

    .venv/bin/python benchmarks/faults.py [--runs 200] [--kinds lane_killed,can_silent] [--minutes 7]
    .venv/bin/python benchmarks/faults.py --report          writes benchmarks/results/faults.json from what there is,
                                                            other kinds keep their last result

Real processes in real time (the rig of tests/safety). Every run is kept in WORK as one line, so a call that ends after
--minutes is gone on with by the next. Bounds: "stop": a stop is commanded within the limit of what fell silent + 30 ms.
"off": the outputs at the controller's own pins are off within its time-out + 50 ms. "firmware": the same in the
firmware's own time, + 10 ms. What the processors gave to somebody else meanwhile (steal) is told of each outlier.
"""

from __future__ import annotations

import argparse
import contextlib
import json
import os
import platform
import sys
import tempfile
import time
from pathlib import Path
from typing import Any

from fault_kinds import RUNS, Sample

RESULTS = Path(__file__).parent / "results" / "faults.json"


def steal_ms() -> float:
    """What this virtual machine's processors gave to others since it started."""
    return float(Path("/proc/stat").read_text().split("\n", 1)[0].split()[8]) * 1_000.0 / os.sysconf("SC_CLK_TCK")


def kept(work: Path) -> list[Sample]:
    """The runs so far."""
    return [json.loads(line) for line in work.read_text().splitlines()] if work.exists() else []


def run(name: str, runs: int, until_s: float, work: Path) -> None:
    """Runs of one kind until there are enough, or the time is over."""
    missing = runs - sum(one["kind"] == name for one in kept(work))
    if missing <= 0 or time.monotonic() > until_s:
        return
    with tempfile.TemporaryDirectory() as folder, contextlib.closing(RUNS[name](Path(folder))) as samples:  # type: ignore[type-var]
        before = steal_ms()
        for one, _ in zip(samples, range(missing), strict=False):
            now = steal_ms()
            line = {"kind": name, **one, "steal_ms": now - before}
            before = now
            with work.open("a") as file:
                file.write(json.dumps(line) + "\n")
            print(line, flush=True) if one["ms"] > one["bound_ms"] else None
            if time.monotonic() > until_s:
                return


def report(samples: list[Sample]) -> dict[str, Any]:
    """By kind: how many, percentiles, and every run beyond its bound."""
    rows = {}
    for name in RUNS:
        mine = [one for one in samples if one["kind"] == name]
        times = sorted(one["ms"] for one in mine)
        if times:
            at = {"p50": 0.5, "p99": 0.99, "max": 1.0}
            rows[name] = {
                "runs": len(times),
                "bound_ms": sorted({one["bound_ms"] for one in mine}),
                **{key: times[int((len(times) - 1) * share)] for key, share in at.items()},
                "outliers": [one for one in mine if one["ms"] > one["bound_ms"]],
            }
    return rows


def main() -> None:
    """Run what is missing, or write the report."""
    import chairward_zoo

    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--runs", type=int, default=200)
    parser.add_argument("--kinds", default=",".join(RUNS))
    parser.add_argument("--minutes", type=float, default=7.0)
    parser.add_argument("--work", type=Path, default=Path(tempfile.gettempdir()) / "chairward-faults.jsonl")
    parser.add_argument("--report", action="store_true")
    options = parser.parse_args()
    if options.report:
        about = {"python": platform.python_version(), "cpus": os.cpu_count(), "what": " ".join(__doc__.split())}
        before = json.loads(RESULTS.read_text())["kinds"] if RESULTS.exists() else {}
        kinds = {**before, **report(kept(options.work))}
        runs, late = sum(row["runs"] for row in kinds.values()), sum(len(row["outliers"]) for row in kinds.values())
        RESULTS.write_text(json.dumps({**about, "runs": runs, "over_bound": late, "kinds": kinds}, indent=1) + "\n")
        return
    until_s = time.monotonic() + options.minutes * 60.0
    with tempfile.TemporaryDirectory() as folder:
        os.environ["PYTHONPATH"] = str(chairward_zoo.install(Path(folder)))
        sys.path.insert(0, folder)
        for name in options.kinds.split(","):
            run(name, options.runs, until_s, options.work)
    print(json.dumps(report(kept(options.work)), indent=1))


if __name__ == "__main__":
    main()

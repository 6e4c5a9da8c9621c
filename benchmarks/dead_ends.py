"""A thousand random dead ends: a way out is named within 5 s of a stop and leads out, or help is called.

    .venv/bin/python benchmarks/dead_ends.py [--number 1000] [--minutes 7]
    .venv/bin/python benchmarks/dead_ends.py --report        writes benchmarks/results/dead_ends.json from what there is

The chair of the shipped simulation (one camera pair) in all of them, a chair with sonars all round in every tenth
one too. Each ride is kept in WORK as one line, so a call that ends after --minutes is gone on with by the next.
Where somebody puts a box across the way back (`boxed_in`), there may be no way out: there help must be called.
"""

from __future__ import annotations

import argparse
import json
import os
import platform
import tempfile
import time
from collections import Counter
from dataclasses import asdict
from pathlib import Path
from random import Random
from typing import Any

from chairward.testing.dead_end_chair import CHAIRS
from chairward.testing.dead_ends import NAMED_WITHIN_NS, Escape

RESULTS = Path(__file__).parent / "results" / "dead_ends.json"
EVERY = {"camera": 1, "all round": 10}
"""Of which of the dead ends each chair takes part in."""


def kept(work: Path) -> list[dict[str, Any]]:
    """The rides so far."""
    return [json.loads(line) for line in work.read_text().splitlines()] if work.exists() else []


def ride(number: int, until_s: float, work: Path) -> None:
    """Those that are missing, until the time is over."""
    done = {(one["chair"], one["seed"]) for one in kept(work)}
    todo = [(chair, seed) for seed in range(number) for chair in CHAIRS if seed % EVERY[chair] == 0]
    for chair, seed in todo:
        if time.monotonic() > until_s:
            return
        if (chair, seed) not in done:
            outcome = Escape(Random(seed), chair).run()
            with work.open("a") as file:
                file.write(json.dumps({"chair": chair, "seed": seed, **asdict(outcome)}) + "\n")


def row(rides: list[dict[str, Any]]) -> dict[str, Any]:
    """What they came to."""
    times = sorted(one["seconds"] for one in rides)
    bad = [one for one in rides if not one["out"]]
    return {
        "dead_ends": len(rides),
        "way_named_within_5_s": sum(one["named_s"] * 1e9 <= NAMED_WITHIN_NS for one in rides),
        "longest_until_named_s": max((one["named_s"] for one in rides), default=0.0),
        "driven_out": len(rides) - len(bad),
        "driven_out_percent": round(100.0 * (len(rides) - len(bad)) / max(1, len(rides)), 1),
        "help_called": sum(one["helped"] for one in bad),
        "neither": sum(not one["helped"] for one in bad),
        "stopped_by": dict(Counter(one["stopped_by"] for one in rides)),
        "seconds_p50": times[len(times) // 2] if times else None,
        "touched_a_wall": sum(one["touched"] > 0 for one in rides),
    }


def report(rides: list[dict[str, Any]]) -> dict[str, Any]:
    """By chair, with and without somebody who blocks the way back; and every ride that ended with a call for help."""
    rows = {
        f"{chair}, {'the way back is blocked' if boxed else 'the way back is free'}": row(
            [one for one in rides if one["chair"] == chair and one["boxed_in"] == boxed]
        )
        for chair in CHAIRS
        for boxed in (False, True)
    }
    return {"rows": rows, "not_out": [one for one in rides if not one["out"] and not one["boxed_in"]]}


def main() -> None:
    """Ride, or write the report."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--number", type=int, default=1000)
    parser.add_argument("--minutes", type=float, default=7.0)
    parser.add_argument("--work", type=Path, default=Path(tempfile.gettempdir()) / "chairward-dead-ends.jsonl")
    parser.add_argument("--report", action="store_true")
    options = parser.parse_args()
    if options.report:
        about = {"python": platform.python_version(), "cpus": os.cpu_count(), "what": " ".join(__doc__.split())}
        RESULTS.write_text(json.dumps({**about, **report(kept(options.work))}, indent=1) + "\n")
        return
    ride(options.number, time.monotonic() + options.minutes * 60.0, options.work)
    print(json.dumps(report(kept(options.work)), indent=1))


if __name__ == "__main__":
    main()

"""The laws of both promises on a million random cases (the same code as in the tests, with plain random numbers).

    .venv/bin/python benchmarks/laws.py [--cases 1000000] [--minutes 60]        writes benchmarks/results/laws.json

A broken law ends it with the seed and everything that is needed to see why.
"""

from __future__ import annotations

import argparse
import json
import time
from multiprocessing import Pool
from pathlib import Path
from random import Random

from chairward.testing import laws

RESULTS = Path(__file__).parent / "results" / "laws.json"
CHUNK = 2_000


def chunk(first_seed: int) -> tuple[int, int, int]:
    """CHUNK cases of one step and CHUNK / 200 twin rides and random rides: (cases, moved, decisions of rides)."""
    moved = decisions = 0
    for seed in range(first_seed, first_seed + CHUNK):
        try:
            moved += laws.one_step(Random(seed))[2] != (0.0, 0.0)
            if seed % 200 == 0:
                laws.twin_rides(Random(seed), ticks=100)
                laws.random_ride(Random(seed), ticks=100)
                decisions += 300
        except laws.BrokenLaw as broken:
            raise laws.BrokenLaw(f"seed {seed}: {broken}") from broken
    return CHUNK, moved, decisions


def main() -> None:
    """Run, count, write."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--cases", type=int, default=1_000_000)
    parser.add_argument("--processes", type=int, default=None)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--minutes", type=float, default=60.0, help="no more cases after so long")
    options = parser.parse_args()
    begun = time.monotonic()
    seeds = range(options.seed, options.seed + options.cases, CHUNK)
    counts = [0, 0, 0]
    with Pool(options.processes) as pool:
        for judged in pool.imap_unordered(chunk, seeds):
            counts = [sum(pair) for pair in zip(counts, judged, strict=True)]
            if time.monotonic() - begun > 60.0 * options.minutes:
                break
    result = {
        "what": "random cases of the laws in chairward.testing.laws, none broken",
        "cases": counts[0],
        "of_them_moving": counts[1],
        "decisions_of_rides": counts[2],
        "first_seed": options.seed,
        "seconds": round(time.monotonic() - begun),
    }
    RESULTS.write_text(json.dumps(result, indent=1) + "\n")
    print(json.dumps(result, indent=1))


if __name__ == "__main__":
    main()

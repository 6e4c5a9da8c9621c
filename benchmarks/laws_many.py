"""Promise P2 for single decisions, by the hundred million: the same law as in laws.py, over arrays of cases.

    .venv/bin/python benchmarks/laws_many.py [--pairs 100000000] [--seed 0]     writes benchmarks/results/laws_many.json

`chairward.testing.many` says the rules a second time, for arrays; of every chair some rows go through `decide` as well,
and must come out the same. A broken law or a difference ends it with the seed and the row.
"""

from __future__ import annotations

import argparse
import json
import time
from multiprocessing import Pool
from pathlib import Path
from random import Random

import numpy as np

from chairward.arbiter import decide
from chairward.testing import cases, many
from chairward.testing.laws import must

RESULTS = Path(__file__).parent / "results" / "laws_many.json"
PAIRS_OF_A_CHAIR = 50_000
COMPARED_OF_A_CHAIR = 20


def chair(seed: int) -> tuple[int, int, int, int]:
    """One random chair: (pairs judged, of them moving, of them slowed by what is worse, rows compared)."""
    limits, rng = cases.some_limits(Random(seed)), np.random.default_rng(seed)
    facts = many.some(rng, limits, PAIRS_OF_A_CHAIR, trouble=float(rng.choice((0.05, 0.2, 0.4))))
    worse = many.worse(rng, facts)
    better_motion, worse_motion = many.motions(facts), many.motions(worse)
    holds = many.no_faster(worse_motion, better_motion, limits.steer_deg_s)
    must(bool(holds.all()), "P2", f"seed {seed}", f"row {np.argmin(holds)}")
    for row in range(COMPARED_OF_A_CHAIR):
        for array, motion in ((facts, better_motion), (worse, worse_motion)):
            _, decision = decide(*many.alone(array, row), array.limits)
            must(
                np.allclose(decision.motion, motion[row], rtol=0.0, atol=1e-9), "not the same", f"seed {seed} row {row}"
            )
    moves = (better_motion != 0.0).any(axis=1)
    slowed = (better_motion != worse_motion).any(axis=1)
    return PAIRS_OF_A_CHAIR, int(moves.sum()), int(slowed.sum()), 2 * COMPARED_OF_A_CHAIR


def main() -> None:
    """Run, count, write."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--pairs", type=int, default=100_000_000)
    parser.add_argument("--processes", type=int, default=None)
    parser.add_argument("--seed", type=int, default=0)
    options = parser.parse_args()
    begun, counts = time.monotonic(), [0, 0, 0, 0]
    with Pool(options.processes) as pool:
        for judged in pool.imap_unordered(chair, range(options.seed, options.seed + options.pairs // PAIRS_OF_A_CHAIR)):
            counts = [sum(pair) for pair in zip(counts, judged, strict=True)]
    result = {
        "what": "pairs of a case and a worse one, over arrays: none faster; no compared row different from decide()",
        **dict(zip(("pairs", "of_them_moving", "of_them_slowed", "rows_compared"), counts, strict=True)),
        "first_seed": options.seed,
        "seconds": round(time.monotonic() - begun),
    }
    RESULTS.write_text(json.dumps(result, indent=1) + "\n")
    print(json.dumps(result, indent=1))


if __name__ == "__main__":
    main()

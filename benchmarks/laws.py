"""The laws of both promises on a million random cases (the same code as in the tests, with plain random numbers).

    .venv/bin/python benchmarks/laws.py [--cases 1000000] [--minutes 60]        writes benchmarks/results/laws.json

A broken law ends it with the seed and everything that is needed to see why.
"""

from __future__ import annotations

from random import Random

from judging import judge

from chairward.testing import laws

CHUNK = 2_000


def chunk(first_seed: int) -> dict[str, int]:
    """CHUNK cases of one step and CHUNK / 200 twin rides and random rides: how many, and how many of them moved."""
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
    return {"cases": CHUNK, "of_them_moving": moved, "decisions_of_rides": decisions}


if __name__ == "__main__":
    what = "random cases of the laws in chairward.testing.laws, none broken"
    judge("laws", what, __doc__, chunk, cases="cases", number=1_000_000, at_once=CHUNK)

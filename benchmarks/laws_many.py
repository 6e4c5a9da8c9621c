"""Promise P2 by the hundred million: the laws `one_step` and `twin_rides` of laws.py, over arrays of cases.

    .venv/bin/python benchmarks/laws_many.py [--chairs 2000] [--minutes 60]  writes benchmarks/results/laws_many.json

`chairward.testing.many` says the rules a second time, for arrays; of every chair some rows go through `decide` as well,
and must come out the same. A broken law or a difference ends it with the seed and the row.
"""

from __future__ import annotations

from random import Random

import numpy as np
from judging import judge

from chairward.arbiter import decide
from chairward.facts import Limits
from chairward.testing import cases, many
from chairward.testing.laws import must
from chairward.testing.many_rides import twins

PAIRS, COMPARED = 50_000, 20
RIDES, TICKS = 500, 60


def chair(seed: int) -> dict[str, int]:
    """One random chair: what was judged, how much of it moved and was slowed by what is worse, and rows compared."""
    limits, rng = cases.some_limits(Random(seed)), np.random.default_rng(seed)
    better = many.some(rng, limits, PAIRS, trouble=float(rng.choice((0.05, 0.2, 0.4))))
    worse = many.worse(rng, better)
    motions = many.motions(better), many.motions(worse)
    no_faster(*motions, limits, seed)
    for row in range(COMPARED):
        decides_the_same(better, motions[0], row, seed)
        decides_the_same(worse, motions[1], row, seed)
    compared = 2 * COMPARED
    for nth, tick in enumerate(twins(rng, limits, RIDES, TICKS)):
        no_faster(tick.better_motion, tick.worse_motion, limits, seed)
        decides_the_same(tick.better, tick.better_motion, nth, seed)
        decides_the_same(tick.worse, tick.worse_motion, nth, seed)
        compared += 2
    return {
        "chairs": 1,
        "pairs": PAIRS,
        "of_them_moving": int((motions[0] != 0.0).any(axis=1).sum()),
        "of_them_slowed": int((motions[0] != motions[1]).any(axis=1).sum()),
        "rides_of_twins": RIDES,
        "decisions_of_rides": 2 * RIDES * TICKS,
        "rows_compared": compared,
    }


def no_faster(better: many.Floats, worse: many.Floats, limits: Limits, seed: int) -> None:
    """Raises BrokenLaw with the first row in which the worse case is faster."""
    holds = many.no_faster(worse, better, limits.steer_deg_s)
    must(bool(holds.all()), "P2: worse, and faster", f"seed {seed}", f"row {np.argmin(holds)}")


def decides_the_same(array: many.Many, motion: many.Floats, row: int, seed: int) -> None:
    """Raises BrokenLaw where decide() says something else of that row."""
    _, decision = decide(*many.alone(array, row), array.limits)
    same = bool(np.allclose(decision.motion, motion[row], rtol=0.0, atol=1e-9))
    must(same, "decide() says something else", f"seed {seed}", f"row {row}")


if __name__ == "__main__":
    what = "random chairs: a case and a worse one, and twins that ride: none faster, all compared rows as decide"
    judge("laws_many", what, __doc__, chair, cases="chairs", number=2_000)

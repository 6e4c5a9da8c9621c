"""Promise P2 over whole rides, for arrays of them: `laws.twin_rides` by the million decisions a second or so."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np

from chairward.facts import Limits, State
from chairward.testing.many import Floats, Many, motions, some, spent, worse
from chairward.testing.ride import driving

WISHES = (driving(), State(latch="", armed=True))
"""With a forward word, and without any."""
WORD, STOP = 0.15, 0.03
TROUBLE, WORSE = 0.1, 0.05
SHORT_GAPS = 4
"""The kinds of `worse` without the last: rule 6 cannot remember what was not seen (see laws.twin_rides)."""


@dataclass(frozen=True, slots=True)
class Tick:
    """One tick of N rides: what each of a pair of twins was shown, and what it did."""

    better: Many
    worse: Many
    better_motion: Floats
    worse_motion: Floats


def twins(rng: np.random.Generator, limits: Limits, rides: int, ticks: int) -> Iterator[Tick]:
    """Pairs that hear the same words and the same controller; what the second is shown is now and then worse."""
    live = np.zeros((2, rides), dtype=bool)
    output = np.zeros((2, rides, 2))
    for _ in range(ticks):
        facts = some(rng, limits, rides, trouble=rng.choice((0.0, 0.0, 0.0, TROUBLE)))
        facts = replace(facts, states=WISHES, gone=np.zeros_like(facts.gone))
        heard = rng.random(rides)
        live = (live | (heard < WORD)) & (heard < 1.0 - STOP)
        shown = (facts, worse(rng, facts, share=WORSE, kinds=SHORT_GAPS))
        better, other = (replace(one, wish=np.where(live[n], 0, 1), output=output[n]) for n, one in enumerate(shown))
        output = np.stack([motions(better), motions(other)])
        live &= ~np.stack([spent(better), spent(other)])
        yield Tick(better, other, output[0], output[1])

"""The reflex: a reading that leaves only one answer is answered before the reasons are worked out.

`decide` says the same a moment later, with everything that people should know. The law that it always does
(`chairward.testing.laws.judge`) is what makes this a shorter way to the same stop and not a second opinion.
"""

from __future__ import annotations

from itertools import chain

from chairward.facts import Facts, Limits, State


def reflex(state: State, facts: Facts, limits: Limits) -> bool:
    """Whether the chair drives towards something that a reading has at stop_mm or nearer: it stops (rule 2).

    Not when something has just been heard as well: what the person wants then is for `decide` to say.
    """
    if facts.heard:
        return False
    readings = chain.from_iterable(facts.ranges.values())
    if state.output.drive_mm_s > 0.0:
        towards = [reading.ahead_mm for reading in readings]
    elif state.output.drive_mm_s < 0.0:
        towards = [reading.behind_mm for reading in readings]
    else:
        return False
    return any(mm is not None and mm <= limits.stop_mm for mm in towards)

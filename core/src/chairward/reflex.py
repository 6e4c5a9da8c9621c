"""The reflex: a reading that leaves only one answer is answered before the reasons are worked out.

What makes it a shorter way to the same stop and not a second opinion: the decision that follows drives neither on nor
back, a law for every state (`chairward.testing.laws.judge`), and in every state that a drive comes to it says STILL,
turn included (`tests/safety/test_laws_of_any_drive.py`).
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

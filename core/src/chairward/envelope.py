"""The algebra of votes: the meet of caps, scaling a motion into them, and which votes bind.

`Caps` is the lattice element: four magnitudes. Merging is the component-wise minimum, so the order of the votes
does not matter and no vote can widen what another allows. A motion is scaled *as a whole* along its path:
clipping component by component would straighten a curve into the obstacle it goes round.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from enum import Enum, auto
from math import inf
from typing import NamedTuple

from chairward.components import STILL, Motion


class Caps(NamedTuple):
    """The most that is allowed each way: speeds in mm/s and deg/s, 0 (closed) to infinity (open)."""

    forward_mm_s: float = inf
    backward_mm_s: float = inf
    left_deg_s: float = inf
    right_deg_s: float = inf


OPEN = Caps()
CLOSED = Caps(0.0, 0.0, 0.0, 0.0)


class Grip(Enum):
    """What a vote does to the live wish when it closes the way that the wish wants."""

    WAITS = auto()
    """A short gap: the chair stops, the wish goes on when the gap ends within its lease."""
    SPENDS = auto()
    """A protective stop: the wish is spent, a new one moves the chair again."""
    LATCHES = auto()
    """A fault: the chair is latched until RESET, then ARM."""


class Envelope(NamedTuple):
    """A named vote: what `rule` allows because of `source`; `detail` is one short clause for people."""

    caps: Caps
    rule: str
    source: str = ""
    detail: str = ""
    grip: Grip = Grip.SPENDS


def meet(votes: Iterable[Envelope]) -> Caps:
    """The component-wise minimum of all votes; OPEN when there are none."""
    return Caps(*map(min, OPEN, OPEN, *[vote.caps for vote in votes]))  # twice: min() of one number is an error


def scale(motion: Motion, caps: Caps) -> float:
    """The largest s in 0..1 with s * motion inside caps."""
    drive, turn = motion
    forward, backward, left, right = caps
    s = 1.0
    if drive > forward:
        s = forward / drive
    if -drive > backward:
        s = backward / -drive
    if turn > left:
        s = min(s, left / turn)
    if -turn > right:
        s = min(s, right / -turn)
    return s


def fit(motion: Motion, caps: Caps) -> Motion:
    """The same path, slow enough for caps; STILL when a component that is wanted is closed."""
    s = scale(motion, caps)
    return Motion(motion.drive_mm_s * s, motion.turn_deg_s * s) if s else STILL


def binding(motion: Motion, votes: Sequence[Envelope]) -> tuple[Envelope, ...]:
    """The votes that alone would slow `motion` as much as all together do; none when nothing slows it."""
    scales = [scale(motion, vote.caps) for vote in votes]
    worst = min(scales, default=1.0)
    return tuple([vote for vote, s in zip(votes, scales, strict=True) if s <= worst]) if worst < 1.0 else ()

"""What another profile would have decided about a drive that was recorded.

The recorded facts are decided again under other limits, each decision from the state that the one before it left. The
chair would then have been elsewhere, and would have seen something else: so this says what would have been decided
*about what was seen*, not where the chair would have gone. It is exact up to the first difference.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, field
from typing import Any

from msgspec.structs import replace

from chairward.arbiter import decide
from chairward.chart import Bar, Line, chart
from chairward.components import STILL, Motion
from chairward.facts import Decision, Limits, S, Wish
from chairward.recording.readable import sentence
from chairward.records import Record

LONGEST_STEP_S = 0.5
"""A longer time between two records is a gap: what happened in it is not known."""
MOMENTS = 12


@dataclass(slots=True)
class Course:
    """What one profile makes of the drive. Speeds are commanded ones; bound_s: seconds by the rule that bound most."""

    name: str
    driven_m: float = 0.0
    moving_s: float = 0.0
    top_mm_s: float = 0.0
    stops: int = 0
    latched_s: float = 0.0
    bound_s: dict[str, float] = field(default_factory=dict)
    speeds: list[float] = field(default_factory=list)

    def add(self, decision: Decision, wish: Wish | None, dt_s: float) -> None:
        """One decision, in force for dt_s."""
        speed = decision.motion.drive_mm_s
        self.driven_m += abs(speed) * dt_s / 1000.0
        self.moving_s += dt_s * (decision.motion != STILL)
        self.top_mm_s = max(self.top_mm_s, abs(speed))
        self.stops += decision.protective_stop
        self.latched_s += dt_s * bool(decision.latch)
        if wish is not None and decision.reasons:
            rule = decision.reasons[0].rule
            self.bound_s[rule] = self.bound_s.get(rule, 0.0) + dt_s
        self.speeds.append(speed)


@dataclass(frozen=True, slots=True)
class Moment:
    """A moment at which the two part: from what both do to what one does differently."""

    at_s: float
    then: Motion
    now: Motion
    why: str


@dataclass(slots=True)
class Comparison:
    """Two profiles' courses over the same facts."""

    then: Course
    now: Course
    limits: Limits
    decisions: int = 0
    different: int = 0
    moments: list[Moment] = field(default_factory=list)
    times_s: list[float] = field(default_factory=list)
    nearest_mm: list[float | None] = field(default_factory=list)

    def rows(self) -> list[tuple[str, str, str]]:
        """What, then, now: the table."""
        names = ("driven_m", "moving_s", "top_mm_s", "stops", "latched_s")
        words = ("distance commanded, m", "moving, s", "top speed, mm/s", "protective stops", "latched, s")
        table = [
            (word, f"{getattr(self.then, name):.5g}", f"{getattr(self.now, name):.5g}")
            for word, name in zip(words, names, strict=True)
        ]
        for rule in sorted({*self.then.bound_s, *self.now.bound_s}):
            then, now = (course.bound_s.get(rule, 0.0) for course in (self.then, self.now))
            table.append((f"held back by {rule}, s", f"{then:.1f}", f"{now:.1f}"))
        return table

    def result(self) -> dict[str, Any]:
        """As JSON values."""
        return {
            "decisions": self.decisions,
            "different": self.different,
            "table": [{"what": what, self.then.name: then, self.now.name: now} for what, then, now in self.rows()],
            "moments": [
                {"at_s": m.at_s, self.then.name: m.then._asdict(), self.now.name: m.now._asdict(), "why": m.why}
                for m in self.moments
            ],
        }

    def picture(self) -> str:
        """Two charts above one another, as one SVG: commanded speed by both, and what was nearest."""
        speed = chart(
            "Forward speed that was commanded",
            "s",
            "mm/s",
            [Line(course.name, self.times_s, list(course.speeds)) for course in (self.then, self.now)],
        )
        bars = [Bar(f"stop_mm of {self.now.name}", float(self.limits.stop_mm))]
        near = chart("Nearest ahead, as it was seen", "s", "mm", [Line("nearest", self.times_s, self.nearest_mm)], bars)
        return stacked([speed, near])


def stacked(charts: list[str]) -> str:
    """Charts above one another in one SVG."""
    placed = [one.replace("<svg ", f'<svg y="{nth * 270}" width="900" height="260" ') for nth, one in enumerate(charts)]
    head = f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 900 {270 * len(charts)}">'
    return "\n".join([head, *placed, "</svg>"])


def compare(recorded: Iterable[Record], names: tuple[str, str], limits: Limits) -> Comparison:
    """Decide recorded facts under other limits; names: of the recorded and of the other profile."""
    found = Comparison(Course(names[0]), Course(names[1]), limits)
    state, began_ns, last_ns, apart = None, 0, 0, False
    for record in recorded:
        now_ns = record.facts.now_ns
        began_ns = began_ns or now_ns
        dt_s = min(LONGEST_STEP_S, (now_ns - last_ns) / S) if last_ns else 0.0
        last_ns = now_ns
        state, decision = decide(record.before if state is None else state, record.facts, limits)
        told = record.decision if record.told is None else replace(record.decision, motion=record.told)
        found.then.add(told, record.after.wish, dt_s)
        found.now.add(decision, state.wish, dt_s)
        found.decisions += 1
        differs = decision.motion != record.decision.motion
        found.different += differs
        at_s = round((now_ns - began_ns) / S, 2)
        if differs and not apart and len(found.moments) < MOMENTS:
            why = "; ".join(map(sentence, decision.reasons[:2])) or "nothing holds it back"
            found.moments.append(Moment(at_s, record.decision.motion, decision.motion, why))
        apart = differs
        found.times_s.append(at_s)
        found.nearest_mm.append(decision.nearest_mm if (decision.nearest_mm or 0) < 4000 else None)
    return found

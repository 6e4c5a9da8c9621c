"""From records to what a page shows: plain data, made once for all pages."""

from __future__ import annotations

from collections import deque
from dataclasses import dataclass, field
from itertools import chain
from typing import Any

from chairward.components import Context
from chairward.facts import MS, NOT_ARMED, Facts, Instruction, Limits, S
from chairward.messages import Alive
from chairward.plan import Plan
from chairward.records import Record

SIGNS = {
    Instruction.WAY_CLEAR: ("go", "circle", "way_clear"),
    Instruction.GO_STRAIGHT: ("go", "up", "go_straight"),
    Instruction.TURN_LEFT: ("warn", "left", "turn_left"),
    Instruction.TURN_RIGHT: ("warn", "right", "turn_right"),
    Instruction.STOP: ("stop", "octagon", "stop_now"),
}
"""Instruction -> colour class, shape, key of its words. Colour, shape and words always say the same."""
NO_NEWS_NS = 500 * MS
STANDING_MM_S, STANDING_DEG_S = 20.0, 2.0
KEPT_STOPS = 20


@dataclass(slots=True)
class View:
    """The newest record, and what must be remembered of older ones. One per server."""

    limits: Limits
    chair: str = ""
    person: str = ""
    language: str = "en"
    record: Record | None = None
    missed: int = 0
    _heard: dict[str, Any] | None = None
    _heard_ns: int = 0
    _refused: str = ""
    _helped_ns: int = 0
    _stops: deque[dict[str, Any]] = field(default_factory=lambda: deque(maxlen=KEPT_STOPS))

    @classmethod
    def of(cls, plan: Plan | None, context: Context) -> View:
        """Of a run's plan; without one, ages have no limits."""
        if plan is None:
            return cls(Limits(), person=context.person, language=context.language)
        return cls(plan.limits, chair=plan.chair, person=plan.person, language=plan.language)

    def add(self, record: Record) -> dict[str, Any] | None:
        """Take one record in; returns the stop, if this is where the chair stopped or latched."""
        now_ns, decision = record.facts.now_ns, record.decision
        self.missed += record.missed
        if record.facts.heard:
            wish = record.facts.heard[-1]
            word = {"word": wish.word, "command": wish.command.value, "confidence": round(wish.confidence, 2)}
            self._heard, self._heard_ns = {**word, "source": wish.source}, now_ns
        if record.facts.pressed:
            self._refused = next((note for note in decision.notes if " refused: " in note), "")
        if decision.help:
            self._helped_ns = now_ns
        latched = bool(decision.latch) and decision.latch not in (NOT_ARMED, record.before.latch)
        self.record = record
        if not decision.protective_stop and not latched:
            return None
        why = [_why(reason) for reason in decision.reasons if not latched or reason.rule != "latch"]
        stop = {"nearest_mm": decision.nearest_mm, "latch": decision.latch if latched else "", "reasons": why}
        self._stops.append({"at_ns": now_ns, **stop})
        return {"person": self.person, "chair": self.chair, **stop}

    def state(self, now_ns: int) -> dict[str, Any]:
        """All that pages show, as JSON data; ages in ms against now_ns (CLOCK_MONOTONIC)."""
        record = self.record
        base = {"chair": self.chair, "person": self.person, "language": self.language}
        if record is None:
            return {**base, **_sign(Instruction.STOP), "news": False, "age_ms": None}
        age_ns = now_ns - record.facts.now_ns
        news = age_ns <= NO_NEWS_NS
        facts, decision = record.facts, record.decision
        return {
            **base,
            **_sign(decision.instruction if news else Instruction.STOP),
            "news": news,
            "age_ms": age_ns // MS,
            "nearest_mm": decision.nearest_mm if news else None,
            "reasons": [_why(r) for r in decision.reasons],
            "open": [way.value for way in decision.open_ways] if news else [],
            "latch": "" if decision.latch == NOT_ARMED else decision.latch,
            "armed": not decision.latch and facts.drive.armed,
            "needs_reset": record.after.needs_reset,
            "remembers": any(near.gone for near in record.after.near.values()),
            "standing": _standing(record),
            "command": decision.command.value if decision.command else None,
            "lease_left_s": round(decision.lease_left_s, 2),
            "lease_s": self.limits.lease_s,
            "lease_warn_s": self.limits.lease_warn_s,
            "motion": {
                "speed_mm_s": round(_or(facts.drive.speed_mm_s, decision.motion.drive_mm_s)),
                "turn_deg_s": round(_or(facts.drive.turn_deg_s, decision.motion.turn_deg_s)),
            },
            "drive": {
                "linked": facts.drive.linked,
                "armed": facts.drive.armed,
                "fault": facts.drive.fault,
                "stopped_by_user": facts.drive.stopped_by_user,
                "charging": facts.drive.charging,
                "battery": facts.drive.battery,
            },
            "heard": {**self._heard, "age_ms": (now_ns - self._heard_ns) // MS} if self._heard else None,
            "help": now_ns - self._helped_ns < 5 * S if self._helped_ns else False,
            "refused": self._refused,
            "microphone": _microphone(facts),
            "sources": sources(facts, self.limits, now_ns),
            "stop_mm": self.limits.stop_mm,
            "avoid_mm": self.limits.avoid_mm,
            "stops": [{**s, "at_ns": None, "age_s": (now_ns - s["at_ns"]) // S} for s in self._stops],
            "missed": self.missed,
        }


def sources(facts: Facts, limits: Limits, now_ns: int) -> list[dict[str, Any]]:
    """Every required vote: how old its newest word is, the most it may be, and what is wrong with it."""
    rows = []
    ranges = {name: window[-1] for name, window in facts.ranges.items() if window}
    for name, need in chain(limits.sensors.items(), limits.vetoers.items()):
        said = ranges.get(name) or facts.vetoes.get(name)
        reason = "" if name not in ranges or ranges[name].can_see else ranges[name].reason
        ok = name not in ranges or ranges[name].can_see
        rows.append(_row(name, said.captured_ns if said else 0, need.freshness_ns, now_ns, reason, ok=ok))
    for name, need in {**limits.recognizers, **limits.stop_devices}.items():
        alive = facts.alive.get(name)
        at_ns = alive.captured_ns if alive else 0
        reason = alive.reason if alive else ""
        rows.append(_row(name, at_ns, need.freshness_ns, now_ns, reason, ok=alive is None or alive.well))
    rows.append(
        _row("drive", facts.drive.at_ns, limits.drive_freshness_ns, now_ns, facts.drive.fault, ok=not facts.drive.fault)
    )
    rows.append(_row("supervisor", facts.supervisor_ns, limits.supervisor_freshness_ns, now_ns, "", ok=True))
    for row in rows:
        row["reason"] = facts.lost.get(row["name"].partition("/")[0], row["reason"])
    return rows


def _row(name: str, at_ns: int, limit_ns: int, now_ns: int, reason: str, *, ok: bool) -> dict[str, Any]:
    age_ns = now_ns - at_ns if at_ns else None
    state = "silent" if age_ns is None or age_ns > limit_ns else "well" if ok else "ill"
    return {
        "name": name,
        "age_ms": None if age_ns is None else age_ns // MS,
        "limit_ms": limit_ns // MS,
        "state": state,
        "reason": reason,
    }


def _sign(instruction: str) -> dict[str, str]:
    colour, shape, words = SIGNS.get(instruction, SIGNS[Instruction.STOP])
    return {"colour": colour, "shape": shape, "instruction": words}


def _why(reason: Any) -> dict[str, str]:
    return {"rule": reason.rule, "source": reason.source, "detail": reason.detail}


def _or(measured: float | None, commanded: float) -> float:
    return commanded if measured is None else measured


def _standing(record: Record) -> bool:
    drive, motion = record.facts.drive, record.decision.motion
    still = motion.drive_mm_s == 0.0 and motion.turn_deg_s == 0.0
    return still and abs(drive.speed_mm_s or 0.0) < STANDING_MM_S and abs(drive.turn_deg_s or 0.0) < STANDING_DEG_S


def _microphone(facts: Facts) -> dict[str, Any] | None:
    heard = [alive for alive in facts.alive.values() if isinstance(alive, Alive) and alive.level_dbfs is not None]
    if not heard:
        return None
    return {"level_dbfs": heard[0].level_dbfs, "noise_dbfs": heard[0].noise_dbfs, "clipping": heard[0].clipping}

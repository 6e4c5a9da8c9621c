"""What a run came to: distance, commands, stops with reasons, nearest approach, latencies, lateness, dropped items.

Fed with every record; keeps figures, not records. Used by `chairward run` and `chairward demo`.
"""

from __future__ import annotations

import json
import statistics
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from chairward.components import STILL, Motion
from chairward.envelope import Caps
from chairward.facts import MS, Decision, Limits, S, Wish
from chairward.messages import Command, RangeReading
from chairward.records import Record

LATE_TICK_NS = 40 * MS
OBEY_WITHIN_NS = 3 * S


@dataclass(slots=True)
class Heard:
    """One command that was heard, and whether the chair then did it."""

    wish: Wish
    obeyed: bool = False


@dataclass(slots=True)
class Seen:
    """One reading of a sensor beside what the drive was told at that moment."""

    source: str
    captured_ns: int
    ahead_mm: int | None
    can_see: bool
    motion: Motion


@dataclass(slots=True)
class Summary:
    """Figures of a run so far."""

    limits: Limits
    began_ns: int = 0
    ended_ns: int = 0
    driven_mm: float = 0.0
    turned_deg: float = 0.0
    heard: list[Heard] = field(default_factory=list)
    stops: list[dict[str, Any]] = field(default_factory=list)
    latches: list[str] = field(default_factory=list)
    nearest_mm: int | None = None
    over_caps: int = 0
    ticks: int = 0
    late: list[dict[str, float]] = field(default_factory=list)
    lateness_ns: list[int] = field(default_factory=list)
    reaction_ns: list[int] = field(default_factory=list)
    frame_age_ns: list[int] = field(default_factory=list)
    missed_records: int = 0
    refused: dict[str, str] = field(default_factory=dict)
    refused_count: dict[str, int] = field(default_factory=dict)
    seen: list[Seen] = field(default_factory=list)
    last: Decision = field(default_factory=Decision)
    last_running: Decision = field(default_factory=Decision)
    _last_ns: int = 0
    _last_seq: dict[str, int] = field(default_factory=dict)
    _last_sent_ns: int = 0

    def add(self, record: Record) -> None:
        """Take one record in."""
        now = record.facts.now_ns
        self.began_ns = self.began_ns or now
        self.ended_ns = now
        self.missed_records += record.missed
        self._timing(record)
        self._moved(record, now)
        self._words(record, now)
        self._readings(record)
        decision = record.decision
        if decision.protective_stop:
            self.stops.append(
                {
                    "at_s": round((now - self.began_ns) / S, 2),
                    "nearest_mm": decision.nearest_mm,
                    "why": [" ".join(filter(None, (r.rule, r.source, r.detail))) for r in decision.reasons],
                }
            )
        if decision.latch and decision.latch != self.last.latch:
            self.latches.append(decision.latch)
        for source, sentence in record.facts.refused.items():
            self.refused[source] = sentence
            self.refused_count[source] = self.refused_count.get(source, 0) + 1
        self.last = decision
        if "supervisor" not in record.facts.lost:
            self.last_running = decision

    def _timing(self, record: Record) -> None:
        if record.periodic:
            self.ticks += 1
            lateness = record.woke_ns - record.due_ns
            self.lateness_ns.append(lateness)
            if lateness > LATE_TICK_NS:
                at_s = (record.woke_ns - self.began_ns) / S
                self.late.append({"at_s": round(at_s, 3), "late_ms": round(lateness / MS, 1)})
        if record.newest_sent_ns > self._last_sent_ns:
            self._last_sent_ns = record.newest_sent_ns
            self.reaction_ns.append(record.wrote_ns - record.newest_sent_ns)

    def _moved(self, record: Record, now: int) -> None:
        seconds = (now - self._last_ns) / S if self._last_ns else 0.0
        self._last_ns = now
        motion = record.decision.motion
        status = record.facts.drive
        speed = motion.drive_mm_s if status.speed_mm_s is None else status.speed_mm_s
        turn = motion.turn_deg_s if status.turn_deg_s is None else status.turn_deg_s
        self.driven_mm += abs(speed) * seconds
        self.turned_deg += abs(turn) * seconds
        near = record.decision.nearest_mm
        if near is not None and motion.drive_mm_s > 0.0 and (self.nearest_mm is None or near < self.nearest_mm):
            self.nearest_mm = near
        self.over_caps += not _inside(motion, self.limits.caps)

    def _words(self, record: Record, now: int) -> None:
        self.heard.extend(Heard(wish) for wish in record.facts.heard if not wish.held)
        motion = record.decision.motion
        for heard in self.heard[-4:]:
            if not heard.obeyed and now - heard.wish.at_ns <= OBEY_WITHIN_NS:
                heard.obeyed = _does(heard.wish, motion, record)

    def _readings(self, record: Record) -> None:
        for source, window in record.facts.ranges.items():
            newest = window[-1]
            if newest.seq != self._last_seq.get(source):
                self._last_seq[source] = newest.seq
                self.frame_age_ns.append(record.facts.now_ns - newest.captured_ns)
                self.seen.append(_seen(source, newest, record.decision.motion))

    def result(self) -> dict[str, Any]:
        """The figures as JSON values."""
        return {
            "seconds": round((self.ended_ns - self.began_ns) / S, 2),
            "driven_m": round(self.driven_mm / 1000.0, 2),
            "turned_deg": round(self.turned_deg, 0),
            "commands_heard": [
                {
                    "command": h.wish.command.value,
                    "word": h.wish.word,
                    "confidence": round(h.wish.confidence, 2),
                    "at_s": round((h.wish.at_ns - self.began_ns) / S, 2),
                    "obeyed": h.obeyed,
                }
                for h in self.heard
            ],
            "commands_obeyed": sorted({h.wish.command.value for h in self.heard if h.obeyed}),
            "protective_stops": self.stops,
            "reasons_at_end": [" ".join(filter(None, (r.rule, r.source, r.detail))) for r in self.last_running.reasons],
            "latched": self.latches,
            "nearest_while_driving_mm": self.nearest_mm,
            "over_caps": self.over_caps,
            "ticks": self.ticks,
            "late_ticks": len(self.late),
            "late_ticks_pct": round(100.0 * len(self.late) / max(1, self.ticks), 3),
            "late_tick_log": self.late[:100],
            "tick_lateness_ms": percentiles_ms(self.lateness_ns),
            "message_to_wire_ms": percentiles_ms(self.reaction_ns),
            "reading_age_ms": percentiles_ms(self.frame_age_ns),
            "readings": len(self.seen),
            "missed_records": self.missed_records,
            "refused_messages": {s: {"count": self.refused_count[s], "last": self.refused[s]} for s in self.refused},
        }


def _seen(source: str, reading: RangeReading, motion: Motion) -> Seen:
    return Seen(source, reading.captured_ns, reading.ahead_mm, reading.can_see, motion)


def _inside(motion: Motion, caps: Caps) -> bool:
    slack = 1e-6
    return (
        -caps.backward_mm_s - slack <= motion.drive_mm_s <= caps.forward_mm_s + slack
        and -caps.right_deg_s - slack <= motion.turn_deg_s <= caps.left_deg_s + slack
    )


def _does(wish: Wish, motion: Motion, record: Record) -> bool:
    """Whether this decision does what was wished."""
    match wish.command:
        case Command.STOP:
            return motion == STILL
        case Command.HELP:
            return record.decision.help
        case _ if record.after.wish is None or record.after.wish.seq != wish.seq:
            return False
        case Command.FRONT:
            return motion.drive_mm_s > 0.0
        case Command.BACK | Command.REVERSE:
            return motion.drive_mm_s < 0.0
        case Command.LEFT:
            return motion.turn_deg_s > 0.0
        case _:
            return motion.turn_deg_s < 0.0


def percentiles_ms(values_ns: Sequence[int]) -> dict[str, float] | None:
    """p50, p99, p99.9 and the largest, in milliseconds; None without values."""
    if not values_ns:
        return None
    ordered = sorted(values_ns)

    def at(share: float) -> float:
        return round(ordered[min(len(ordered) - 1, int(len(ordered) * share))] / MS, 3)

    return {"n": len(ordered), "p50": at(0.5), "p99": at(0.99), "p99_9": at(0.999), "max": at(1.0)}


# ---- what was seen beside what was there (file input) ------------------------------------------------------------


def against_truth(seen: Iterable[Seen], run_dir: Path) -> dict[str, Any]:
    """Distances seen against truth, by kind, from the truth files that recorded sources leave in the run's folder."""
    truth = _truth_rows(run_dir)
    if not truth:
        return {}
    by_source: dict[str, dict[str, list[tuple[dict[str, Any], Seen]]]] = {}
    for one in seen:
        row = truth.get((one.source.partition("/")[0], one.captured_ns))
        if row is not None:
            by_source.setdefault(one.source, {}).setdefault(str(row.get("kind", "")), []).append((row, one))
    return {
        source: {kind: _compare(pairs) for kind, pairs in kinds.items()} for source, kinds in sorted(by_source.items())
    }


def _truth_rows(run_dir: Path) -> dict[tuple[str, int], dict[str, Any]]:
    rows: dict[tuple[str, int], dict[str, Any]] = {}
    for path in sorted(run_dir.glob("*-truth.jsonl")):
        lane = path.name.removesuffix("-truth.jsonl")
        for line in path.read_text().splitlines():
            row = json.loads(line)
            if "truth_mm" in row:
                rows[lane, int(row["captured_ns"])] = row
    return rows


def _compare(pairs: Sequence[tuple[dict[str, Any], Seen]]) -> dict[str, Any]:
    known = [(float(r["truth_mm"]), s) for r, s in pairs if r["truth_mm"] is not None]
    errors = sorted(abs(s.ahead_mm - t) for t, s in known if s.can_see and s.ahead_mm is not None and s.ahead_mm < 5000)
    result: dict[str, Any] = {
        "frames": len(pairs),
        "with_truth": len(known),
        "blind": sum(not s.can_see for _, s in pairs),
        "measured": len(errors),
        "abs_error_median_mm": round(statistics.median(errors), 1) if errors else None,
        "abs_error_p95_mm": round(errors[int(0.95 * (len(errors) - 1))], 1) if errors else None,
    }
    first_near = next((i for i, (_, s) in enumerate(pairs) if s.ahead_mm is not None and s.ahead_mm <= 600), None)
    if first_near is not None:
        still = next((i for i in range(first_near, len(pairs)) if pairs[i][1].motion.drive_mm_s <= 0.0), None)
        result["frames_from_600_to_stop"] = None if still is None else still - first_near
        result["moving_before_600"] = any(s.motion.drive_mm_s > 0.0 for _, s in pairs[:first_near])
        result["truth_at_stop_mm"] = None if still is None else pairs[still][0]["truth_mm"]
    return result

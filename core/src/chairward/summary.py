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
from chairward.durations import Durations
from chairward.envelope import Caps
from chairward.facts import MS, Decision, Limits, S, Wish
from chairward.messages import NOTHING_NEAR_MM, Command, RangeReading
from chairward.records import Record

LATE_TICK_NS = 40 * MS
LATE_TICKS_LOGGED = 100
OBEY_WITHIN_NS = 3 * S
NEAR_MM = 1100.0
"""Errors of distance are told apart below this: there they decide."""


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
    """Figures of a run so far, in bounded memory however long it is (but for words and stops, one line each).

    keep_seen: keep every reading too, to hold it against the truth; for input from files, which ends.
    """

    limits: Limits
    keep_seen: bool = False
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
    late_ticks: int = 0
    late: list[dict[str, float]] = field(default_factory=list)
    lateness: Durations = field(default_factory=Durations)
    reaction: Durations = field(default_factory=Durations)
    frame_age: Durations = field(default_factory=Durations)
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
            times = record.facts.refusals.get(source, 1)
            self.refused_count[source] = self.refused_count.get(source, 0) + times
        self.last = decision
        if "supervisor" not in record.facts.lost:
            self.last_running = decision

    def _timing(self, record: Record) -> None:
        if record.periodic:
            self.ticks += 1
            lateness = record.woke_ns - record.due_ns
            self.lateness.add(lateness)
            if lateness > LATE_TICK_NS:
                self.late_ticks += 1
                if len(self.late) < LATE_TICKS_LOGGED:
                    at_s = (record.woke_ns - self.began_ns) / S
                    self.late.append({"at_s": round(at_s, 3), "late_ms": round(lateness / MS, 1)})
        if record.newest_sent_ns > self._last_sent_ns:
            self._last_sent_ns = record.newest_sent_ns
            self.reaction.add(record.wrote_ns - record.newest_sent_ns)

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
                self.frame_age.add(record.facts.now_ns - newest.captured_ns)
                if self.keep_seen:
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
            "late_ticks": self.late_ticks,
            "late_ticks_pct": round(100.0 * self.late_ticks / max(1, self.ticks), 3),
            "late_tick_log": self.late,
            "tick_lateness_ms": self.lateness.percentiles_ms(),
            "message_to_wire_ms": self.reaction.percentiles_ms(),
            "reading_age_ms": self.frame_age.percentiles_ms(),
            "readings": self.frame_age.n,
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


# ---- what was seen beside what was there (file input) ------------------------------------------------------------


def against_truth(seen: Iterable[Seen], run_dir: Path, events: list[str]) -> dict[str, Any]:
    """Distances seen against truth, by kind, from the truth files that recorded sources leave in the run's folder.

    What of them cannot be read is told in `events`.
    """
    truth = _truth_rows(run_dir, events)
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


def _quantile(values: Sequence[float], share: float) -> float | None:
    """The quantile (the middle one of two is their mean), to a tenth; None without values."""
    if not values:
        return None
    ordered = sorted(values)
    return round(statistics.median(ordered) if share == 0.5 else ordered[int(share * (len(ordered) - 1))], 1)


def _truth_rows(run_dir: Path, events: list[str]) -> dict[tuple[str, int], dict[str, Any]]:
    rows: dict[tuple[str, int], dict[str, Any]] = {}
    for path in sorted(run_dir.glob("*-truth.jsonl")):
        lane = path.name.removesuffix("-truth.jsonl")
        for nth, line in enumerate(path.read_text(errors="replace").splitlines(), start=1):
            try:
                row = json.loads(line)
                if "truth_mm" in row:
                    rows[lane, int(row["captured_ns"])] = row
            except (ValueError, TypeError, KeyError) as error:
                events.append(f"{path.name}: line {nth} cannot be read ({error}) and is left out")
    return rows


def _compare(pairs: Sequence[tuple[dict[str, Any], Seen]]) -> dict[str, Any]:
    known = [(float(r["truth_mm"]), s) for r, s in pairs if r["truth_mm"] is not None]
    seen = [(t, s.ahead_mm) for t, s in known if s.can_see and s.ahead_mm is not None and s.ahead_mm < NOTHING_NEAR_MM]
    errors = [abs(mm - t) for t, mm in seen]
    near = [abs(mm - t) for t, mm in seen if t <= NEAR_MM]
    result: dict[str, Any] = {
        "frames": len(pairs),
        "with_truth": len(known),
        "blind": sum(not s.can_see for _, s in pairs),
        "driven_forward": sum(s.motion.drive_mm_s > 0.0 for _, s in pairs),
        "nearest_seen_mm": min((s.ahead_mm for _, s in pairs if s.ahead_mm is not None), default=None),
        "measured": len(errors),
        "abs_error_median_mm": _quantile(errors, 0.5),
        "abs_error_p95_mm": _quantile(errors, 0.95),
        "measured_near": len(near),
        "near_error_median_mm": _quantile(near, 0.5),
        "near_error_p95_mm": _quantile(near, 0.95),
    }
    first_near = next((i for i, (_, s) in enumerate(pairs) if s.ahead_mm is not None and s.ahead_mm <= 600), None)
    if first_near is not None:
        still = next((i for i in range(first_near, len(pairs)) if pairs[i][1].motion.drive_mm_s <= 0.0), None)
        result["frames_from_600_to_stop"] = None if still is None else still - first_near
        result["moving_before_600"] = any(s.motion.drive_mm_s > 0.0 for _, s in pairs[:first_near])
        result["truth_at_stop_mm"] = None if still is None else pairs[still][0]["truth_mm"]
    return result

"""From one record to the readable messages of the topics."""

from __future__ import annotations

from collections.abc import Iterator
from math import inf

import msgspec
from msgspec import UNSET

from chairward.facts import MS, Why
from chairward.messages import RangeReading
from chairward.recording.topics import LOG, Asked, Decided, Driven, Log, Reading, Timing, time_of
from chairward.records import Record

INFO, WARNING, ERROR = 2, 3, 4


class Readable:
    """Makes the readable messages; remembers which readings and latches have been told already."""

    def __init__(self) -> None:
        self._seq: dict[str, int] = {}
        self._latch = ""
        self._sent_ns = 0

    def of(self, record: Record, at_ns: int) -> Iterator[tuple[str, msgspec.Struct]]:
        """(topic, message) of all that is new in a record; at_ns: of the decision, since 1970."""
        yield "chairward/decisions", _decided(record)
        yield "chairward/drive", _driven(record)
        yield "chairward/timings", self._timing(record)
        for source, window in record.facts.ranges.items():
            if window and window[-1].seq != self._seq.get(source):
                self._seq[source] = window[-1].seq
                yield "chairward/readings", _reading(source, window[-1], record.facts.now_ns)
        for wish in record.facts.heard:
            kind = "held" if wish.held else "word"
            yield (
                "chairward/asked",
                Asked(source=wish.source, kind=kind, what=wish.command, word=wish.word, confidence=wish.confidence),
            )
        for pressed in record.facts.pressed:
            yield (
                "chairward/asked",
                Asked(source=pressed.source, kind="button", what=pressed.button, word="", confidence=1.0),
            )
        for level, text in self._told(record):
            yield LOG, Log(timestamp=time_of(at_ns), level=level, message=text)

    def _timing(self, record: Record) -> Timing:
        sent, self._sent_ns = self._sent_ns, record.newest_sent_ns
        return Timing(
            tick=record.tick,
            periodic=record.periodic,
            late_ms=(record.woke_ns - record.due_ns) / MS,
            decided_ms=(record.wrote_ns - record.woke_ns) / MS,
            heard_ms=UNSET if record.newest_sent_ns <= sent else (record.wrote_ns - record.newest_sent_ns) / MS,
        )

    def _told(self, record: Record) -> Iterator[tuple[int, str]]:
        """What people should know, once."""
        decision = record.decision
        if record.missed:
            yield WARNING, f"{record.missed} decisions before this one were not recorded: the recorder was too slow"
        for note in decision.notes:
            yield INFO, note
        if decision.protective_stop:
            yield WARNING, f"protective stop: {'; '.join(map(sentence, decision.reasons))}"
        if decision.latch != self._latch:
            self._latch = decision.latch
            yield (ERROR, f"latched: {decision.latch}") if decision.latch else (INFO, "no longer latched")
        if decision.help:
            yield ERROR, "somebody calls for help"


def sentence(why: Why) -> str:
    """A reason in one line."""
    return " ".join(filter(None, (why.rule, why.source, why.detail)))


def _decided(record: Record) -> Decided:
    decision, told = record.decision, record.told
    forward, backward, left, right = (UNSET if cap == inf else cap for cap in decision.caps)
    return Decided(
        tick=record.tick,
        drive_mm_s=decision.motion.drive_mm_s,
        turn_deg_s=decision.motion.turn_deg_s,
        told_drive_mm_s=UNSET if told is None else told.drive_mm_s,
        told_turn_deg_s=UNSET if told is None else told.turn_deg_s,
        hard_stop=decision.hard_stop or record.told_hard,
        instruction=decision.instruction,
        nearest_mm=UNSET if decision.nearest_mm is None else decision.nearest_mm,
        most_forward_mm_s=forward,
        most_backward_mm_s=backward,
        most_left_deg_s=left,
        most_right_deg_s=right,
        command=decision.command or "",
        lease_left_s=decision.lease_left_s,
        protective_stop=decision.protective_stop,
        latch=decision.latch,
        open_ways=" ".join(decision.open_ways),
        reasons="; ".join(map(sentence, decision.reasons)),
    )


def _reading(source: str, reading: RangeReading, now_ns: int) -> Reading:
    ways = {
        key: UNSET if (mm := getattr(reading, key)) is None else mm
        for key in ("ahead_mm", "behind_mm", "left_mm", "right_mm")
    }
    return Reading(
        source=source,
        seq=reading.seq,
        age_ms=(now_ns - reading.captured_ns) / MS,
        can_see=reading.can_see,
        closing_mm_s=reading.closing_mm_s,
        coverage=reading.coverage,
        confidence=reading.confidence,
        reason=reading.reason,
        **ways,
    )


def _driven(record: Record) -> Driven:
    status = record.facts.drive
    return Driven(
        linked=status.linked,
        armed=status.armed,
        stopped_by_user=status.stopped_by_user,
        charging=status.charging,
        fault=status.fault,
        speed_mm_s=UNSET if status.speed_mm_s is None else status.speed_mm_s,
        turn_deg_s=UNSET if status.turn_deg_s is None else status.turn_deg_s,
        battery=UNSET if status.battery is None else status.battery,
        sent_frames=status.sent_frames,
        unanswered=status.unanswered,
        frame=record.frame.hex(),
    )

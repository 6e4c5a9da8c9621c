"""The border: every message of a lane is checked here before it becomes a fact.

Types, ranges and finiteness are checked by the decoder; here: size, whether this lane has such a stage, whether the
stage may send that, a rising sequence, a time that is not in the future. What fails is counted, named and treated
as silence: it never refreshes anything.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import TypeVar

import msgspec

from chairward.facts import MS, Facts, Pressed, Wish
from chairward.messages import (
    Alive,
    Command,
    DriveStatus,
    Ended,
    Intent,
    Lost,
    Parcel,
    Press,
    RangeReading,
    Report,
    Stick,
    Veto,
)
from chairward.plan import LanePlan
from chairward.wire import MAX_MESSAGE_BYTES, decode_parcel

FUTURE_LIMIT_NS = 5 * MS
WINDOW = 3
"""Readings kept of each sensor: the nearest of them is the whole debounce."""
HEARD_LIMIT = 16
"""Wishes and presses kept between two decisions; of more, a stop is never the one dropped."""


R = TypeVar("R", bound=Report)


class Refusal(ValueError):
    """A message that does not pass, with one sentence that names why."""


@dataclass(slots=True)
class Border:
    """Folds checked messages into the newest facts. One per guard; keeps no clock of its own."""

    lanes: Mapping[str, LanePlan]
    refused_count: dict[str, int] = field(default_factory=dict)
    newest_sent_ns: int = 0
    _ranges: dict[str, tuple[RangeReading, ...]] = field(default_factory=dict)
    _vetoes: dict[str, Veto] = field(default_factory=dict)
    _alive: dict[str, Alive] = field(default_factory=dict)
    _lost: dict[str, str] = field(default_factory=dict)
    _last_seq: dict[str, int] = field(default_factory=dict)
    _heard: list[Wish] = field(default_factory=list)
    _pressed: list[Pressed] = field(default_factory=list)
    _refused: dict[str, str] = field(default_factory=dict)
    _wishes: int = 0

    def take(self, lane: str, data: bytes, now_ns: int) -> None:
        """One raw message of a lane. What does not pass is noted, never raised."""
        source = lane
        try:
            if len(data) > MAX_MESSAGE_BYTES:
                raise Refusal(f"a message of more than {MAX_MESSAGE_BYTES} bytes")
            parcel = _decode(data)
            source = f"{lane}/{parcel.stage}"
            self._check(lane, source, parcel, now_ns)
            self._fold(lane, source, parcel.body, now_ns)
            self.newest_sent_ns = max(self.newest_sent_ns, min(parcel.sent_ns, now_ns))
        except Refusal as refusal:
            self.refused_count[source] = self.refused_count.get(source, 0) + 1
            self._refused[source] = str(refusal)

    def lane_lost(self, lane: str, reason: str) -> None:
        """The lane's socket closed or its process died: everything of it counts as lost, by name."""
        self._lost[lane] = reason

    def lane_attached(self, lane: str) -> None:
        """A new process serves the lane: its sequence starts anew; what the old one said stays until it is stale."""
        self._lost.pop(lane, None)
        for source in [s for s in self._last_seq if s.startswith(f"{lane}/")]:
            del self._last_seq[source]
            self._lost.pop(source, None)

    def facts(self, now_ns: int, drive: DriveStatus, supervisor_ns: int, gap_ns: int) -> Facts:
        """The facts at now_ns; what was heard, pressed and refused is handed over once."""
        facts = Facts(
            now_ns=now_ns,
            ranges=dict(self._ranges),
            vetoes=dict(self._vetoes),
            alive=dict(self._alive),
            lost=dict(self._lost),
            heard=tuple(self._heard),
            pressed=tuple(self._pressed),
            drive=drive,
            supervisor_ns=supervisor_ns,
            gap_ns=gap_ns,
            refused=dict(self._refused),
        )
        self._heard, self._pressed, self._refused = [], [], {}
        return facts

    def _check(self, lane: str, source: str, parcel: Parcel, now_ns: int) -> None:
        plan = self.lanes[lane]
        if parcel.stage != plan.source.component and all(parcel.stage != s.component for s in plan.stages):
            raise Refusal(f"lane '{lane}' has no stage '{parcel.stage}' in the chair file")
        report = parcel.body
        if report.captured_ns > now_ns + FUTURE_LIMIT_NS:
            raise Refusal(f"captured {(report.captured_ns - now_ns) / MS:.0f} ms in the future")
        if isinstance(report, Lost | Ended):
            return  # sent by the lane itself; they only ever take away
        last = self._last_seq.get(source, -1)
        if report.seq <= last:
            raise Refusal(f"sequence {report.seq} after {last}: must rise")
        if isinstance(report, Press) and report.button not in plan.may:
            raise Refusal(f"may not press {report.button.upper()}: the chair file's lane.{lane}.may does not say so")
        self._last_seq[source] = report.seq

    def _fold(self, lane: str, source: str, report: Report, now_ns: int) -> None:
        match report:
            case RangeReading():
                honest = _not_later_than(report, now_ns)
                self._ranges[source] = (*self._ranges.get(source, ())[1 - WINDOW :], honest)
            case Veto():
                self._vetoes[source] = _not_later_than(report, now_ns)
            case Alive():
                self._alive[source] = _not_later_than(report, now_ns)
            case Intent():
                self._wish(source, now_ns, report.command, report.word, report.confidence, report.held, None)
            case Stick():
                self._wish(source, now_ns, Command.FRONT, "", 1.0, True, (report.forward, report.left))
            case Press():
                if len(self._pressed) < HEARD_LIMIT or report.button == "stop":
                    self._pressed.append(Pressed(source=source, button=report.button, at_ns=now_ns))
            case Lost():
                self._lost[lane] = report.reason
                return
            case Ended():
                self._lost[lane] = "its input has ended"
                return
        self._lost.pop(lane, None)

    def _wish(
        self,
        source: str,
        now_ns: int,
        command: Command,
        word: str,
        confidence: float,
        held: bool,
        stick: tuple[float, float] | None,
    ) -> None:
        if len(self._heard) >= HEARD_LIMIT and command is not Command.STOP:
            return
        self._wishes += 1
        self._heard.append(
            Wish(
                source=source,
                seq=self._wishes,
                at_ns=now_ns,
                command=command,
                word=word,
                confidence=confidence,
                held=held,
                stick=stick,
            )
        )


def _decode(data: bytes) -> Parcel:
    try:
        return decode_parcel(data)
    except (msgspec.DecodeError, UnicodeDecodeError) as error:
        raise Refusal(f"not a valid message: {error}"[:180]) from error
    except RecursionError as error:
        raise Refusal("not a valid message: nested too deeply") from error


def _not_later_than(report: R, now_ns: int) -> R:
    """A claimed time in the (tolerated) future is arrival: an age is the larger of claimed and arrival age."""
    return report if report.captured_ns <= now_ns else msgspec.structs.replace(report, captured_ns=now_ns)

"""The border: every message of a lane is checked here before it becomes a fact.

Types, ranges and finiteness are checked by the decoder; here: size, whether this lane has such a stage, whether that
stage may wish or press, a rising sequence, a time that is neither in the future nor too long ago for a wish. What fails
is named and treated as silence: it never refreshes anything.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import TypeVar

import msgspec

from chairward.facts import MS, Facts, Limits, Pressed, S, Wish
from chairward.messages import (
    Alive,
    Button,
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
from chairward.rules import FUTURE_LIMIT_NS
from chairward.scene import WINDOW
from chairward.wire import MAX_MESSAGE_BYTES, decode_parcel

TOO_LATE_NS = 1_000 * MS
"""A word or press older than this when it arrives (its process hung) is not obeyed; STOP and HELP always are."""
CONFIRM_WITHIN_NS = 5_000 * MS
"""A spoken RESET that is not confirmed by a second word within this is forgotten."""
HEARD_LIMIT = 16
"""Wishes and presses kept between two decisions; of more, a stop or a call for help is never the one dropped."""


R = TypeVar("R", bound=Report)


class Refusal(ValueError):
    """A message that does not pass, with one sentence that names why."""


@dataclass(slots=True)
class Border:
    """Folds checked messages into the newest facts. One per guard; keeps no clock of its own."""

    lanes: Mapping[str, LanePlan]
    limits: Limits
    newest_sent_ns: int = 0
    _ranges: dict[str, tuple[RangeReading, ...]] = field(default_factory=dict)
    _vetoes: dict[str, Veto] = field(default_factory=dict)
    _alive: dict[str, Alive] = field(default_factory=dict)
    _lost: dict[str, str] = field(default_factory=dict)
    _awaited: dict[str, set[str]] = field(default_factory=dict)
    _last_seq: dict[str, int] = field(default_factory=dict)
    _heard: list[Wish] = field(default_factory=list)
    _pressed: list[Pressed] = field(default_factory=list)
    _refused: dict[str, str] = field(default_factory=dict)
    _refusals: dict[str, int] = field(default_factory=dict)
    _asked_ns: dict[str, int] = field(default_factory=dict)
    _wishes: int = 0

    def take(self, lane: str, data: bytes, now_ns: int) -> bool:
        """One raw message of a lane. What does not pass is noted, never raised.

        True where it should be decided upon at once. What takes nothing away can wait for the tick: a refusal, a
        heartbeat that is well, a reading in which nothing is nearer than before.
        """
        source = lane
        try:
            if len(data) > MAX_MESSAGE_BYTES:
                raise Refusal(f"a message of more than {MAX_MESSAGE_BYTES} bytes")
            parcel = _decode(data)
            plan = self.lanes[lane]
            if parcel.stage != plan.source.component and all(parcel.stage != s.component for s in plan.stages):
                raise Refusal(f"lane '{lane}' has no stage '{parcel.stage}' in the chair file")
            source = f"{lane}/{parcel.stage}"
            self._check(plan, source, parcel.body, now_ns)
            urgent = self._takes_away(source, parcel.body)
            self._fold(lane, source, parcel.body, now_ns)
            if urgent:
                self.newest_sent_ns = max(self.newest_sent_ns, min(parcel.sent_ns, now_ns))
            return urgent
        except Refusal as refusal:
            self._refused[source] = str(refusal)
            self._refusals[source] = self._refusals.get(source, 0) + 1
            return False

    def lane_lost(self, lane: str, reason: str) -> None:
        """The lane's device, line or process is gone: it counts as lost, by name, until all its votes speak again."""
        self._lost[lane] = reason
        limits = self.limits
        votes = {*limits.sensors, *limits.vetoers, *limits.recognizers, *limits.stop_devices}
        self._awaited[lane] = {source for source in votes if source.startswith(f"{lane}/")}

    def lane_attached(self, lane: str) -> None:
        """A new process serves the lane and counts from the beginning; it is lost until it has spoken itself.

        What the old one said of things that it has no vote about is forgotten: it would close all ways for ever.
        """
        self.lane_lost(lane, "its new process has said nothing yet")
        for said, votes in ((self._ranges, self.limits.sensors), (self._vetoes, self.limits.vetoers)):
            for source in [s for s in said if s.startswith(f"{lane}/") and s not in votes]:
                del said[source]
        for source in [s for s in self._last_seq if s.startswith(f"{lane}/")]:
            del self._last_seq[source]

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
            refused=self._refused,
            refusals=self._refusals,
        )
        self._heard, self._pressed, self._refused, self._refusals = [], [], {}, {}
        return facts

    def _check(self, plan: LanePlan, source: str, report: Report, now_ns: int) -> None:
        if report.captured_ns > now_ns + FUTURE_LIMIT_NS:
            raise Refusal(f"captured {(report.captured_ns - now_ns) / MS:.0f} ms in the future")
        if isinstance(report, Lost | Ended):
            return  # sent by the lane itself; they only ever take away
        last = self._last_seq.get(source, -1)
        if report.seq <= last:
            raise Refusal(f"sequence {report.seq} after {last}: must rise")
        if isinstance(report, Intent | Stick | Press) and not _always_counts(report):
            age_ns = now_ns - report.captured_ns
            if age_ns > TOO_LATE_NS:
                raise Refusal(f"said {age_ns / MS:.0f} ms ago: too late to be obeyed")
            if not isinstance(report, Press) and source not in self.limits.recognizers:
                raise Refusal("may not ask for motion: it is not a recognizer of the chair file")
        if isinstance(report, Intent) and report.command in (Command.RESET, Command.CONFIRM):
            self._check_spoken_reset(plan, source, report, now_ns)
        if isinstance(report, Press) and report.button not in plan.may:
            raise Refusal(
                f"may not press {report.button.upper()}: lane.{plan.name}.may in the chair file leaves it out"
            )
        self._last_seq[source] = report.seq

    def _check_spoken_reset(self, plan: LanePlan, source: str, word: Intent, now_ns: int) -> None:
        """RESET by word takes two words, in this order, from a lane that may press RESET; a held switch is no word."""
        if Button.RESET not in plan.may or word.held:
            raise Refusal(f"may not reset by word: lane.{plan.name}.may in the chair file leaves 'reset' out")
        asked_ns = self._asked_ns.get(source)
        if word.command is Command.CONFIRM and (asked_ns is None or now_ns - asked_ns > CONFIRM_WITHIN_NS):
            raise Refusal(f"nothing to confirm: say the word for 'reset' at most {CONFIRM_WITHIN_NS // S} s before")

    def _spoken_reset(self, plan: LanePlan, source: str, command: Command, now_ns: int) -> None:
        """RESET is remembered; CONFIRM after it presses RESET, and ARM where the lane may. Any other word undoes it."""
        asked = self._asked_ns.pop(source, None) is not None
        if command is Command.RESET:
            self._asked_ns[source] = now_ns
        elif command is Command.CONFIRM and asked:
            for button in (Button.RESET, Button.ARM):
                if button in plan.may:
                    self._pressed.append(Pressed(source=source, button=button, at_ns=now_ns))

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
                self._spoken_reset(self.lanes[lane], source, report.command, now_ns)
                at_ns = min(report.captured_ns, now_ns) if report.held else now_ns
                self._wish(source, at_ns, report.command, report.word, report.confidence, report.held)
            case Stick():
                stick = (report.forward, report.left)
                self._wish(source, min(report.captured_ns, now_ns), _stick_command(report), held=True, stick=stick)
            case Press():
                if len(self._pressed) < HEARD_LIMIT or report.button is Button.STOP:
                    at_ns = min(report.captured_ns, now_ns)
                    self._pressed.append(Pressed(source=source, button=report.button, at_ns=at_ns))
            case Lost():
                self.lane_lost(lane, report.reason)
                return
            case Ended():
                self.lane_lost(lane, "its input has ended")
                return
        if lane in self._lost:
            self._awaited[lane].discard(source)
            if not self._awaited[lane]:
                del self._lost[lane], self._awaited[lane]

    def _takes_away(self, source: str, report: Report) -> bool:
        """Whether the next decision could allow less because of it; a wish counts as such, for it may be a stop."""
        match report:
            case Alive(well=True) | Veto(stop=False):
                return False
            case RangeReading():
                window = self._ranges.get(source, ())
                return not window or _is_worse(report, window[-1])
            case _:
                return True

    def _wish(
        self,
        source: str,
        at_ns: int,
        command: Command,
        word: str = "",
        confidence: float = 1.0,
        held: bool = False,
        stick: tuple[float, float] | None = None,
    ) -> None:
        if len(self._heard) >= HEARD_LIMIT and command not in (Command.STOP, Command.HELP):
            return
        self._wishes += 1
        self._heard.append(
            Wish(
                source=source,
                seq=self._wishes,
                at_ns=at_ns,
                command=command,
                word=word,
                confidence=confidence,
                held=held,
                stick=stick,
            )
        )


def _stick_command(stick: Stick) -> Command:
    """The command that a stick's position amounts to; forward and back before the sides."""
    if stick.forward:
        return Command.FRONT if stick.forward > 0.0 else Command.BACK
    return Command.LEFT if stick.left >= 0.0 else Command.RIGHT


def _is_worse(new: RangeReading, old: RangeReading) -> bool:
    """Whether it cannot see, or anything in it is nearer, no longer told, or coming faster."""
    ways = (
        (new.ahead_mm, old.ahead_mm),
        (new.behind_mm, old.behind_mm),
        (new.left_mm, old.left_mm),
        (new.right_mm, old.right_mm),
    )
    nearer = any(was is None or now is None or now < was for now, was in ways if now != was)
    return nearer or not new.can_see or new.closing_mm_s > old.closing_mm_s


def _always_counts(report: Report) -> bool:
    match report:
        case Intent(command=Command.STOP | Command.HELP) | Press(button=Button.STOP):
            return True
        case _:
            return False


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

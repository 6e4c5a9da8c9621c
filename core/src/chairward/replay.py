"""Replay: decide again what was decided, from the recording alone, and compare bit for bit.

Each record holds state, facts and decision, and the file holds the plan with its limits, so nothing else is needed.
What is compared is the encoded record: there -0.0 is not 0.0, and a NaN is itself.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field, fields
from pathlib import Path
from typing import Any

import msgspec
from mcap.exceptions import McapError

from chairward import records
from chairward.arbiter import decide
from chairward.facts import Limits
from chairward.plan import Plan
from chairward.recording import PLAN_TOPIC, messages, read
from chairward.records import Record


@dataclass(frozen=True, slots=True)
class Difference:
    """One decision that came out differently; what: the first field that differs, with both values."""

    record: Record
    what: str


@dataclass(slots=True)
class Replayed:
    """What replay found. missing: ticks of which the recording holds no record, from the first record to the last."""

    decisions: int = 0
    missing: int = 0
    differences: list[Difference] = field(default_factory=list)


def read_plan(path: Path) -> Plan:
    """The plan of the run that was recorded. Raises OSError, and McapError when there is none or it cannot be read."""
    for data in messages(path, PLAN_TOPIC):
        try:
            return msgspec.json.decode(data, type=Plan)
        except (msgspec.DecodeError, UnicodeDecodeError) as error:
            raise McapError(
                f"{path}: its plan cannot be read ({error}); it is damaged, or of another version of chairward"
            ) from error
    raise McapError(f"{path}: holds no plan, so its limits are not known")


def replay(path: Path, limits: Limits) -> Replayed:
    """Decide every record again; and see whether each begins with the state that the one before it left.

    Raises OSError, McapError.
    """
    found, last = Replayed(), None
    for record in read(path):
        found.decisions += 1
        if last is not None:
            found.missing += max(0, record.tick - last.tick - 1)
        what = next(_differ(record, last, limits), "")
        if what:
            found.differences.append(Difference(record, what))
        last = record
    return found


def _differ(record: Record, last: Record | None, limits: Limits) -> Iterator[str]:
    """Sentences on what is not as it would be now: the decision, the state it left, the state it began with."""
    after, decision = decide(record.before, record.facts, limits)
    again = msgspec.structs.replace(record, after=after, decision=decision)
    if not _same(again, record):
        again = records.decode(records.encode(again))  # as if it had been recorded: 0 is then 0.0 where a float is due
        yield from _fields("decision", record.decision, again.decision)
        yield from _fields("state", record.after, again.after)
    if last is not None and record.tick == last.tick + 1:
        yield from _fields("state", last.after, record.before, f"was left, but tick {record.tick} began with")
    elif last is not None and record.tick <= last.tick:
        yield f"tick {record.tick} comes after tick {last.tick}"


def _fields(name: str, was: Any, now: Any, but: str = "was recorded, would be") -> Iterator[str]:
    for one in fields(was):
        a, b = getattr(was, one.name), getattr(now, one.name)
        if not _same(a, b):
            yield f"{name}.{one.name}: {a!r} {but} {b!r}"


def _same(a: object, b: object) -> bool:
    return msgspec.msgpack.encode(a) == msgspec.msgpack.encode(b)

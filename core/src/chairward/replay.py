"""Replay: decide again what was decided, from the recording alone, and compare bit for bit.

Each record holds state, facts and decision, and the file holds the plan with its limits, so nothing else is needed.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import msgspec
from mcap.exceptions import McapError
from mcap.records import Channel, Message
from mcap.stream_reader import StreamReader

from chairward.arbiter import decide
from chairward.facts import Limits
from chairward.plan import Plan
from chairward.recording import PLAN_TOPIC, read
from chairward.records import Record


@dataclass(frozen=True, slots=True)
class Difference:
    """One decision that came out differently; what: the first field that differs, with both values."""

    record: Record
    what: str


def read_plan(path: Path) -> Plan:
    """The plan of the run that was recorded. Raises OSError, McapError when there is none."""
    with path.open("rb") as file:
        plans = set()
        for item in StreamReader(file).records:
            if isinstance(item, Channel) and item.topic == PLAN_TOPIC:
                plans.add(item.id)
            elif isinstance(item, Message) and item.channel_id in plans:
                return msgspec.json.decode(item.data, type=Plan)
    raise McapError(f"{path}: holds no plan, so its limits are not known")


def differences(path: Path, limits: Limits) -> Iterator[Difference | None]:
    """For each record in order: None when it is decided the same again, else what differs."""
    for record in read(path):
        state, decision = decide(record.before, record.facts, limits)
        if (state, decision) == (record.after, record.decision):
            yield None
        else:
            yield Difference(record, _first_difference(record, state, decision))


def _first_difference(record: Record, state: object, decision: object) -> str:
    for name, was, now in (("decision", record.decision, decision), ("state", record.after, state)):
        for field in type(was).__dataclass_fields__:
            a, b = getattr(was, field), getattr(now, field)
            if a != b:
                return f"{name}.{field}: was {a!r}, would be {b!r}"
    return "nothing that is recorded"

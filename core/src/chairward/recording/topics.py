"""What a recording holds: topics, and the readable messages of each with their JSON schemas.

`chairward/records` is the whole truth (msgpack of `chairward.records.Record`), enough to decide everything again. All
other topics are made from it for people and their tools (Foxglove, PlotJuggler, a script): flat JSON objects with a
schema each. What is not known is left out, never null: those tools plot numbers. Log and pictures follow the schemas
of that name that Foxglove knows (https://docs.foxglove.dev/docs/sdk/schemas).
"""

from __future__ import annotations

import base64
from typing import Annotated, Any

import msgspec
from msgspec import UNSET, Meta, UnsetType

RECORDS = "chairward/records"
PLAN = "chairward/plan"
PINS = "chairward/pins"
LOG = "chairward/log"
PICTURES = "chairward/pictures"
"""Prefix: a topic each lane and pane, "chairward/pictures/front/left"."""

Number = float | UnsetType
Whole = int | UnsetType


class Decided(msgspec.Struct, kw_only=True):
    """One decision: what was decided, what the drive was told, and why."""

    tick: int
    drive_mm_s: float
    turn_deg_s: float
    told_drive_mm_s: Number = UNSET
    told_turn_deg_s: Number = UNSET
    hard_stop: bool
    instruction: str
    nearest_mm: Whole = UNSET
    most_forward_mm_s: Number = UNSET
    most_backward_mm_s: Number = UNSET
    most_left_deg_s: Number = UNSET
    most_right_deg_s: Number = UNSET
    command: str
    lease_left_s: float
    protective_stop: bool
    latch: str
    open_ways: str
    reasons: str


class Reading(msgspec.Struct, kw_only=True):
    """One reading of one sensor, at the first decision that knew it. age_ms: how old it was then."""

    source: str
    seq: int
    age_ms: float
    can_see: bool
    ahead_mm: Whole = UNSET
    behind_mm: Whole = UNSET
    left_mm: Whole = UNSET
    right_mm: Whole = UNSET
    closing_mm_s: int
    coverage: float
    confidence: float
    reason: str


class Asked(msgspec.Struct, kw_only=True):
    """Something that a person asked for: a word, a held switch or a button."""

    source: str
    kind: str
    what: str
    word: str
    confidence: float


class Driven(msgspec.Struct, kw_only=True):
    """What the controller last said, and what was last put on its wire (hexadecimal)."""

    linked: bool
    armed: bool
    stopped_by_user: bool
    charging: bool
    fault: str
    speed_mm_s: Number = UNSET
    turn_deg_s: Number = UNSET
    battery: Number = UNSET
    sent_frames: int
    unanswered: int
    frame: str


class Timing(msgspec.Struct, kw_only=True):
    """late_ms: how late the guard woke. decided_ms: from waking until the drive was told. heard_ms: how long before
    that the newest message of a lane had been sent."""

    tick: int
    periodic: bool
    late_ms: float
    decided_ms: float
    heard_ms: Number = UNSET


class Time(msgspec.Struct):
    """Since 1970, as Foxglove's schemas have it."""

    sec: Annotated[int, Meta(ge=0)]
    nsec: Annotated[int, Meta(ge=0, le=999_999_999)]


class Log(msgspec.Struct, kw_only=True):
    """foxglove.Log; level 2: info, 3: warning, 4: error."""

    timestamp: Time
    level: int
    message: str
    name: str = "chairward"
    file: str = ""
    line: int = 0


class Picture(msgspec.Struct, kw_only=True):
    """foxglove.CompressedImage; data: base64."""

    timestamp: Time
    frame_id: str
    data: Annotated[str, Meta(extra_json_schema={"contentEncoding": "base64"})]
    format: str = "png"


TOPICS: dict[str, tuple[str, type[msgspec.Struct]]] = {
    "chairward/decisions": ("chairward.Decided", Decided),
    "chairward/readings": ("chairward.Reading", Reading),
    "chairward/asked": ("chairward.Asked", Asked),
    "chairward/drive": ("chairward.Driven", Driven),
    "chairward/timings": ("chairward.Timing", Timing),
    LOG: ("foxglove.Log", Log),
    PICTURES: ("foxglove.CompressedImage", Picture),
}
"""Topic (or prefix of topics) -> name of its schema, and its messages."""


def schema(title: str, kind: type[msgspec.Struct]) -> bytes:
    """The JSON schema of a topic: self-contained, without references, which viewers do not follow."""
    parts = msgspec.json.schema(kind)["$defs"]

    def whole(part: Any) -> Any:
        if isinstance(part, dict):
            if "$ref" in part:
                return whole(parts[part["$ref"].rpartition("/")[2]])
            return {key: whole(value) for key, value in part.items()}
        return [whole(value) for value in part] if isinstance(part, list) else part

    return msgspec.json.encode({**whole(parts[kind.__name__]), "title": title})


def time_of(at_ns: int) -> Time:
    """Nanoseconds since 1970 as Foxglove's time."""
    return Time(*divmod(at_ns, 1_000_000_000))


def picture(png: bytes, at_ns: int, lane: str) -> Picture:
    """A picture as a message."""
    return Picture(timestamp=time_of(at_ns), frame_id=lane, data=base64.b64encode(png).decode())

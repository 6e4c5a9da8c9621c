"""The recorder: every decision in an MCAP file, each record self-contained, and reading them back.

An observer like any other, in a process of its own; what it missed is in the records themselves (`missed`).
MCAP chunks are written out every half second, so a power cut loses at most what came after the last one; a file
that was cut gives everything before the cut. Channel "records" holds msgpack of `chairward.records.Record`, channel
"decisions" the readable part as JSON for Foxglove and the like, and "pins" what the pins of a simulated controller were
at each decision (where there is one): what was decided beside what the wheels were really told.
"""

from __future__ import annotations

import struct
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import msgspec
import zstandard
from mcap.exceptions import InvalidMagic, McapError
from mcap.records import Channel, Message
from mcap.stream_reader import StreamReader
from mcap.writer import CompressionType, Writer
from pydantic import Field

from chairward import records
from chairward.components import Context, Settings
from chairward.records import Record
from chairward.shared_state import SharedState

FLUSH_S = 0.5
RECORDS_TOPIC = "chairward/records"
DECISIONS_TOPIC = "chairward/decisions"
PLAN_TOPIC = "chairward/plan"
PINS_TOPIC = "chairward/pins"
PINS_FILE = "pins"
"""Where a simulated controller publishes its pins, in the run's folder."""


class RecorderSettings(Settings):
    """Where the record goes."""

    path: Path = Field(description="the file to write; a relative path starts in the run's folder")


class Recorder:
    """Writes one file; `observe` is called with every encoded record."""

    def __init__(self, settings: RecorderSettings, context: Context) -> None:
        self._file = (context.run_dir / settings.path).open("wb")
        self._writer = Writer(self._file, chunk_size=256 * 1024, compression=CompressionType.ZSTD)
        self._writer.start(profile="chairward", library="chairward")
        self._records = self._writer.register_channel(RECORDS_TOPIC, "msgpack", 0)
        schema = self._writer.register_schema("chairward.Decision", "jsonschema", _decision_schema())
        self._decisions = self._writer.register_channel(DECISIONS_TOPIC, "json", schema)
        plan_channel = self._writer.register_channel(PLAN_TOPIC, "json", 0)
        self._pins_channel = self._writer.register_channel(PINS_TOPIC, "json", 0)
        self._pins_file = context.run_dir / PINS_FILE
        self._pins: SharedState | None = None
        now = time.time_ns()
        self._offset_ns = now - time.monotonic_ns()
        plan_file = context.run_dir / "plan.json"
        if plan_file.exists():
            self._writer.add_message(plan_channel, now, plan_file.read_bytes(), now)
        self._flushed_s = time.monotonic()

    def observe(self, record: bytes) -> None:
        """Write one record, and its readable part."""
        whole = records.decode(record)
        at = whole.facts.now_ns + self._offset_ns
        self._writer.add_message(self._records, at, record, at, whole.tick % 2**32)
        readable = {"tick": whole.tick, "drive": whole.facts.drive, "decision": whole.decision}
        self._writer.add_message(self._decisions, at, msgspec.json.encode(readable), at, whole.tick % 2**32)
        if (pins := self._read_pins()) is not None:
            self._writer.add_message(self._pins_channel, at, msgspec.json.encode(pins), at, whole.tick % 2**32)
        now = time.monotonic()
        if now - self._flushed_s >= FLUSH_S:
            self._flushed_s = now  # a flush ends the chunk: a file that is cut later can be read up to here
            self._writer.flush()  # type: ignore[no-untyped-call]
            self._file.flush()

    def _read_pins(self) -> dict[str, float] | None:
        """The simulated controller's pins now; None without one, or when it died in the middle of writing them."""
        if self._pins is None:
            if not self._pins_file.exists():
                return None
            self._pins = SharedState.attach(self._pins_file)
        try:
            return self._pins.read()
        except TimeoutError:
            return None

    def close(self) -> None:
        """Write the index and close."""
        if self._pins is not None:
            self._pins.close()
            self._pins = None
        if not self._file.closed:
            self._writer.finish()  # type: ignore[no-untyped-call]
            self._file.close()


def read(path: Path) -> Iterator[Record]:
    """The records of a file, in order; of a file that was cut, all before the cut.

    Raises OSError; McapError for what is no recording, and for a record that is whole but cannot be read.
    """
    for nth, data in enumerate(messages(path, RECORDS_TOPIC)):
        try:
            yield records.decode(data)
        except (msgspec.DecodeError, UnicodeDecodeError) as error:
            raise McapError(
                f"{path}: record {nth} cannot be read ({error}); it is damaged, or of another version of chairward"
            ) from error


def messages(path: Path, topic: str) -> Iterator[bytes]:
    """The messages of one topic, in order; of a file that was cut, all before the cut. Raises OSError, McapError."""
    with path.open("rb") as file:
        topics: dict[int, str] = {}
        try:
            for item in StreamReader(file).records:
                if isinstance(item, Channel):
                    topics[item.id] = item.topic
                elif isinstance(item, Message) and topics.get(item.channel_id) == topic:
                    yield item.data
        except InvalidMagic as error:
            raise McapError(f"{path}: not a recording ({error})") from error
        except (McapError, EOFError, ValueError, struct.error, zstandard.ZstdError):
            return  # the file was cut here


def _decision_schema() -> bytes:
    schema: dict[str, Any] = {
        "title": "chairward.Decision",
        "type": "object",
        "properties": {
            "tick": {"type": "integer"},
            "drive": {"type": "object"},
            "decision": {
                "type": "object",
                "properties": {
                    "motion": {"type": "array", "items": {"type": "number"}},
                    "instruction": {"type": "string"},
                    "nearest_mm": {"type": ["integer", "null"]},
                    "latch": {"type": "string"},
                },
            },
        },
    }
    return msgspec.json.encode(schema)

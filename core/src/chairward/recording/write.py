"""The recorder: every decision in MCAP files of bounded size.

An observer like any other, in a process of its own, so it can never hold the guard up; what it missed while it lived is
in the records themselves (`missed`), in the log of the recording and in the summary of the run. What was decided
between its death and its next start is in no part; only the numbers of the decisions (`tick`) tell how many those were.
A thread ends the chunk and has it written to the disk twice a second: a power cut loses at most the last second.
"""

from __future__ import annotations

import contextlib
import json
import os
import shutil
import threading
import time
from pathlib import Path
from typing import Annotated, BinaryIO

import msgspec
from mcap.writer import CompressionType, Writer
from pydantic import Field

from chairward import records
from chairward.components import Context, Settings
from chairward.profile.merge import Safer
from chairward.recording.pictures import Album, Keep
from chairward.recording.readable import Readable
from chairward.recording.topics import PICTURES, PINS, PLAN, RECORDS, TOPICS, picture, schema
from chairward.shared_state import SharedState

FLUSH_S = 0.5
TRY_AGAIN_S = 5.0
PINS_FILE = "pins"
"""Where a simulated controller publishes its pins, in the run's folder."""
MB = 1_000_000
LEAVE_FREE_BYTES = 200 * MB


class RecorderSettings(Settings):
    """Where the record goes, and how much of it is kept."""

    path: Path = Field(
        default=Path("recording.mcap"),
        description="the file to write; a relative path starts in the run's folder",
    )
    part_mb: int = Field(default=200, ge=1, le=10_000, description="a file of this size is followed by the next part")
    parts: int = Field(default=5, ge=2, le=1000, description="so many parts of one run are kept; the oldest go")
    pictures: Annotated[Keep, Safer.FREE] = Field(
        default=Keep.STOPS, description="never, stops (30 s round each protective stop), or always"
    )
    pictures_hz: float = Field(default=2.0, ge=0.2, le=30.0, description="pictures a second that are kept")
    panes: tuple[str, ...] = Field(default=("left",), description="of each lane, the panes that are kept")


class Part:
    """One MCAP file that is being written."""

    def __init__(self, path: Path, plan: bytes, at_ns: int) -> None:
        self.path = path
        self._file: BinaryIO = path.open("wb")
        self._writer = Writer(self._file, chunk_size=256 * 1024, compression=CompressionType.ZSTD)
        self._writer.start(profile="", library="chairward")
        self._channels = {
            RECORDS: self._writer.register_channel(RECORDS, "msgpack", 0),
            PLAN: self._writer.register_channel(PLAN, "json", 0),
            PINS: self._writer.register_channel(PINS, "json", 0),
        }
        self._schemas = {
            topic: self._writer.register_schema(name, "jsonschema", schema(name, kind))
            for topic, (name, kind) in TOPICS.items()
        }
        try:
            if plan:
                self.add(PLAN, at_ns, plan)
            self.flush()
        except OSError:
            self.abandon()
            raise

    def add(self, topic: str, at_ns: int, data: bytes, sequence: int = 0) -> None:
        """One message. Raises OSError."""
        if topic not in self._channels:
            kind = PICTURES if topic.startswith(f"{PICTURES}/") else topic
            self._channels[topic] = self._writer.register_channel(topic, "json", self._schemas[kind])
        self._writer.add_message(self._channels[topic], at_ns, data, at_ns, sequence)

    def flush(self) -> int:
        """End the chunk, so that a file that is cut later can be read up to here; the descriptor to sync."""
        self._writer.flush()  # type: ignore[no-untyped-call]
        self._file.flush()
        return self._file.fileno()

    @property
    def size(self) -> int:
        """Bytes written so far."""
        return self._file.tell()

    def abandon(self) -> None:
        """Close what cannot be written any more; what is on the disk stays."""
        with contextlib.suppress(OSError):
            self._file.close()

    def close(self) -> None:
        """Write the index and close. Raises OSError."""
        try:
            self._writer.finish()  # type: ignore[no-untyped-call]
            self._file.close()
        finally:
            self.abandon()


class Recorder:
    """Writes one run; `observe` is called with every encoded record."""

    def __init__(self, settings: RecorderSettings, context: Context) -> None:
        self._settings, self._run_dir = settings, context.run_dir
        self._path = context.run_dir / settings.path
        plan_file = context.run_dir / "plan.json"
        self._plan = plan_file.read_bytes() if plan_file.exists() else b""
        self._offset_ns = time.time_ns() - time.monotonic_ns()
        self._readable = Readable()
        self._album = Album(settings.pictures, context.frames, settings.panes)
        self._pins: SharedState | None = None
        self._count = self._missed = self._unsaid = 0
        self._trouble, self._again_s = "", 0.0
        self._lock = threading.Lock()
        self._over = threading.Event()
        self._part: Part | None = None
        self._parts_file = context.run_dir / f"{context.lane}.parts"
        self._parts = self._parts_file.stat().st_size if self._parts_file.exists() else 0
        try:
            self._next_part(self._offset_ns + time.monotonic_ns())
        except OSError as error:
            self._give_up(error)
        self._thread = threading.Thread(target=self._keep_up, name="recorder", daemon=True)
        self._thread.start()

    def observe(self, record: bytes) -> None:
        """Write one record, and its readable part."""
        whole = records.decode(record)
        at = whole.facts.now_ns + self._offset_ns
        with self._lock:
            self._missed += whole.missed
            try:
                if self._part is None and time.monotonic() < self._again_s:
                    self._skip()
                else:
                    self._write(whole, record, at)
                    self._count += 1
            except OSError as error:
                self._give_up(error)
                self._skip()
        if whole.decision.protective_stop:
            self._album.stopped(whole.facts.now_ns)

    def _write(self, whole: records.Record, record: bytes, at: int) -> None:
        """Into the open part, or the next one. Raises OSError."""
        part = self._part or self._next_part(at)
        if part.size > self._settings.part_mb * MB:
            part.close()
            part = self._next_part(at)
            for old in range(1, self._parts - self._settings.parts + 1):  # only a full part pushes the oldest out
                part_path(self._path, old).unlink(missing_ok=True)
        if self._unsaid:
            whole = msgspec.structs.replace(whole, missed=whole.missed + self._unsaid)
            record, self._unsaid = records.encode(whole), 0
        part.add(RECORDS, at, record, whole.tick % 2**32)
        for topic, message in self._readable.of(whole, at):
            part.add(topic, at, msgspec.json.encode(message), whole.tick % 2**32)
        if (pins := self._read_pins()) is not None:
            part.add(PINS, at, msgspec.json.encode(pins), whole.tick % 2**32)

    def _next_part(self, at: int) -> Part:
        """Begin the next file. Raises OSError."""
        self._part = None
        if shutil.disk_usage(self._path.parent).free < LEAVE_FREE_BYTES:
            raise OSError(f"less than {LEAVE_FREE_BYTES // MB} MB are free in {self._path.parent}")
        self._parts += 1
        with self._parts_file.open("ab") as begun:  # a byte a part: a recorder that is started again writes over none
            begun.write(b".")
        self._part = Part(part_path(self._path, self._parts), self._plan, at)
        return self._part

    def _skip(self) -> None:
        """One record that is not written; the next one that is says so."""
        self._missed += 1
        self._unsaid += 1

    def _give_up(self, error: OSError) -> None:
        """Nothing can be written now: try again a little later, with a new file."""
        self._trouble = str(error)
        self._again_s = time.monotonic() + TRY_AGAIN_S
        if self._part is not None:
            self._part.abandon()
        self._part = None

    def _read_pins(self) -> dict[str, float] | None:
        """The simulated controller's pins now; None without one, or when it died in the middle of writing them."""
        if self._pins is None:
            path = self._run_dir / PINS_FILE
            if not path.exists():
                return None
            self._pins = SharedState.attach(path)
        try:
            return self._pins.read()
        except TimeoutError:
            return None

    def _keep_up(self) -> None:
        """The thread: pictures, and twice a second everything to the disk, also while no records come."""
        flushed_s = time.monotonic()
        while not self._over.wait(min(FLUSH_S, 1.0 / self._settings.pictures_hz)):
            shots = list(self._album.look(time.monotonic_ns()))
            fd = -1
            with self._lock:
                part = self._part
                try:
                    if part is not None:
                        for captured_ns, lane, pane, data in shots:
                            at = captured_ns + self._offset_ns
                            part.add(f"{PICTURES}/{lane}/{pane}", at, msgspec.json.encode(picture(data, at, lane)))
                        if time.monotonic() - flushed_s >= FLUSH_S:
                            flushed_s = time.monotonic()
                            fd = os.dup(part.flush())
                except OSError as error:
                    self._give_up(error)
            if fd >= 0:  # outside the lock: a slow disk holds nobody up
                os.fdatasync(fd)
                os.close(fd)

    def close(self) -> None:
        """Write the index, close, and report what was kept and what was missed; may be called twice."""
        if self._over.is_set():
            return
        self._over.set()
        self._thread.join()
        self._album.close()
        if self._pins is not None:
            self._pins.close()
        try:
            if self._part is not None:
                self._part.close()
        except OSError as error:
            self._give_up(error)
        report = {"records": self._count, "missed": self._missed, "parts": self._parts, "trouble": self._trouble}
        (self._run_dir / "report-recorder.json").write_text(json.dumps(report))


def part_path(path: Path, number: int) -> Path:
    """drive.mcap, drive.2.mcap, drive.3.mcap, ..."""
    return path if number == 1 else path.with_name(f"{path.stem}.{number}{path.suffix}")

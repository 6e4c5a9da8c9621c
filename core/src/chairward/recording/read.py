"""Reading recordings, whole or cut anywhere.

The frames of MCAP (https://mcap.dev/spec) are walked here and not by the mcap library, for two reasons: its reader
takes 20 us a message, which is as long as a quarter of a decision, and it gives nothing of the chunk in which a file
was cut. Whether the files are good MCAP is for the library to say: the tests read them with it.
"""

from __future__ import annotations

import mmap
import struct
import zlib
from collections.abc import Iterator
from pathlib import Path
from typing import NamedTuple

import msgspec
import zstandard
from mcap.exceptions import McapError

from chairward import records
from chairward.plan import Plan
from chairward.recording.topics import PLAN, RECORDS
from chairward.records import Record

MAGIC = b"\x89MCAP0\r\n"
CHANNEL, MESSAGE, CHUNK, DATA_END = 0x04, 0x05, 0x06, 0x0F
_FRAME = struct.Struct("<BQ")
_HEAD = struct.Struct("<BQH")
"""Of a frame whose body begins with the number of a channel, as those of channels and messages do."""
_CHUNK = struct.Struct("<QQQI")
_MESSAGE = struct.Struct("<HIQQ")
_U32 = struct.Struct("<I")


class Entry(NamedTuple):
    """One message of a recording; at_ns: since 1970."""

    topic: str
    at_ns: int
    data: bytes


def parts(path: Path, first: int = 0, last: int | None = None) -> Iterator[bytes]:
    """Frames as they stand in the file: each chunk unpacked (from the first up to and without the last), and what lies
    between them. Of a file that was cut, all before the cut.

    Raises OSError, and McapError for what is no recording.
    """
    with path.open("rb") as file:
        if file.read(len(MAGIC)) != MAGIC:
            raise McapError(f"{path}: not a recording")
        with mmap.mmap(file.fileno(), 0, access=mmap.ACCESS_READ) as data:
            at, size, nth = len(MAGIC), len(data), 0
            while at + _FRAME.size <= size:
                kind, length = _FRAME.unpack_from(data, at)
                start, end = at + _FRAME.size, at + _FRAME.size + length
                if kind in (0, DATA_END):  # the end, or what a file system leaves behind a power cut
                    return
                if kind == CHUNK:
                    if last is not None and nth >= last:
                        return
                    if nth >= first:
                        unpacked = _unpacked(path, data[start : min(end, size)], length)
                        if unpacked is None:
                            return
                        yield unpacked
                    nth += 1
                elif kind in (CHANNEL, MESSAGE) and end <= size:
                    yield data[at:end]
                at = end


def is_cut(path: Path) -> bool:
    """Whether the file has no end: a power cut, a killed recorder, or one that still writes. Raises OSError."""
    with path.open("rb") as file:
        file.seek(-min(len(MAGIC), path.stat().st_size), 2)
        return file.read() != MAGIC


def chunks(path: Path) -> int:
    """How many chunks the file has. Raises OSError, McapError."""
    with path.open("rb") as file:
        if file.read(len(MAGIC)) != MAGIC:
            raise McapError(f"{path}: not a recording")
        count, size = 0, path.stat().st_size
        while len(head := file.read(_FRAME.size)) == _FRAME.size:
            kind, length = _FRAME.unpack(head)
            if kind in (0, DATA_END) or file.tell() + length > size:
                return count + int(kind == CHUNK)
            count += int(kind == CHUNK)
            file.seek(length, 1)
    return count


def _unpacked(path: Path, body: bytes, length: int) -> bytes | None:
    """A chunk's frames; of one that was cut, those whose blocks are whole; None where it was spoilt."""
    if len(body) < _CHUNK.size + 4:
        return None
    *_, size, crc = _CHUNK.unpack_from(body)
    at = _CHUNK.size
    (name_length,) = _U32.unpack_from(body, at)
    name = body[at + 4 : at + 4 + name_length]
    packed = body[at + 4 + name_length + 8 :]
    whole = len(body) == length
    try:
        if name == b"":
            frames = packed
        elif name == b"zstd":
            unpacker = zstandard.ZstdDecompressor()
            frames = unpacker.decompress(packed, size) if whole else unpacker.decompressobj().decompress(packed)
        else:
            raise McapError(f"{path}: packed with '{name[:20].decode(errors='replace')}', but only zstd can be read")
    except zstandard.ZstdError:
        return None
    return None if whole and crc and zlib.crc32(frames) != crc else frames


def walk(frames: bytes, topics: dict[int, str], topic: str | None = None) -> Iterator[Entry]:
    """The messages among frames (of one topic, or all); channels are learnt into `topics`."""
    at, size = 0, len(frames)
    while at + _HEAD.size <= size:
        kind, length, channel = _HEAD.unpack_from(frames, at)
        body, at = at + _FRAME.size, at + _FRAME.size + length
        if at > size:
            return
        if kind == MESSAGE:
            name = topics.get(channel, "")
            if topic is None or name == topic:
                _, _, at_ns, _ = _MESSAGE.unpack_from(frames, body)
                yield Entry(name, at_ns, frames[body + _MESSAGE.size : at])
        elif kind == CHANNEL:
            (name_length,) = _U32.unpack_from(frames, body + 4)
            topics[channel] = frames[body + 8 : body + 8 + name_length].decode(errors="replace")


def entries(path: Path, topic: str | None = None) -> Iterator[Entry]:
    """The messages of one topic (or of all), in order of writing; of a file that was cut, all before the cut.

    Raises OSError, McapError.
    """
    topics: dict[int, str] = {}
    for part in parts(path):
        yield from walk(part, topics, topic)


def messages(path: Path, topic: str) -> Iterator[bytes]:
    """What the messages of one topic say. Raises OSError, McapError."""
    return (entry.data for entry in entries(path, topic))


def read(path: Path) -> Iterator[Record]:
    """The records of a file, in order; of a file that was cut, all before the cut.

    Raises OSError; McapError for what is no recording, and for a record that is whole but cannot be read.
    """
    for nth, data in enumerate(messages(path, RECORDS)):
        try:
            yield records.decode(data)
        except (msgspec.DecodeError, UnicodeDecodeError) as error:
            raise unreadable(path, nth, error) from error


def unreadable(path: Path, nth: int, error: Exception) -> McapError:
    """What to say of a record that is whole but cannot be read."""
    return McapError(
        f"{path}: record {nth} cannot be read ({error}); it is damaged, or of another version of chairward"
    )


def read_plan(path: Path) -> Plan:
    """The plan of the run that was recorded. Raises OSError, and McapError when there is none or it cannot be read."""
    for data in messages(path, PLAN):
        try:
            return msgspec.json.decode(data, type=Plan)
        except (msgspec.DecodeError, UnicodeDecodeError) as error:
            raise McapError(
                f"{path}: its plan cannot be read ({error}); it is damaged, or of another version of chairward"
            ) from error
    raise McapError(f"{path}: holds no plan, so its limits are not known")

"""A few named float64 values in a mapped file: one writer, any readers, never a torn read.

Simulated controllers publish their pins this way, and the simulated home the chair's pose: plugins that must not
import each other share a file format instead. Real devices do not use it.
"""

from __future__ import annotations

import json
import mmap
import struct
import time
from pathlib import Path

PIN_NAMES = (
    "time_ns",
    "drive_duty",
    "drive_in1",
    "drive_in2",
    "steer_duty",
    "steer_in1",
    "steer_in2",
    "brake",
    "state",
    "fault",
)
"""What every simulated controller publishes in run_dir/pins. Motor "drive" goes forward and back, "steer" turns.

time_ns: CLOCK_MONOTONIC of the write. duty: 0..1 of the bridge's enable input, 0 coasts. in1, in2: its direction
inputs; 1, 0 is forward or left, equal ones with duty short-brake. brake: 1 is applied. state, fault: the controller's.
"""
_HEAD = struct.Struct("<QI")
_GIVE_UP_S = 1.0
_LOOK_AGAIN_S = 0.0002


class SharedState:
    """Values by name. Layout: u64 sequence (odd while writing), u32 length of the names' JSON, names, float64s."""

    def __init__(self, path: Path, map_: mmap.mmap, names: tuple[str, ...], start: int, *, writable: bool) -> None:
        self.path, self.names = path, names
        self._map, self._start, self._writable = map_, start, writable
        self._pack = struct.Struct(f"<{len(names)}d")
        self._sequence = 0
        self._values = dict.fromkeys(names, 0.0)

    @classmethod
    def create(cls, path: Path, names: tuple[str, ...]) -> SharedState:
        """Make the file (all values 0) and map it for writing. Replaces an older file in one step."""
        head = json.dumps(names).encode()
        head += b" " * (-(_HEAD.size + len(head)) % 8)
        part = path.with_suffix(path.suffix + ".part")
        part.write_bytes(_HEAD.pack(0, len(head)) + head + bytes(8 * len(names)))
        part.replace(path)
        with path.open("r+b") as file:
            return cls(path, mmap.mmap(file.fileno(), 0), names, _HEAD.size + len(head), writable=True)

    @classmethod
    def attach(cls, path: Path, timeout_s: float = 0.0) -> SharedState:
        """Map an existing file read-only, waiting up to timeout_s for it to appear. Raises FileNotFoundError."""
        end = time.monotonic() + timeout_s
        while not path.exists() and time.monotonic() < end:
            time.sleep(0.01)
        with path.open("rb") as file:
            map_ = mmap.mmap(file.fileno(), 0, access=mmap.ACCESS_READ)
        _, length = _HEAD.unpack_from(map_, 0)
        names = tuple(json.loads(map_[_HEAD.size : _HEAD.size + length]))
        return cls(path, map_, names, _HEAD.size + length, writable=False)

    def write(self, **values: float) -> None:
        """Set some values; the others keep theirs. Raises KeyError for an unknown name."""
        for name, value in values.items():
            if name not in self._values:
                raise KeyError(f"{self.path}: no value named '{name}' (there are: {', '.join(self.names)})")
            self._values[name] = float(value)
        self._sequence += 2
        struct.pack_into("<Q", self._map, 0, self._sequence - 1)
        self._pack.pack_into(self._map, self._start, *self._values.values())
        struct.pack_into("<Q", self._map, 0, self._sequence)

    def read(self) -> dict[str, float]:
        """All values of one write, never a mixture of two. Raises TimeoutError when the writer died in mid-write."""
        end = time.monotonic() + _GIVE_UP_S
        while True:
            before = struct.unpack_from("<Q", self._map, 0)[0]
            values = self._pack.unpack_from(self._map, self._start)
            if before % 2 == 0 and before == struct.unpack_from("<Q", self._map, 0)[0]:
                return dict(zip(self.names, values, strict=True))
            if time.monotonic() > end:
                raise TimeoutError(f"{self.path}: the writer stopped in the middle of a write")
            time.sleep(_LOOK_AGAIN_S)  # a writer that lost its core in mid-write needs one to go on

    def close(self) -> None:
        """Unmap; the file stays."""
        self._map.close()

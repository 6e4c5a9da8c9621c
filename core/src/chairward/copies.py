"""Copies of every decision for those who only look: recorder, screens, supervisor. None of them can hold a guard up."""

from __future__ import annotations

import socket
from collections.abc import Sequence

import msgspec

from chairward import records
from chairward.records import Record


class Copies:
    """The guard's ends of all observers' lines, each with the number of records that it has missed since its last."""

    def __init__(self, ends: Sequence[socket.socket]) -> None:
        self._missed = dict.fromkeys(ends, 0)

    def add(self, end: socket.socket) -> None:
        """One more observer."""
        self._missed[end] = 0

    def publish(self, record: Record) -> None:
        """A copy to everybody who has room; what one misses is counted and told in its next record."""
        data = records.encode(record)
        for end, missed in list(self._missed.items()):
            mine = records.encode(msgspec.structs.replace(record, missed=missed)) if missed else data
            try:
                end.send(mine)
                self._missed[end] = 0
            except BlockingIOError:
                self._missed[end] = missed + 1
            except ConnectionError:
                del self._missed[end]
                end.close()
            except OSError:  # too large for it, or no memory for it now
                self._missed[end] = missed + 1

    def close(self) -> None:
        """Let them know that this was all."""
        for end in self._missed:
            end.close()

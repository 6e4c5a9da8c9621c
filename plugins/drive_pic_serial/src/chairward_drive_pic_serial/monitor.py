"""Reads the exchange on a PIC's line: live, as a relay between the drive and the port, or from a recording.

A recording is text, one piece of bytes a line: seconds, `>` to the PIC or `<` from it, hex.
"""

from __future__ import annotations

import select
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import TextIO

from chairward_drive_pic_serial import wire
from chairward_drive_pic_serial.describe import describe
from chairward_drive_pic_serial.port import Port
from chairward_drive_pic_serial.sim_pic import PtyEnd


class Reader:
    """Turns pieces of both directions into readable lines; broken frames are told, not hidden."""

    def __init__(self) -> None:
        self._splitters = {">": wire.Splitter(), "<": wire.Splitter()}

    def lines(self, at_s: float, way: str, data: bytes) -> Iterator[str]:
        """One line a frame."""
        splitter = self._splitters[way]
        before = splitter.broken
        for payload in splitter.feed(data):
            yield f"{at_s:10.4f}  {describe(payload)}"
        if splitter.broken > before:
            yield f"{at_s:10.4f}  {'->' if way == '>' else '<-'} {splitter.broken - before} broken: {data.hex(' ')}"


class Relay:
    """Stands between the drive (at a pty's end) and the port; each frame is shown, all bytes can be recorded."""

    def __init__(self, port: Port, end: PtyEnd, show: Callable[[str], None], record: TextIO | None = None) -> None:
        self._port, self._end, self._show, self._record = port, end, show, record
        self._reader, self._start = Reader(), time.monotonic()

    def wait(self) -> None:
        """Until there are bytes on either side."""
        select.select([self._port.fd, self._end.fd], [], [])

    def carry(self) -> None:
        """Pass on what is there, never waiting. Raises PortError."""
        at_s = time.monotonic() - self._start
        for way, data in ((">", self._end.read()), ("<", self._port.read())):
            if not data:
                continue
            if way == ">":
                self._port.write_raw(data)
            else:
                self._end.write(data)
            if self._record:
                self._record.write(f"{at_s:.4f} {way} {data.hex()}\n")
            for line in self._reader.lines(at_s, way, data):
                self._show(line)


def recorded(path: Path) -> Iterator[str]:
    """The lines of a recording. Raises ValueError with file and line where it is not one."""
    reader = Reader()
    for number, text in enumerate(path.read_text(encoding="ascii", errors="replace").splitlines(), 1):
        try:
            at, way, data = text.split()
            yield from reader.lines(float(at), way, bytes.fromhex(data))
        except (ValueError, KeyError):
            raise ValueError(
                f"{path}: line {number} is not 'seconds > hex' or 'seconds < hex': {text[:40]!r}: "
                "give a file that 'chairward pic monitor --record' has written"
            ) from None

"""CAN over a serial line (Lawicel's ASCII protocol, "slcan"): the codec, and a port that never waits.

python-can's own slcan interface drains the line after every frame (tcdrain), waits a millisecond in each read and
throws the adapter's answers away; inside a guard the first may hang it and the last are the only sign that a frame
has left the adapter. So this one backend is ours: 12 lines of codec and a non-blocking port.
"""

from __future__ import annotations

import contextlib
import os
import select
import termios
from collections.abc import Iterator

from chairward_drive_can.frames import Frame

BITRATES = {10_000: 0, 20_000: 1, 50_000: 2, 100_000: 3, 125_000: 4, 250_000: 5, 500_000: 6, 800_000: 7, 1_000_000: 8}
OK, BELL = b"\r", b"\a"
LINE_MAX = 32
"""Longest line of the protocol is 27 characters (T, 8 of id, length, 16 of data, '\\r'); more is noise."""


def encode(frame: Frame) -> bytes:
    """The line for one frame, '\\r' included."""
    letter = {(False, False): "t", (True, False): "T", (False, True): "r", (True, True): "R"}
    name = f"{frame.id:08X}" if frame.extended else f"{frame.id:03X}"
    return f"{letter[frame.extended, frame.remote]}{name}{len(frame.data)}{frame.data.hex().upper()}\r".encode()


def decode(line: bytes) -> Frame | None:
    """The frame of one line without its '\\r'; None for anything else (answers, noise). Never raises."""
    kind, width = line[:1], 8 if line[:1] in b"TR" else 3
    if kind not in (b"t", b"T", b"r", b"R") or len(line) < 2 + width:
        return None
    try:
        identity, size = int(line[1 : 1 + width].decode("ascii"), 16), line[1 + width] - 48
        data = b"" if kind in b"rR" else bytes.fromhex(line[2 + width : 2 + width + 2 * size].decode("ascii"))
    except ValueError:
        return None
    if not 0 <= size <= 8 or identity < 0 or identity >= (1 << 29 if width == 8 else 1 << 11):
        return None
    if kind in b"tT" and len(data) != size:
        return None
    return Frame(identity, data, extended=width == 8, remote=kind in b"rR")


class LineSplitter:
    """Bytes in, lines out: b"" is an answer (OK), BELL is a refusal. Noise longer than a line is dropped."""

    def __init__(self) -> None:
        self._rest = b""

    def feed(self, data: bytes) -> Iterator[bytes]:
        """The lines that `data` completes."""
        self._rest += data
        while self._rest:
            end = next((i for i, byte in enumerate(self._rest) if byte in OK + BELL), -1)
            if end < 0:
                self._rest = self._rest if len(self._rest) <= LINE_MAX else b""
                return
            line, mark, self._rest = self._rest[:end], self._rest[end : end + 1], self._rest[end + 1 :]
            yield BELL if mark == BELL else line


class SlcanPort:
    """An slcan adapter: opened exclusively, read and written without ever waiting. Raises OSError."""

    def __init__(self, path: str, bitrate: int, tty_baudrate: int, *, listen_only: bool, acknowledges: bool) -> None:
        import serial  # late: only a chair with such an adapter needs it

        if bitrate not in BITRATES:
            known = ", ".join(str(rate) for rate in BITRATES)
            raise OSError(f"an slcan adapter knows no {bitrate} bit/s (it knows {known})")
        self._port = serial.Serial(path, tty_baudrate, timeout=0, write_timeout=0, exclusive=True)
        self._fd = self._port.fileno()
        self._hangup = select.poll()
        self._hangup.register(self._fd, 0)
        self._lines = LineSplitter()
        self._acknowledges = acknowledges
        self.unanswered = 0
        self.refused = 0
        self._listen_only = listen_only
        for command in (b"\r\rC\r", f"S{BITRATES[bitrate]}\r".encode(), b"L\r" if listen_only else b"O\r"):
            os.write(self._fd, command)

    def fileno(self) -> int:
        """Readable when the adapter has said something."""
        return self._fd

    def send(self, frame: Frame) -> None:
        """One write; BlockingIOError when the line is full."""
        line = encode(frame)
        if os.write(self._fd, line) != len(line):
            raise OSError("the adapter took only part of a frame")
        self.unanswered += 1 if self._acknowledges else 0

    def receive(self) -> list[Frame]:
        """All frames that have come in by now (at most one buffer's worth)."""
        try:
            data = os.read(self._fd, 4096)
        except BlockingIOError:
            return []
        if not data:
            if any(event & (select.POLLHUP | select.POLLERR) for _, event in self._hangup.poll(0)):
                raise OSError("the adapter is gone")
            return []
        frames = []
        for line in self._lines.feed(data):
            if frame := decode(line):
                frames.append(frame)
            elif line in (b"z", b"Z", BELL) or (line == b"" and self.unanswered):
                self.refused += line == BELL
                self.unanswered = max(0, self.unanswered - 1)
        return frames

    def close(self) -> None:
        """Close the channel and the port; may be called twice."""
        if self._port.is_open:
            if self.unanswered > 2:  # nobody takes it: the kernel would wait for it when closing
                with contextlib.suppress(OSError, termios.error):
                    termios.tcflush(self._fd, termios.TCOFLUSH)
            with contextlib.suppress(OSError, termios.error):
                os.write(self._fd, b"C\r")
            with contextlib.suppress(OSError, termios.error):
                self._port.close()

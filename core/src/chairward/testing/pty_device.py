"""A serial device for tests: a pty behind a fixed name, and a thread that sends what the test says."""

from __future__ import annotations

import os
import pty
import random
import termios
import threading
import tty
from collections.abc import Callable
from pathlib import Path


class PtyDevice:
    """Sends `sends()` every `period_s` for ever. path: the port's name, a link to the pty; gone while unplugged."""

    def __init__(self, path: Path, sends: Callable[[], bytes], period_s: float = 0.05) -> None:
        self.path, self._sends, self._period_s = path, sends, period_s
        self._lock, self._end = threading.Lock(), threading.Event()
        self._ours = self._theirs = -1
        self.plug()
        self._thread = threading.Thread(target=self._run, name=f"device {path.name}", daemon=True)
        self._thread.start()

    def plug(self) -> None:
        """Make the port."""
        with self._lock:
            self._ours, self._theirs = pty.openpty()
            tty.setraw(self._theirs)
            os.set_blocking(self._ours, False)
            self.path.unlink(missing_ok=True)
            self.path.symlink_to(os.ttyname(self._theirs))

    def unplug(self) -> None:
        """Take the port away."""
        with self._lock:
            if self._ours >= 0:
                self.path.unlink(missing_ok=True)
                os.close(self._theirs)
                os.close(self._ours)
                self._ours = self._theirs = -1

    def send(self, sends: Callable[[], bytes], period_s: float = 0.05) -> None:
        """From now on this is sent, that often."""
        with self._lock:
            self._sends, self._period_s = sends, period_s

    def close(self) -> None:
        """End it."""
        self._end.set()
        self._thread.join()
        self.unplug()

    def _run(self) -> None:
        while not self._end.wait(self._period_s):
            with self._lock:
                if self._ours >= 0:
                    self._write(self._sends())

    def _write(self, data: bytes) -> None:
        try:
            os.write(self._ours, data)
        except BlockingIOError:
            termios.tcflush(self._theirs, termios.TCIFLUSH)  # nobody reads: a real port's buffer overruns too


def damaged(line: bytes, *, keep: bytes = b"\n") -> bytes:
    """A line as a bad cable gives it: bytes flipped and lost, its end (`keep`) intact."""
    body = bytearray(line.removesuffix(keep))
    for _ in range(3):
        body[random.randrange(len(body))] ^= 0x80 | 1 << random.randrange(7)
    del body[random.randrange(len(body))]
    return bytes(body) + keep

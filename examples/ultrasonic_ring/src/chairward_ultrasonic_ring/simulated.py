"""A simulated ring's board on a pty: what the tests plug in, and a program to try the plugin without a board.

`python -m chairward_ultrasonic_ring.simulated /tmp/ring` makes the port /tmp/ring and asks for distances.
"""

from __future__ import annotations

import os
import pty
import random
import sys
import termios
import threading
import tty
from collections.abc import Callable
from pathlib import Path

from chairward_ultrasonic_ring.line import WAYS, encode

PERIOD_S = 0.05


class SimulatedRing:
    """Sends lines for ever, from a thread; `sends` decides what. path: the port's name, a link to the pty."""

    def __init__(self, path: Path) -> None:
        self.path, self.count = path, 0
        self.ways = dict.fromkeys(WAYS, 2000)
        self.sends: Callable[[], bytes] = self.truth
        self.period_s = PERIOD_S
        self._lock, self._end = threading.Lock(), threading.Event()
        self._ours = self._theirs = -1
        self.plug()
        self._thread = threading.Thread(target=self._run, daemon=True)
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

    def send(self, sends: Callable[[], bytes], period_s: float = PERIOD_S) -> None:
        """From now on this is sent, every period_s."""
        with self._lock:
            self.sends, self.period_s = sends, period_s

    def truth(self) -> bytes:
        """The line of a healthy board."""
        self.count += 1
        return encode(self.count, self.ways)

    def close(self) -> None:
        """End it."""
        self._end.set()
        self._thread.join()
        self.unplug()

    def _run(self) -> None:
        while not self._end.wait(self.period_s):
            with self._lock:
                if self._ours >= 0:
                    self._write(self.sends())

    def _write(self, data: bytes) -> None:
        try:
            os.write(self._ours, data)
        except BlockingIOError:
            termios.tcflush(self._theirs, termios.TCIFLUSH)  # nobody reads: a real port's buffer overruns too


def damaged(line: bytes) -> bytes:
    """A line with three bits flipped and a byte lost."""
    broken = bytearray(line)
    for _ in range(3):
        broken[random.randrange(len(broken))] ^= 1 << random.randrange(8)
    del broken[random.randrange(len(broken))]
    return bytes(broken)


def main() -> None:
    """Ask for distances until the input ends."""
    ring = SimulatedRing(Path(sys.argv[1]))
    sys.stdout.write(f"{ring.path}: type 'ahead 700', 'behind 0' (nothing near), 'left -1' (does not answer)\n")
    for text in sys.stdin:
        way, _, figure = text.strip().partition(" ")
        if way in WAYS and figure.lstrip("-").isdigit():
            ring.ways[way] = int(figure)
        else:
            sys.stdout.write(f"'{text.strip()}': a way ({', '.join(WAYS)}) and millimetres, please\n")
    ring.close()


if __name__ == "__main__":
    main()

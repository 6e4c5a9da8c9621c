"""Whether the chair itself is speaking: what it says must not move it.

Whoever lets a loudspeaker of the chair speak says so (`Speaker`), a recognizer asks (`is_speaking`) and takes no motion
word from that time. A mapped file in the run's folder; without one nobody speaks.
"""

from __future__ import annotations

from pathlib import Path

from chairward.shared_state import SharedState

FILE = "speaking"
ECHO_NS = 500_000_000
"""What was said is still in the room, and in the sound card, for this long."""


class Speaker:
    """The end of one who speaks (one in a run)."""

    def __init__(self, run_dir: Path) -> None:
        self._state = SharedState.create(run_dir / FILE, ("from_ns", "until_ns"))

    def say(self, from_ns: int, until_ns: int) -> None:
        """Something is said from now on until then (CLOCK_MONOTONIC); what is being said is not cut short."""
        before = self._state.read()
        begins = before["from_ns"] if from_ns <= before["until_ns"] + ECHO_NS else from_ns
        self._state.write(from_ns=begins, until_ns=max(before["until_ns"], until_ns))

    def close(self) -> None:
        """Unmap."""
        self._state.close()


class Listener:
    """The end of one who listens; works whether somebody speaks in this run or not."""

    def __init__(self, run_dir: Path) -> None:
        self._file = run_dir / FILE
        self._state: SharedState | None = None
        self._inode = 0

    def is_speaking(self, at_ns: int) -> bool:
        """Was the chair speaking (or its echo in the room) at that time? A torn file counts as speaking."""
        try:
            inode = self._file.stat().st_ino
        except FileNotFoundError:
            return False
        if self._state is None or inode != self._inode:  # who speaks was started again, and made a new file
            self.close()
            self._state, self._inode = SharedState.attach(self._file), inode
        try:
            now = self._state.read()
        except TimeoutError:
            return True
        return now["from_ns"] <= at_ns <= now["until_ns"] + ECHO_NS

    def close(self) -> None:
        """Unmap; may be called twice."""
        if self._state is not None:
            self._state.close()
            self._state = None

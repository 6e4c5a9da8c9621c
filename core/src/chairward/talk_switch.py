"""The switch of somebody who talks to the chair: while it is held (and a little after) motion words are meant.

A source with a key or switch holds it (`TalkSwitch`), a recognizer asks (`TalkListener`). A mapped file in the run's
folder; without one nobody has pressed. It opens ears and nothing else: what the words do is the guard's to decide.
"""

from __future__ import annotations

from pathlib import Path

from chairward.shared_state import SharedState

FILE = "talk"


class TalkSwitch:
    """The end of the switch (one in a run)."""

    def __init__(self, run_dir: Path) -> None:
        self._state = SharedState.create(run_dir / FILE, ("until_ns",))

    def hold(self, until_ns: int) -> None:
        """Held until then (CLOCK_MONOTONIC) unless held again; let go by silence."""
        self._state.write(until_ns=until_ns)

    def close(self) -> None:
        """Unmap."""
        self._state.close()


class TalkListener:
    """The end of one who listens; works whether a switch is there or not."""

    def __init__(self, run_dir: Path) -> None:
        self._file = run_dir / FILE
        self._state: SharedState | None = None
        self._inode = 0

    def is_held(self, at_ns: int) -> bool:
        """Was the switch held at that time? A torn file counts as let go."""
        try:
            inode = self._file.stat().st_ino
        except FileNotFoundError:
            return False
        if self._state is None or inode != self._inode:  # the switch was started again, and made a new file
            self.close()
            self._state, self._inode = SharedState.attach(self._file), inode
        try:
            return at_ns <= self._state.read()["until_ns"]
        except TimeoutError:
            return False

    def close(self) -> None:
        """Unmap; may be called twice."""
        if self._state is not None:
            self._state.close()
            self._state = None

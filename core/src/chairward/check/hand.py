"""The hand of a check on the chair: a source that holds a command and presses buttons as the check's process tells it.

Told through `run_dir/hand`. Alive only while the check is; so a check that dies lets go, and a chair file that named
this source would have a stop device that nobody holds, and would never move.
"""

from __future__ import annotations

import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from chairward.components import Context, DeviceLost, NoSettings
from chairward.messages import Alive, Button, Command, Intent, Message, Press
from chairward.shared_state import SharedState

FILE = "hand"
BUTTONS = (Button.STOP, Button.ARM, Button.RESET)
COMMANDS = tuple(Command)
NAMES = ("beat_ns", "command", *BUTTONS)
BEAT_S, SAY_S, LOOK_S = 0.05, 0.1, 0.02
GONE_NS = 300_000_000


class CheckHand:
    """Source `check_hand`, in the chair."""

    def __init__(self, settings: NoSettings, context: Context) -> None:
        del settings
        self._path = context.run_dir / FILE
        self._state: SharedState | None = None
        self._seen = dict.fromkeys(BUTTONS, 0)
        self._seq = 0
        self._due_s = 0.0

    def open(self) -> None:
        """Raises DeviceLost where no check is running."""
        try:
            self._state = SharedState.attach(self._path, 1.0)
        except FileNotFoundError:
            raise DeviceLost("check_hand: no check is running: this source belongs to `chairward check`") from None

    def read(self, timeout_s: float) -> list[Message] | None:
        """What the hand does now: ten times a second what it holds, and each press at once."""
        if self._state is None:
            raise DeviceLost("check_hand: not open")
        end = time.monotonic() + timeout_s
        while True:
            said = self._look(self._state.read())
            if said or time.monotonic() >= end:
                return said or None
            time.sleep(LOOK_S)

    def _look(self, state: dict[str, float]) -> list[Message]:
        now_ns = time.monotonic_ns()
        if now_ns - state["beat_ns"] > GONE_NS:
            return []
        said: list[Message] = []
        for button in BUTTONS:
            if state[button] > self._seen[button]:
                self._seen[button] = int(state[button])
                said.append(Press(seq=self._next(), captured_ns=now_ns, button=button))
        if said or time.monotonic() >= self._due_s:
            self._due_s = time.monotonic() + SAY_S
            said.append(Alive(seq=self._next(), captured_ns=now_ns))
            if (nth := int(state["command"])) >= 0:
                said.append(Intent(seq=self._next(), captured_ns=now_ns, command=COMMANDS[nth], held=True))
        return said

    def _next(self) -> int:
        self._seq += 1
        return self._seq

    def close(self) -> None:
        """May be called twice."""
        if self._state is not None:
            self._state.close()
            self._state = None


class Hand:
    """The same hand at the check's end."""

    def __init__(self, state: SharedState) -> None:
        self._state = state
        self._pressed = dict.fromkeys(BUTTONS, 0)
        self._lock = threading.Lock()

    def hold(self, command: Command | None) -> None:
        """Hold a command from now on; None lets go."""
        with self._lock:
            self._state.write(command=-1 if command is None else COMMANDS.index(command))

    def press(self, button: Button) -> None:
        """Press once."""
        with self._lock:
            self._pressed[button] += 1
            self._state.write(**{button: self._pressed[button]})

    def beat(self) -> None:
        """Still there."""
        with self._lock:
            self._state.write(beat_ns=time.monotonic_ns())


@contextmanager
def hand(run_dir: Path) -> Iterator[Hand]:
    """A hand that beats by itself until the check leaves."""
    state = SharedState.create(run_dir / FILE, NAMES)
    it, over = Hand(state), threading.Event()
    it.hold(None)

    def work() -> None:
        while not over.wait(BEAT_S):
            it.beat()

    thread = threading.Thread(target=work, name="hand", daemon=True)
    thread.start()
    try:
        yield it
    finally:
        over.set()
        thread.join()
        state.close()

"""From keys to messages: presses, held commands that repeat, and the heartbeat. Pure."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import Literal

from chairward.messages import Alive, Button, Command, Intent, Message, Press
from chairward_keys.events import KeyEvent, Stroke
from chairward_keys.settings import Action

MS = 1_000_000

ALIVE_EVERY_NS = 100 * MS
HELD_EVERY_NS = 50 * MS
"""Held commands repeat at least every 100 ms (messages.Intent); twice as often, so that one may be late."""

_BUTTONS = {"stop": Button.STOP, "arm": Button.ARM, "reset": Button.RESET, "hold": Button.HOLD}


class Switchboard:
    """Turns key events into messages. Of several held keys the one pressed last counts; STOP lets go of all."""

    def __init__(self, keys: Mapping[str, Action], other: Literal["stop", "ignore"]) -> None:
        self._keys, self._other = dict(keys), other
        self._held: list[str] = []
        self.talking: set[str] = set()
        """Keys of the talk switch that are held."""
        self._alive_due_ns = 0
        self._held_due_ns = 0
        self._seq = 0

    def let_go(self) -> None:
        """Count no key as held (the device was opened anew)."""
        self._held.clear()
        self.talking.clear()

    def next_due_ns(self) -> int:
        """When `step` has something to say even if no key moves."""
        return min(self._alive_due_ns, self._held_due_ns) if self._held else self._alive_due_ns

    def step(self, now_ns: int, events: Iterable[KeyEvent]) -> list[Message]:
        """All messages that are due at now_ns; presses first, the heartbeat last."""
        messages: list[Message] = []
        for event in events:
            messages += self._event(event, now_ns)
        if self._held and now_ns >= self._held_due_ns:
            messages.append(self._repeat(self._action(self._held[-1]), now_ns))
            self._held_due_ns = now_ns + HELD_EVERY_NS
        if now_ns >= self._alive_due_ns:
            messages.append(Alive(seq=self._next(), captured_ns=now_ns))
            self._alive_due_ns = now_ns + ALIVE_EVERY_NS
        return messages

    def _action(self, key: str) -> Action:
        return self._keys.get(key, self._other)

    def _event(self, event: KeyEvent, now_ns: int) -> list[Message]:
        if event.stroke is Stroke.LOST:
            self.let_go()
            return []
        if event.stroke is Stroke.UP:
            self._held = [key for key in self._held if key != event.key]
            self.talking.discard(event.key)
            return []
        action = self._action(event.key)
        if action == "talk":
            self.talking.add(event.key)
            return []
        if action in ("stop", "arm", "reset"):
            if action == "stop":
                self._held.clear()
            return [Press(seq=self._next(), captured_ns=now_ns, button=_BUTTONS[action])]
        if action == "help":
            return [Intent(seq=self._next(), captured_ns=now_ns, command=Command.HELP, word=event.key)]
        if action != "ignore":
            self._held = [*(key for key in self._held if key != event.key), event.key]
            self._held_due_ns = now_ns
        return []

    def _repeat(self, action: Action, now_ns: int) -> Message:
        if action == "hold":
            return Press(seq=self._next(), captured_ns=now_ns, button=Button.HOLD)
        return Intent(seq=self._next(), captured_ns=now_ns, command=Command(action), word=action, held=True)

    def _next(self) -> int:
        self._seq += 1
        return self._seq

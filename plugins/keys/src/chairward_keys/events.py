"""From bytes to keys: what a terminal types, and what a Linux input device reports. Pure: no device is touched."""

from __future__ import annotations

import struct
from collections.abc import Iterator
from dataclasses import dataclass
from enum import Enum

MS = 1_000_000

ESCAPE_WAIT_NS = 50 * MS
"""An escape byte with nothing behind it for so long was the escape key, not the start of an arrow."""


class Stroke(Enum):
    """What happened to a key."""

    DOWN = "down"
    UP = "up"
    LOST = "lost"
    """The device says that it dropped events: nobody knows any more which keys are down."""


@dataclass(frozen=True, slots=True)
class KeyEvent:
    """One key, by name, and what happened to it."""

    key: str
    stroke: Stroke


_TYPED = {" ": "space", "\r": "enter", "\n": "enter", "\t": "tab", "\x7f": "backspace", "\x08": "backspace"}
_ARROWS = {"A": "up", "B": "down", "C": "right", "D": "left"}


class TypedKeys:
    """A terminal tells only what was typed: held keys are known by their repeats.

    The first character of a key is a tap. Its second within `repeat_gap_ns` makes it held, until no further one comes
    within that gap. So holding begins after the keyboard's own repeat delay (often half a second), and a tap never
    moves anything. Only the key typed last can be held: terminals repeat no other.
    """

    def __init__(self, repeat_gap_ns: int) -> None:
        self._gap_ns = repeat_gap_ns
        self._pending = ""
        self._pending_ns = 0
        self._last_key, self._last_ns, self._held = "", 0, False

    def feed(self, data: bytes, now_ns: int) -> Iterator[KeyEvent]:
        """What the bytes (possibly none) mean at now_ns."""
        yield from self._let_go(now_ns)
        if data and not self._pending:
            self._pending_ns = now_ns
        self._pending += data.decode("latin-1")
        timed_out = now_ns - self._pending_ns > ESCAPE_WAIT_NS
        while self._pending:
            taken, key = _first_key(self._pending, timed_out=timed_out)
            if not taken:
                return
            self._pending = self._pending[taken:]
            yield from self._typed(key, now_ns)

    def next_due_ns(self) -> int | None:
        """When to feed again even if nothing is typed."""
        if self._pending:
            return self._pending_ns + ESCAPE_WAIT_NS + MS
        return self._last_ns + self._gap_ns + MS if self._held else None

    def _typed(self, key: str, now_ns: int) -> Iterator[KeyEvent]:
        repeated = key == self._last_key and now_ns - self._last_ns <= self._gap_ns
        if not repeated:
            yield from self._release()
            yield KeyEvent(key, Stroke.DOWN)
            yield KeyEvent(key, Stroke.UP)
        elif not self._held:
            self._held = True
            yield KeyEvent(key, Stroke.DOWN)
        self._last_key, self._last_ns = key, now_ns

    def _let_go(self, now_ns: int) -> Iterator[KeyEvent]:
        if self._held and now_ns - self._last_ns > self._gap_ns:
            yield from self._release()

    def _release(self) -> Iterator[KeyEvent]:
        if self._held:
            self._held = False
            yield KeyEvent(self._last_key, Stroke.UP)


def _first_key(text: str, *, timed_out: bool) -> tuple[int, str]:
    """(characters taken, key) of the first key in text; (0, "") when it is not complete yet."""
    if text[0] != "\x1b":
        return 1, _TYPED.get(text[0], text[0].lower() if text[0].isprintable() else "other")
    if len(text) == 1:
        return (1, "escape") if timed_out else (0, "")
    if text[1] not in "[O":
        return 1, "escape"
    end = next((i for i in range(2, len(text)) if "@" <= text[i] <= "~"), None)
    if end is None:
        return (len(text), "other") if timed_out else (0, "")
    return end + 1, _ARROWS.get(text[end], "other")


_EVENT = struct.Struct("llHHi")
"""struct input_event of linux/input.h on this machine: seconds, microseconds, type, code, value."""

_EV_SYN, _EV_KEY, _SYN_DROPPED = 0, 1, 3

_CODES = {1: "escape", 14: "backspace", 15: "tab", 28: "enter", 57: "space", 96: "enter"}
_CODES |= {103: "up", 105: "left", 106: "right", 108: "down", 272: "mouse_left", 273: "mouse_right"}
_CODES |= {2 + i: key for i, key in enumerate("1234567890")}
for _first, _row in ((16, "qwertyuiop"), (30, "asdfghjkl"), (44, "zxcvbnm")):
    _CODES |= {_first + i: key for i, key in enumerate(_row)}


def is_key_name(name: str) -> bool:
    """Whether a key can be called that: a printable character, a name (linux/input-event-codes.h), or code_N."""
    if len(name) == 1:
        return name.isprintable() and name == name.lower() and name != " "
    return name in _CODES.values() or (name.startswith("code_") and name[5:].isdecimal())


class DeviceKeys:
    """A Linux input device (/dev/input/event*) tells exactly which key goes down and up."""

    def __init__(self) -> None:
        self._rest = b""
        self._down: set[str] = set()

    def feed(self, data: bytes, now_ns: int) -> Iterator[KeyEvent]:
        """What the bytes mean. Repeats (value 2) mean nothing: a key already down when we came counts once let go."""
        del now_ns
        data = self._rest + data
        whole = len(data) - len(data) % _EVENT.size
        self._rest = data[whole:]
        for _, _, kind, code, value in _EVENT.iter_unpack(data[:whole]):
            if kind == _EV_SYN and code == _SYN_DROPPED:
                self._down.clear()
                yield KeyEvent("", Stroke.LOST)
            elif kind == _EV_KEY and value in (0, 1):
                key = _CODES.get(code, f"code_{code}")
                if value == 1:
                    self._down.add(key)
                    yield KeyEvent(key, Stroke.DOWN)
                elif key in self._down:
                    self._down.discard(key)
                    yield KeyEvent(key, Stroke.UP)

    def next_due_ns(self) -> int | None:
        """Nothing happens without bytes."""
        return None

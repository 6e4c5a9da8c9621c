"""The desk: which page controls, whether it is alive, and what is handed on to the guard. No clock, no web.

A stop device lives only as long as its page: each beat of the controlling page becomes one `Alive` dated when the page
*sent* it, so silence anywhere (page, network, this process) ages in the guard by itself. Nothing here repeats a beat.
"""

from __future__ import annotations

import threading
from collections import deque
from dataclasses import dataclass, field

from chairward.messages import Alive, Button, Command, Intent, Message, Press

MS = 1_000_000
LOST_NS = 500 * MS
"""Without a beat for this long the controlling page is lost, and control is free."""
ARM_WITHIN_NS = 250 * MS
"""ARM and RESET need a beat at most this old: a page that is hidden or stutters arms nothing."""
BEAT_GAP_NS = 40 * MS
"""Faster beats say nothing more."""
SAME_PRESS_NS = 50 * MS
LAG_WINDOW_NS = 10_000 * MS
MOST_WAITING = 32


@dataclass(slots=True)
class Lag:
    """How late a page's words arrive, against the quickest of the last 10 to 20 s: clocks need not agree."""

    _best: float = float("inf")
    _before: float = float("inf")
    _since_ns: int = 0

    def sent_ns(self, page_ms: float, now_ns: int) -> int:
        """When the page sent what has arrived now; never later than now."""
        offset = now_ns - page_ms * MS
        if now_ns - self._since_ns > LAG_WINDOW_NS:
            self._before, self._best, self._since_ns = self._best, offset, now_ns
        self._best = min(self._best, offset)
        return min(now_ns, int(page_ms * MS + min(self._best, self._before)))


class Outbox:
    """What waits for the lane's `read`: filled by the web's thread, emptied by the lane's. Bounded by merging."""

    def __init__(self) -> None:
        self._waiting: deque[Message] = deque()
        self._changed = threading.Condition()
        self._seq = 0

    def alive(self, captured_ns: int, *, well: bool, reason: str = "") -> None:
        """A heartbeat; of several good ones in a row only the newest is worth sending, a bad one is always kept."""
        with self._changed:
            last = self._waiting[-1] if self._waiting else None
            if well and isinstance(last, Alive) and last.well:
                self._waiting.pop()
            self._put(Alive(seq=self._next(), captured_ns=captured_ns, well=well, reason=reason))

    def press(self, button: Button, captured_ns: int) -> None:
        """A button."""
        with self._changed:
            self._put(Press(seq=self._next(), captured_ns=captured_ns, button=button))

    def help(self, captured_ns: int) -> None:
        """A call for help."""
        with self._changed:
            self._put(Intent(seq=self._next(), captured_ns=captured_ns, command=Command.HELP, word="help"))

    def take(self, timeout_s: float) -> list[Message] | None:
        """All that waits, or None after timeout_s."""
        with self._changed:
            self._changed.wait_for(lambda: bool(self._waiting), timeout_s)
            messages = list(self._waiting)
            self._waiting.clear()
        return messages or None

    def _next(self) -> int:
        self._seq += 1
        return self._seq

    def _put(self, message: Message) -> None:
        if len(self._waiting) >= MOST_WAITING:  # nobody reads: the lane hangs, so keep only the newest that stop
            self._waiting = deque([m for m in self._waiting if _stops(m)][-4:])
        self._waiting.append(message)
        self._changed.notify_all()


def _stops(message: Message) -> bool:
    if isinstance(message, Press):
        return message.button is Button.STOP
    return isinstance(message, Alive) and not message.well


@dataclass(slots=True)
class Desk:
    """Of all pages at most one controls. Every page may stop and call for help; only the controlling one arms."""

    outbox: Outbox
    controller: int | None = None
    _beat_ns: int = 0
    _seen: bool = False
    _lag: dict[int, Lag] = field(default_factory=dict)
    _pressed: tuple[Button | None, int] = (None, 0)
    _helped_ns: int = 0

    def is_alive(self, now_ns: int) -> bool:
        """A page controls, can be seen, and has beaten within 500 ms."""
        return self.controller is not None and self._seen and now_ns - self._beat_ns <= LOST_NS

    def take(self, page: int, now_ns: int) -> bool:
        """Control for a page, if it is free; True when the page controls now."""
        self.check(now_ns)
        if self.controller is None:
            self.controller, self._beat_ns, self._seen = page, now_ns, False
        return self.controller == page

    def give(self, page: int, now_ns: int, reason: str) -> None:
        """The page controls no longer (it was closed, or gave control away): a stop device less, told at once."""
        if self.controller == page:
            self.controller, self._seen = None, False
            self.outbox.alive(now_ns, well=False, reason=reason)

    def leave(self, page: int, now_ns: int) -> None:
        """The page has gone."""
        self.give(page, now_ns, "the screen that controlled was closed")
        self._lag.pop(page, None)

    def hide(self, page: int, now_ns: int) -> None:
        """The page cannot be seen any more."""
        if self.controller == page and self._seen:
            self._seen = False
            self.outbox.alive(now_ns, well=False, reason="the screen that controls is hidden")

    def beat(self, page: int, page_ms: float, now_ns: int) -> None:
        """A heartbeat of a page, with the page's own clock."""
        sent_ns = self._lag.setdefault(page, Lag()).sent_ns(page_ms, now_ns)
        if self.controller != page or now_ns - sent_ns > LOST_NS:
            return
        due = not self._seen or sent_ns - self._beat_ns >= BEAT_GAP_NS
        if due:
            self._beat_ns, self._seen = max(sent_ns, self._beat_ns), True
            self.outbox.alive(sent_ns, well=True)

    def push(self, page: int, button: str, now_ns: int) -> str:
        """A button of a page; returns "" or the key of the sentence that says why it does nothing."""
        if button == "help":
            if now_ns - self._helped_ns >= 1000 * MS:
                self._helped_ns = now_ns
                self.outbox.help(now_ns)
            return ""
        pressed = Button(button)
        if pressed is not Button.STOP:
            if self.controller != page:
                return "refused.viewer"
            if not self._seen or now_ns - self._beat_ns > ARM_WITHIN_NS:
                return "refused.stutter"
        last, last_ns = self._pressed
        if pressed is not last or now_ns - last_ns >= SAME_PRESS_NS:  # the same, just handed on, says nothing new
            self._pressed = (pressed, now_ns)
            self.outbox.press(pressed, now_ns)
        return ""

    def check(self, now_ns: int) -> None:
        """Free the control of a page that has been silent for 500 ms."""
        if self.controller is not None and now_ns - self._beat_ns > LOST_NS:
            self.give(self.controller, now_ns, "the screen that controlled has been silent for 500 ms")

"""How the simulated person says one word: waits for its effect, repeats it, stops what is wrong, drives until a point.

Everything is a generator that yields once a tick: a word to say now, or None.
"""

from __future__ import annotations

from collections.abc import Callable, Generator
from dataclasses import dataclass, field
from math import hypot

Steps = Generator[str | None, None, None]
Asks = Generator[str | None, None, bool]

STOP_MM_S2 = 600.0
"""How a stop is expected to decelerate."""
PAUSE_S = 0.35
"""Least silence between two words."""
ANSWER_S = 1.6
"""How long after a word's end the person waits for its effect."""
RENEW_S = 4.5
"""How long after "front" the person says it again while driving."""
BLOCKED_MM = 700.0
"""Nearer than this the person understands that the chair will not go on."""
GIVE_UP_AFTER = 12
"""So many words without the wanted effect end a leg."""


@dataclass(frozen=True, slots=True, kw_only=True)
class View:
    """What the person sees and feels: time, where the chair is, how it moves, what is ahead and how far."""

    now_s: float
    x_mm: float
    y_mm: float
    heading_deg: float
    speed_mm_s: float
    turn_deg_s: float
    ahead_mm: float
    ahead_name: str


@dataclass(slots=True)
class Speaker:
    """Somebody who sees, speaks and presses buttons.

    duration_s(word, n): how long the n-th utterance lasts. said: how often each word was said. events: what happened.
    """

    duration_s: Callable[[str, int], float]
    said: dict[str, int] = field(default_factory=dict)
    utterances: int = 0
    events: list[str] = field(default_factory=list)
    arm_presses: int = 0
    reset_presses: int = 0
    view: View = field(init=False)
    _quiet_at_s: float = 0.0
    _ended_at_s: float = 0.0
    _front_at_s: float = -1e9
    _still_since_s: float | None = None
    _blocked_since_s: float | None = None
    _answer_s: float = 0.45
    _cruise_mm_s: float = 480.0

    def see(self, view: View) -> None:
        """Look: where the chair is, and since when it has stood or been held up."""
        self.view = view
        if abs(view.speed_mm_s) < 8.0 and abs(view.turn_deg_s) < 0.8:
            self._still_since_s = view.now_s if self._still_since_s is None else self._still_since_s
        else:
            self._still_since_s = None
        if view.ahead_mm < BLOCKED_MM and abs(view.speed_mm_s) < 40.0:
            self._blocked_since_s = view.now_s if self._blocked_since_s is None else self._blocked_since_s
        else:
            self._blocked_since_s = None

    def _wait(self, seconds: float) -> Steps:
        end = self.view.now_s + seconds
        while self.view.now_s < end:
            yield None

    def _still(self, for_s: float = 0.35) -> bool:
        return self._still_since_s is not None and self.view.now_s - self._still_since_s >= for_s

    def _blocked(self) -> bool:
        """Something is so near ahead, and the chair so slow for a while, that it has as good as stopped."""
        return self._blocked_since_s is not None and self.view.now_s - self._blocked_since_s >= 0.8

    def _until_still(self, timeout_s: float = 4.0, for_s: float = 0.3) -> Steps:
        end = self.view.now_s + timeout_s
        while not self._still(for_s) and self.view.now_s < end:
            yield None

    def _speak(self, word: str) -> Steps:
        """Say a word as soon as the last one is over, and wait until it is said."""
        while self.view.now_s < self._quiet_at_s:
            yield None
        yield word
        self._ended_at_s = self.view.now_s + self.duration_s(word, self.utterances)
        self._quiet_at_s = self._ended_at_s + PAUSE_S
        if word == "front":
            self._front_at_s = self.view.now_s

    def _effect(self, word: str) -> bool:
        v, w = self.view.speed_mm_s, self.view.turn_deg_s
        return {
            "front": v > 40.0,
            "back": v < -30.0,
            "reverse": v < -30.0,
            "left": w > 3.0,
            "right": w < -3.0,
            "stop": abs(v) < 25.0 and abs(w) < 2.0,
        }[word]

    def _wrong(self, word: str) -> bool:
        """The chair does clearly something else than `word` asked for."""
        v, w = self.view.speed_mm_s, self.view.turn_deg_s
        return {
            "front": v < -60.0 or (abs(w) > 12.0 and v < 40.0),
            "back": v > 60.0 or abs(w) > 12.0,
            "reverse": v > 60.0 or abs(w) > 12.0,
            "left": w < -4.0 or abs(v) > 60.0,
            "right": w > 4.0 or abs(v) > 60.0,
            "stop": False,
        }[word]

    def _order(self, word: str) -> Asks:
        """Say a word until it takes effect: True; False after too many tries."""
        for attempt in range(1, GIVE_UP_AFTER + 1):
            yield from self._speak(word)
            while self.view.now_s < self._ended_at_s + ANSWER_S:
                if self._effect(word):
                    return True
                if self._wrong(word) and self.view.now_s > self._ended_at_s + 0.3:
                    self.events.append(f"'{word}' was misheard")
                    yield from self._speak("stop")
                    yield from self._until_still()
                    break
                yield None
            if word == "front" and self._blocked() and attempt >= 2:
                return False
            if attempt % 2 == 0:  # a fault perhaps: reset first (only then, for it also forgets what was near)
                self.reset_presses += 1
                yield from self._wait(0.3)
            self.arm_presses += 1  # perhaps it was not ready for the first press
            yield from self._wait(0.3)
        self.events.append(f"gave up on '{word}'")
        return False

    def _halt(self) -> Steps:
        """Say "stop", and learn from the way it takes how long the chair needs to answer."""
        x0, y0, top = self.view.x_mm, self.view.y_mm, self.view.speed_mm_s
        word_s = self.duration_s("stop", self.utterances + 1)
        yield from self._speak("stop")
        while not self._still(0.15) and self.view.now_s < self._ended_at_s + ANSWER_S + 1.0:
            top = max(top, self.view.speed_mm_s)
            yield None
        if not self._effect("stop"):
            yield from self._order("stop")
            yield from self._until_still()
            return
        run = hypot(self.view.x_mm - x0, self.view.y_mm - y0)
        if top > 300.0:
            self._cruise_mm_s = max(self._cruise_mm_s, top)
            answer = (run - top * top / (2.0 * STOP_MM_S2)) / top - word_s
            self._answer_s += 0.5 * (min(1.2, max(0.1, answer)) - self._answer_s)

    def _stop_run_mm(self) -> float:
        """Way from beginning to say "stop" to standing."""
        v = max(self.view.speed_mm_s, self._cruise_mm_s)
        return v * (self.duration_s("stop", self.utterances + 1) + self._answer_s) + v * v / (2.0 * STOP_MM_S2)

    def _cruise(self, reached: Callable[[], bool]) -> Asks:
        """Drive forward until reached(): True, still rolling; False when the chair has stopped by itself."""
        needed = self.view.speed_mm_s < 40.0 or self.view.now_s - self._front_at_s > RENEW_S
        if needed and not (yield from self._order("front")):
            return False
        while not reached():
            if self._still() or self._blocked():
                return False
            near = self.view.ahead_mm < 1000.0 and self.view.speed_mm_s < 200.0
            if self.view.now_s - self._front_at_s > RENEW_S and self.view.now_s > self._quiet_at_s and not near:
                yield from self._speak("front")
            yield None
        return True

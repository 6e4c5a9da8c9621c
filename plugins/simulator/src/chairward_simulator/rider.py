"""The simulated person in the chair: a closed loop from what is seen to the next word.

The person knows the way, looks where the chair really is and says one word after the other, as a sensible user would:
waits until a word has taken effect, repeats it when it has not, says "stop" when something unwanted happens, renews
"front" in time. No word is on a timetable, so a word that is misheard costs time but never the tour.
Each leg of the tour is a generator that yields once a tick: a word to say now, or None.
"""

from __future__ import annotations

from collections.abc import Callable, Generator
from dataclasses import dataclass, field
from math import cos, hypot, radians, sin, tan

from chairward_simulator.home import Doorway, Drive, DriveUntil, Home, Leg, Say, Through, Turn

Steps = Generator[str | None, None, None]
Asks = Generator[str | None, None, bool]

STEP_DEG = 15.0
HALF_STEP_DEG = 9.0
BACK_MM = 300.0
"""What "left"/"right" and "back" do at once; only first guesses, the person looks at what came of them."""
STOP_MM_S2 = 600.0
SHORTEST_DRIVE_MM = 650.0
"""Less than this is hard to say "front", "stop" for."""
PAUSE_S = 0.35
"""Least silence between two words."""
ANSWER_S = 1.6
"""How long after a word's end the person waits for its effect."""
RENEW_S = 4.5
"""How long after "front" the person says it again while driving."""
BLOCKED_MM = 700.0
MISS_MM = 50.0
"""So far beside a doorway's middle is still good enough."""
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
class Rider:
    """Says words along the home's tour. `tick` once every 20 ms or so.

    duration_s(word, n): how long the n-th utterance lasts. arm_presses: how often the person has pressed "arm".
    """

    home: Home
    duration_s: Callable[[str, int], float]
    rear_mm: float = 450.0
    front_mm: float = 450.0
    arm_after_s: float = 1.0
    said: dict[str, int] = field(default_factory=dict)
    utterances: int = 0
    events: list[str] = field(default_factory=list)
    legs_done: int = 0
    arm_presses: int = 0
    reset_presses: int = 0
    finished: bool = False
    view: View = field(init=False)
    _quiet_at_s: float = 0.0
    _ended_at_s: float = 0.0
    _front_at_s: float = -1e9
    _still_since_s: float | None = None
    _blocked_since_s: float | None = None
    _answer_s: float = 0.45
    _cruise_mm_s: float = 480.0
    _mind: Steps = field(init=False)
    _course_deg: float = field(init=False)

    def __post_init__(self) -> None:
        self._mind = self._tour()
        self._course_deg = self.home.start.heading_deg

    def tick(self, view: View) -> str | None:
        """The word to say now, or None."""
        self.view = view
        if abs(view.speed_mm_s) < 8.0 and abs(view.turn_deg_s) < 0.8:
            self._still_since_s = view.now_s if self._still_since_s is None else self._still_since_s
        else:
            self._still_since_s = None
        if view.ahead_mm < BLOCKED_MM and abs(view.speed_mm_s) < 40.0:
            self._blocked_since_s = view.now_s if self._blocked_since_s is None else self._blocked_since_s
        else:
            self._blocked_since_s = None
        word = next(self._mind, None)
        if word is not None:
            self.said[word] = self.said.get(word, 0) + 1
            self.utterances += 1
        return word

    # ---------------------------------------------------------------- small things a person does
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

    # ---------------------------------------------------------------- the legs of the tour
    def _tour(self) -> Steps:
        yield from self._wait(self.arm_after_s)
        self.arm_presses += 1
        yield from self._wait(0.6)
        for leg in self.home.tour:
            yield from self._leg(leg)
            self.legs_done += 1
        if not self._still():
            yield from self._halt()
        self.finished = True

    def _leg(self, leg: Leg) -> Steps:
        match leg:
            case Drive():
                yield from self._drive(leg.mm)
            case Through():
                yield from self._through(self.home.door(leg.doorway))
            case DriveUntil():
                yield from self._drive_until(leg.stopped_by)
            case Turn():
                yield from self._turn(leg.to_deg)
            case Say():
                yield from self._until_still()
                if (yield from self._order(leg.word)):
                    yield from self._until_still()

    def _drive(self, mm: float) -> Steps:
        """Drive about that far and say "stop"; a stop on the way ends it too."""
        x0, y0 = self.view.x_mm, self.view.y_mm
        c, s = cos(radians(self.view.heading_deg)), sin(radians(self.view.heading_deg))

        def reached() -> bool:
            driven = c * (self.view.x_mm - x0) + s * (self.view.y_mm - y0)
            return driven + self._stop_run_mm() >= mm

        if (yield from self._cruise(reached)):
            yield from self._halt()

    def _off_course(self) -> float:
        """Degrees still to turn left to the heading meant."""
        return (self._course_deg - self.view.heading_deg + 180.0) % 360.0 - 180.0

    def _turn(self, to_deg: float) -> Steps:
        self._course_deg = to_deg
        yield from self._until_still()
        for _ in range(GIVE_UP_AFTER * 2):
            off = self._off_course()
            if abs(off) <= HALF_STEP_DEG:
                return
            yield from self._step("left" if off > 0 else "right")

    def _step(self, word: str) -> Steps:
        if (yield from self._order(word)):
            yield from self._until_still(for_s=0.12)

    def _drive_until(self, stopped_by: str) -> Steps:
        """Forward until the chair stops by itself before the thing meant; a person is waited for."""
        for _ in range(GIVE_UP_AFTER):
            if self._blocked() and self.view.ahead_name == stopped_by:
                break
            if abs(self._off_course()) > HALF_STEP_DEG:
                yield from self._turn(self._course_deg)
            if (yield from self._cruise(lambda: abs(self._off_course()) > HALF_STEP_DEG + 4.0)):
                yield from self._halt()
                continue
            yield from self._wait(0.3)
            if not self._still() and not self._blocked():
                continue
            name, far = self.view.ahead_name, self.view.ahead_mm
            if far > 1000.0:
                continue
            self.events.append(f"stopped by itself before the {name}")
            if name == "person":
                end = self.view.now_s + 20.0
                while self.view.ahead_name == "person" and self.view.ahead_mm < 1500.0 and self.view.now_s < end:
                    yield None
            if name == stopped_by:
                return
            if name != "person":
                self.events.append(f"but it was to be the {stopped_by}")
                return

    def _door_view(self, door: Doorway) -> tuple[float, float, float]:
        """(way to the door's plane, offset to the left of its axis, heading off its axis in degrees)."""
        c, s = cos(radians(door.heading_deg)), sin(radians(door.heading_deg))
        dx, dy = door.at[0] - self.view.x_mm, door.at[1] - self.view.y_mm
        off = (self.view.heading_deg - door.heading_deg + 180.0) % 360.0 - 180.0
        return c * dx + s * dy, s * dx - c * dy, off

    def _miss(self, door: Doorway) -> float:
        """By how much the chair would pass left of the door's middle if it went on straight."""
        way, left, off = self._door_view(door)
        return left + max(way, 0.0) * tan(radians(off))

    def _through(self, door: Doorway) -> Steps:
        """Line up in 15 degree steps and drive through; tries again, further back, when it does not fit."""
        self._course_deg = door.heading_deg
        for _ in range(GIVE_UP_AFTER):
            yield from self._turn(door.heading_deg)
            way = self._door_view(door)[0]
            if abs(self._miss(door)) <= MISS_MM:
                if (yield from self._pass(door)):
                    self.events.append(f"went through the {door.name}")
                    return
            elif way < self.front_mm + 1100.0:
                yield from self._step("back")
            else:
                yield from self._shift(door)
        self.events.append(f"did not get through the {door.name}")

    def _pass(self, door: Doorway) -> Asks:
        """Straight on until the whole chair is behind the door; False after a stop before it."""

        def behind() -> bool:
            return self._door_view(door)[0] < -(self.rear_mm + 120.0)

        def misses() -> bool:
            return self._door_view(door)[0] > self.front_mm + 700.0 and abs(self._miss(door)) > MISS_MM + 30.0

        rolling = yield from self._cruise(lambda: behind() or misses())
        if behind():
            return True
        if rolling:
            yield from self._halt()
        elif self._door_view(door)[0] < self.front_mm + 1200.0:
            self.events.append(f"stopped before the {door.name}")
            yield from self._step("back")
        return False

    def _shift(self, door: Doorway) -> Steps:
        """Sideways to the door's axis: a step aside, forward (or, for a little, back), and the step undone."""
        way, left, off = self._door_view(door)
        miss = self._miss(door)
        to_left = miss < 0
        a, after = radians(off + (STEP_DEG if to_left else -STEP_DEG)), radians(off)
        forward = -(left + way * tan(after)) / (sin(a) - cos(a) * tan(after))
        backing = forward < SHORTEST_DRIVE_MM
        first, second = ("left", "right") if to_left is not backing else ("right", "left")
        yield from self._step(first)
        if backing:
            for _ in range(max(1, round(abs(miss) / (BACK_MM * sin(radians(STEP_DEG)))))):
                yield from self._step("back")
        else:
            way, left, off = self._door_view(door)
            a = radians(off)
            slope = sin(a) - cos(a) * tan(after)
            if abs(slope) > 0.05:
                yield from self._drive(max(0.0, -(left + way * tan(after)) / slope))
        yield from self._step(second)

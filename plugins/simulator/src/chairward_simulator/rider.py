"""The simulated person in the chair: a closed loop from what is seen to the next word.

The person knows the way, looks where the chair really is and says one word after the other, as a sensible user would.
No word is on a timetable, so a word that is misheard costs time but never the tour.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from math import cos, radians, sin, tan

from chairward_simulator.home import Doorway, Drive, DriveUntil, Home, Leg, Say, Through, Turn
from chairward_simulator.speaker import GIVE_UP_AFTER, Asks, Speaker, Steps, View

STEP_DEG = 15.0
HALF_STEP_DEG = 9.0
BACK_MM = 300.0
"""What "left"/"right" and "back" do at once; only first guesses, the person looks at what came of them."""
SHORTEST_DRIVE_MM = 650.0
"""Less than this is hard to say "front", "stop" for."""
MISS_MM = 50.0
"""So far beside a doorway's middle is still good enough."""


@dataclass(slots=True)
class Rider(Speaker):
    """Says words along the home's tour. `tick` once every 20 ms or so.

    rear_mm, front_mm: the chair's, from its axle. legs_done, finished: how far the tour has come.
    """

    home: Home = field(kw_only=True)
    rear_mm: float = 450.0
    front_mm: float = 450.0
    arm_after_s: float = 1.0
    legs_done: int = 0
    finished: bool = False
    _mind: Steps = field(init=False)
    _course_deg: float = field(init=False)

    def __post_init__(self) -> None:
        self._mind = self._tour()
        self._course_deg = self.home.start.heading_deg

    def tick(self, view: View) -> str | None:
        """The word to say now, or None."""
        self.see(view)
        word = next(self._mind, None)
        if word is not None:
            self.said[word] = self.said.get(word, 0) + 1
            self.utterances += 1
        return word

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

    def _far(self) -> bool:
        """Nothing ahead is so near that the chair is about to avoid it."""
        return self.view.ahead_mm > 1000.0

    def _drive_until(self, stopped_by: str) -> Steps:
        """Forward until the chair stops by itself before the thing meant; a person is waited for."""
        for _ in range(GIVE_UP_AFTER):
            if self._blocked() and self.view.ahead_name == stopped_by:
                break
            if abs(self._off_course()) > HALF_STEP_DEG:
                yield from self._turn(self._course_deg)
            # Near a thing the chair turns slightly by itself; nobody says "stop" for that.
            if (yield from self._cruise(lambda: abs(self._off_course()) > HALF_STEP_DEG + 4.0 and self._far())):
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

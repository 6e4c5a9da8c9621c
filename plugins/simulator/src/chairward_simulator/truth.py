"""What really happened, judged from the world itself and not from what any sensor or rule said."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from math import cos, hypot, radians, sin
from typing import Any

from chairward.components import Footprint
from chairward_simulator.body import Body
from chairward_simulator.home import Doorway, Obstacle, obstacles
from chairward_simulator.nearness import FAR_MM, ahead, close_by, touching

MOVING_MM_S = 20.0
STANDING_MM_S = 5.0
CAUSE_WITHIN_MM = 900.0
SIGHT_MM = 3500.0
SAME_PLACE_MM = 60.0


@dataclass(slots=True)
class Stop:
    """One time the chair came to rest by itself while a "front" was the last word: what was ahead and how far."""

    at_s: float
    ahead_of: str
    distance_mm: float
    said_stop: bool


@dataclass(slots=True)
class Truth:
    """Statistics of a run; `look` about 25 times a second. Distances in mm from the footprint.

    nearest_ahead_mm: the least distance, while the chair itself was driving forward, to a thing at rest in its swept
    way. nearest_behind_mm: the same backward.
    """

    fixed: Sequence[Obstacle]
    footprint: Footprint
    doorways: Sequence[Doorway] = ()
    driven_mm: float = 0.0
    turned_deg: float = 0.0
    top_speed_mm_s: float = 0.0
    nearest_ahead_mm: float = FAR_MM
    nearest_ahead_of: str = ""
    nearest_behind_mm: float = FAR_MM
    collisions: list[str] = field(default_factory=list)
    stops: list[Stop] = field(default_factory=list)
    passed: list[dict[str, Any]] = field(default_factory=list)
    ahead_mm: float = FAR_MM
    ahead_of: str = ""
    _touched: str = ""
    _touched_at: tuple[float, float] = (0.0, 0.0)
    _was: Body | None = None
    _rolling: bool = False
    _last_word: str = ""
    _stops_at_door: dict[str, int] = field(default_factory=dict)

    def heard(self, word: str) -> None:
        """The person has said something."""
        self._last_word = word

    def look(self, now_s: float, body: Body, people: Sequence[Obstacle]) -> None:
        """Take the world's state into account."""
        pose = (body.x_mm, body.y_mm, body.heading_deg)
        near = [*close_by(self.fixed, body.x_mm, body.y_mm, SIGHT_MM), *people]
        self.ahead_mm, self.ahead_of = ahead(near, pose, self.footprint)
        if self._was is not None:
            self.driven_mm += hypot(body.x_mm - self._was.x_mm, body.y_mm - self._was.y_mm)
            self.turned_deg += abs((body.heading_deg - self._was.heading_deg + 180.0) % 360.0 - 180.0)
            self._doors(now_s, self._was, body)
        self.top_speed_mm_s = max(self.top_speed_mm_s, abs(body.speed_mm_s))
        resting = [o for o in near if not o.moving]
        if body.speed_mm_s > MOVING_MM_S:
            distance, name = ahead(resting, pose, self.footprint) if len(resting) < len(near) else (
                self.ahead_mm,
                self.ahead_of,
            )  # fmt: skip
            if distance < self.nearest_ahead_mm:
                self.nearest_ahead_mm, self.nearest_ahead_of = distance, name
        elif body.speed_mm_s < -MOVING_MM_S:
            distance, _ = ahead(resting, pose, self.footprint, backward=True)
            self.nearest_behind_mm = min(self.nearest_behind_mm, distance)
        self._stands(now_s, body)
        self._was = body

    def bumped(self, name: str, body: Body) -> None:
        """The footprint has touched `name`; pressing on against the same thing at the same place counts once."""
        if hypot(body.x_mm - self._touched_at[0], body.y_mm - self._touched_at[1]) > SAME_PLACE_MM:
            self._touched = ""
        if name and name != self._touched:
            self.collisions.append(name)
            self._touched, self._touched_at = name, (body.x_mm, body.y_mm)

    def _stands(self, now_s: float, body: Body) -> None:
        if body.speed_mm_s > 50.0:
            self._rolling = True
        elif self._rolling and abs(body.speed_mm_s) < STANDING_MM_S:
            self._rolling = False
            name = self.ahead_of if self.ahead_mm < CAUSE_WITHIN_MM else ""
            self.stops.append(Stop(now_s, name, self.ahead_mm, self._last_word != "front"))
            for door in self.doorways:
                if hypot(body.x_mm - door.at[0], body.y_mm - door.at[1]) < 1200.0:
                    self._stops_at_door[door.name] = self._stops_at_door.get(door.name, 0) + 1

    def _doors(self, now_s: float, was: Body, body: Body) -> None:
        """Note each passing of the axle's middle through a doorway, either way."""
        for door in self.doorways:
            c, s = cos(radians(door.heading_deg)), sin(radians(door.heading_deg))

            def along(b: Body, c: float = c, s: float = s, door: Doorway = door) -> float:
                return c * (b.x_mm - door.at[0]) + s * (b.y_mm - door.at[1])

            left = c * (body.y_mm - door.at[1]) - s * (body.x_mm - door.at[0])
            crossed = along(was) < 0.0 <= along(body) or along(was) > 0.0 >= along(body)
            if crossed and abs(left) < door.width_mm / 2:
                self.passed.append(
                    {
                        "doorway": door.name,
                        "at_s": round(now_s, 2),
                        "left_of_middle_mm": round(left),
                        "stops": self._stops_at_door.pop(door.name, 0),
                    }
                )

    def touches(self, body: Body, people: Sequence[Obstacle]) -> str:
        """Name of what the footprint is in, or ""."""
        near = [*close_by(self.fixed, body.x_mm, body.y_mm, 1200.0), *people]
        return touching(near, (body.x_mm, body.y_mm, body.heading_deg), self.footprint)

    def report(self) -> dict[str, Any]:
        """As JSON values."""
        protective = [s for s in self.stops if s.ahead_of and not s.said_stop]
        return {
            "driven_mm": round(self.driven_mm),
            "turned_deg": round(self.turned_deg),
            "top_speed_mm_s": round(self.top_speed_mm_s),
            "collisions": list(self.collisions),
            "nearest_ahead_mm": round(self.nearest_ahead_mm) if self.nearest_ahead_of else None,
            "nearest_ahead_of": self.nearest_ahead_of,
            "nearest_behind_mm": round(self.nearest_behind_mm) if self.nearest_behind_mm < FAR_MM else None,
            "stopped_before": [
                {"at_s": round(s.at_s, 2), "thing": s.ahead_of, "distance_mm": round(s.distance_mm)} for s in protective
            ],
            "other_stops": len(self.stops) - len(protective),
            "doorways_passed": list(self.passed),
        }


def of_home(home: Any, footprint: Footprint) -> Truth:
    """Truth of a `home.Home`."""
    return Truth(obstacles(home), footprint, home.doorway)

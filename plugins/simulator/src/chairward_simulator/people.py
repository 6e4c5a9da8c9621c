"""The other person in the home: walks into the chair's way, stands there, walks on. Never walks into the chair."""

from __future__ import annotations

from dataclasses import dataclass
from math import atan2, degrees, hypot

from chairward_simulator.home import Person, Point

MET_WITHIN_MM = 1200.0
"""Only a chair that has come to rest this near has met the person; one that hesitates farther away is waited for."""
STANDS_AT_MOST_S = 15.0


@dataclass(slots=True)
class Walker:
    """Where the person is and what they are about: waiting, coming, standing, leaving, gone."""

    plan: Person
    x_mm: float
    y_mm: float
    doing: str = "waiting"
    facing_deg: float = 90.0
    walked_mm: float = 0.0
    rested_s: float = 0.0
    stood_s: float = 0.0

    @classmethod
    def at_start(cls, plan: Person) -> Walker:
        """Waiting where the plan says."""
        return cls(plan, *plan.wait_at)

    @property
    def moving(self) -> bool:
        """On the way somewhere."""
        return self.doing in ("coming", "leaving")

    def step(self, dt_s: float, chair_x_mm: float, chair_speed_mm_s: float, room_mm: float) -> None:
        """dt_s later. room_mm: free way between the chair's footprint and the person; who walks keeps 250 mm."""
        if self.doing == "waiting" and chair_x_mm > self.plan.walks_when_chair_beyond_x_mm:
            self.doing = "coming"
        elif self.doing == "coming" and self._walk(self.plan.stand_at, dt_s, room_mm):
            self.doing = "standing"
        elif self.doing == "standing":
            self.stood_s += dt_s
            met = abs(chair_speed_mm_s) < 10.0 and room_mm < MET_WITHIN_MM
            self.rested_s = self.rested_s + dt_s if met else 0.0
            if self.rested_s >= self.plan.stands_s or self.stood_s >= STANDS_AT_MOST_S:
                self.doing = "leaving"
        elif self.doing == "leaving" and self._walk(self.plan.leave_to, dt_s, room_mm):
            self.doing = "gone"

    def _walk(self, to: Point, dt_s: float, room_mm: float) -> bool:
        """A step towards `to`; True on arrival."""
        dx, dy = to[0] - self.x_mm, to[1] - self.y_mm
        left, step = hypot(dx, dy), self.plan.speed_mm_s * dt_s
        if left <= step:
            self.x_mm, self.y_mm = to
            return True
        if room_mm < 250.0 and self.doing == "coming":
            return False
        self.facing_deg = degrees(atan2(dy, dx))
        self.x_mm += dx / left * step
        self.y_mm += dy / left * step
        self.walked_mm += step
        return False

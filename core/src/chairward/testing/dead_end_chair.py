"""A chair without pictures: sensors are rays, the body follows late and stands where it meets a wall."""

from __future__ import annotations

from collections import deque
from collections.abc import Sequence
from dataclasses import dataclass, field
from math import cos, hypot, inf, pi, radians, sin
from typing import Any

import numpy as np
from numpy.typing import NDArray

from chairward.components import STILL, Motion
from chairward.envelope import Caps
from chairward.facts import MS, Limits, S, SourceLimits
from chairward.messages import RangeReading, Way
from chairward.testing.dead_end_place import FRONT_MM, HALF_MM, MARGIN_MM, REAR_MM, DeadEnd, Segments, rays, touches
from chairward.testing.ride import AHEAD_AND_SIDES, chair_limits

FAR_MM = 5_000
CORNERS = np.array([(FRONT_MM, HALF_MM), (FRONT_MM, -HALF_MM), (-REAR_MM, -HALF_MM), (-REAR_MM, HALF_MM)])
TICK_NS = 40 * MS
"""Between two decisions; a guard takes 20 ms at most."""
ACTING_TICKS = 2


@dataclass(frozen=True, slots=True, kw_only=True)
class Ranger:
    """A sensor: where it sits, which way it looks, how wide, and the ways the chair file declares for it."""

    name: str
    x_mm: float
    y_mm: float
    yaw: float
    half_view: float
    covers: frozenset[Way]


RAYS = np.linspace(-1.0, 1.0, 31)
CAMERA = Ranger(name="front/range", x_mm=FRONT_MM, y_mm=0.0, yaw=0.0, half_view=radians(40), covers=AHEAD_AND_SIDES)
REAR = Ranger(name="rear/sonar", x_mm=-REAR_MM, y_mm=0.0, yaw=pi, half_view=radians(60), covers=frozenset({Way.BEHIND}))
SIDES = tuple(
    Ranger(name=f"{way}/sonar", x_mm=0.0, y_mm=y, yaw=yaw, half_view=radians(75), covers=frozenset({way}))
    for way, y, yaw in ((Way.LEFT, HALF_MM, pi / 2), (Way.RIGHT, -HALF_MM, -pi / 2))
)
CHAIRS: dict[str, tuple[Ranger, ...]] = {"camera": (CAMERA,), "all round": (CAMERA, REAR, *SIDES)}
"""What the simulated chair of the shipped profile has, and a chair with sonars all round."""


def limits_of(rangers: Sequence[Ranger]) -> Limits:
    """The shipped speeds; a way that no sensor watches is slow."""
    toe_deg_s = 150.0 / hypot(FRONT_MM, HALF_MM) / pi * 180.0
    return chair_limits(
        sensors={r.name: SourceLimits(freshness_ns=200 * MS, covers=r.covers) for r in rangers},
        caps=Caps(500.0, 150.0, 20.0, 20.0),
        unseen=Caps(0.0, 150.0, toe_deg_s, toe_deg_s),
    )


@dataclass(slots=True, kw_only=True)
class Body:
    """Where the chair is and how it moves; it follows a command after a few ticks, and stands where it meets a wall."""

    x: float
    y: float
    heading: float
    speed: float = 0.0
    turn: float = 0.0
    touched: int = 0
    _coming: deque[Motion] = field(default_factory=lambda: deque([STILL] * ACTING_TICKS))

    def step(self, motion: Motion, walls: Segments, decel_mm_s2: float) -> None:
        """One tick."""
        self._coming.append(motion)
        wanted, dt = self._coming.popleft(), TICK_NS / S
        most = decel_mm_s2 * dt
        self.speed = max(self.speed - most, min(self.speed + most, wanted.drive_mm_s))
        self.turn = radians(wanted.turn_deg_s)
        if not self.speed and not self.turn:
            return
        heading = self.heading + self.turn * dt
        x, y = self.x + self.speed * cos(heading) * dt, self.y + self.speed * sin(heading) * dt
        if touches(walls, x, y, heading):
            self.touched += 1
            self.speed = self.turn = 0.0
        else:
            self.x, self.y, self.heading = x, y, heading

    def corners(self) -> NDArray[np.float64]:
        """Of the footprint, in the world."""
        c, s = cos(self.heading), sin(self.heading)
        return np.asarray(CORNERS @ np.array([[c, s], [-s, c]]) + (self.x, self.y))


def reading(ranger: Ranger, body: Body, place: DeadEnd, walls: Segments, now_ns: int, seq: int) -> RangeReading:
    """What that sensor says now: the nearest point each way, from the footprint's outline."""
    c, s = cos(body.heading), sin(body.heading)
    x, y = body.x + ranger.x_mm * c - ranger.y_mm * s, body.y + ranger.x_mm * s + ranger.y_mm * c
    angles = ranger.yaw + ranger.half_view * RAYS
    camera = Way.AHEAD in ranger.covers
    far = rays(np.concatenate([walls, place.low]) if not camera else walls, x, y, angles + body.heading)
    if camera:
        low = rays(place.low, x, y, angles + body.heading)
        far = np.minimum(far, np.where(low < place.lost_mm, inf, low))
    px, py = ranger.x_mm + far * np.cos(angles), ranger.y_mm + far * np.sin(angles)
    beyond = np.maximum(np.maximum(px - FRONT_MM, -REAR_MM - px), 0.0)
    beside = np.maximum(np.abs(py) - HALF_MM, 0.0)
    before = np.abs(py) <= HALF_MM + MARGIN_MM
    away = np.hypot(beyond, beside)
    ways: dict[Way, NDArray[np.bool_]] = {
        Way.AHEAD: before & (px > FRONT_MM),
        Way.BEHIND: before & (px < -REAR_MM),
        Way.LEFT: ~before & (py > 0.0),
        Way.RIGHT: ~before & (py < 0.0),
    }
    said = {way: int(min(FAR_MM, np.min(away[ways[way]], initial=FAR_MM))) for way in ranger.covers}
    if camera and said[Way.AHEAD] < place.plain_mm:
        return RangeReading(seq=seq, captured_ns=now_ns, can_see=False, reason="plain wall")
    fields: dict[str, Any] = {f"{way}_mm": mm for way, mm in said.items()}
    return RangeReading(seq=seq, captured_ns=now_ns, can_see=True, **fields)

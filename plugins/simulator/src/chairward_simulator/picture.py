"""A picture of the home for people: its plan with the tour's events, and what the chair's cameras see at the start."""

from __future__ import annotations

import cv2
import numpy as np

from chairward.components import Footprint, Pose
from chairward.stages import Image
from chairward_simulator.home import Home, Obstacle, Point, obstacles
from chairward_simulator.scene import StereoCamera

SCALE = 0.1
"""Pixels a millimetre."""
MARGIN_PX = 24
WALL, THING, STEP, PERSON, CHAIR, TEXT = (
    (90, 90, 90),
    (170, 140, 110),
    (60, 60, 200),
    (40, 140, 40),
    (200, 110, 20),
    (0,) * 3,
)
Colour = tuple[int, ...]


class Plan:
    """The home from above, north up."""

    def __init__(self, home: Home) -> None:
        xs = [x for floor in home.floor for x in floor.x]
        ys = [y for floor in home.floor for y in floor.y]
        self._left, self._top = min(xs), max(ys)
        size = (round((max(ys) - min(ys)) * SCALE) + 2 * MARGIN_PX, round((max(xs) - min(xs)) * SCALE) + 2 * MARGIN_PX)
        self.image: Image = np.full((*size, 3), 245, dtype=np.uint8)
        walls = {wall.name for wall in home.wall}
        steps = {floor.name for floor in home.floor if floor.z < 0}
        for thing in obstacles(home):
            self._shape(thing, STEP if thing.name in steps else WALL if thing.name in walls else THING)
            if thing.name not in walls and not thing.name.startswith("table leg"):
                self._label(thing.name, thing.points[0])
        if home.person is not None:
            way = (home.person.wait_at, home.person.stand_at, home.person.leave_to)
            self.route(way, PERSON)
            self._label("person", home.person.stand_at)

    def at(self, point: Point) -> tuple[int, int]:
        """Column and row of a point of the home."""
        return MARGIN_PX + round((point[0] - self._left) * SCALE), MARGIN_PX + round((self._top - point[1]) * SCALE)

    def route(self, points: tuple[Point, ...], colour: Colour) -> None:
        """A line through points."""
        line = np.array([self.at(p) for p in points], dtype=np.int32)
        cv2.polylines(self.image, [line], isClosed=False, color=colour, thickness=2, lineType=cv2.LINE_AA)

    def chair(self, x_mm: float, y_mm: float, heading_deg: float, footprint: Footprint) -> None:
        """The footprint's outline at a pose."""
        c, s = np.cos(np.radians(heading_deg)), np.sin(np.radians(heading_deg))
        ends = [(footprint.front_mm, 1), (footprint.front_mm, -1), (-footprint.rear_mm, -1), (-footprint.rear_mm, 1)]
        corners = [(u, side * footprint.half_width_mm) for u, side in ends]
        points = [self.at((x_mm + c * u - s * v, y_mm + s * u + c * v)) for u, v in corners]
        cv2.polylines(self.image, [np.array(points, dtype=np.int32)], isClosed=True, color=CHAIR, thickness=2)

    def _shape(self, thing: Obstacle, colour: Colour) -> None:
        if thing.radius_mm:
            cv2.circle(self.image, self.at(thing.points[0]), round(thing.radius_mm * SCALE), colour, -1, cv2.LINE_AA)
        else:
            points = np.array([self.at(p) for p in thing.points], dtype=np.int32)
            cv2.fillConvexPoly(self.image, points, colour, lineType=cv2.LINE_AA)

    def _label(self, text: str, at: Point) -> None:
        column, row = self.at(at)
        cv2.putText(self.image, text, (column + 3, row - 3), cv2.FONT_HERSHEY_SIMPLEX, 0.36, TEXT, 1, cv2.LINE_AA)


def draw(home: Home, footprint: Footprint, route: tuple[Point, ...] = ()) -> Image:
    """Plan (with the chair at its start, and a route when given) above the stereo pair from there."""
    plan = Plan(home)
    if len(route) > 1:
        plan.route(route, CHAIR)
    plan.chair(home.start.x_mm, home.start.y_mm, home.start.heading_deg, footprint)
    camera = StereoCamera(home, Pose(x_mm=footprint.front_mm, z_mm=400.0))
    pair = np.hstack(camera.pair(home.start.x_mm, home.start.y_mm, home.start.heading_deg))
    width = plan.image.shape[1]
    size = (width, round(pair.shape[0] * width / pair.shape[1]))
    shown = np.asarray(cv2.resize(pair, size, interpolation=cv2.INTER_LINEAR), dtype=np.uint8)
    return np.vstack([plan.image, shown])

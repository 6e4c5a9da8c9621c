"""The simulated home: what `home.toml` says, checked, as plain shapes. Millimetres, degrees, anticlockwise."""

from __future__ import annotations

import tomllib
from dataclasses import dataclass
from math import atan2, cos, degrees, hypot, radians, sin
from pathlib import Path
from typing import Annotated, Literal

from pydantic import BaseModel, ConfigDict, Field, ValidationError

Point = tuple[float, float]
HOME_FILE = Path(__file__).with_name("home.toml")


class _Part(BaseModel):
    model_config = ConfigDict(extra="forbid", frozen=True, allow_inf_nan=False)


class Start(_Part):
    """Where the middle of the chair's axle is at the beginning."""

    x_mm: float
    y_mm: float
    heading_deg: float


class Floor(_Part):
    """A rectangle of floor; z below 0 is a step down, which counts as an obstacle."""

    name: str
    x: Point
    y: Point
    texture: str
    z: float = 0.0


class Wall(_Part):
    """A wall along a line from end to end (thickness to both sides of it)."""

    name: str
    from_: Point = Field(alias="from")
    to: Point
    texture: str
    thickness: float = 100.0
    bottom: float = 0.0
    height: float | None = None


class Box(_Part):
    """A cuboid: middle of its base, size in x, y, z before it is turned."""

    name: str
    at: Point
    size: tuple[float, float, float]
    texture: str
    bottom: float = 0.0
    turned_deg: float = 0.0


class Cylinder(_Part):
    """An upright cylinder."""

    name: str
    at: Point
    radius: float
    height: float
    texture: str
    bottom: float = 0.0


class Person(_Part):
    """Somebody who walks into the chair's way, stands there until it has been at rest for a while, and walks on."""

    wait_at: Point
    stand_at: Point
    leave_to: Point
    walks_when_chair_beyond_x_mm: float
    speed_mm_s: float = Field(gt=0, le=3000)
    stands_s: float = Field(ge=0)


class Doorway(_Part):
    """An opening, its middle, the heading in which it is passed and its clear width."""

    name: str
    at: Point
    heading_deg: float
    width_mm: float


class Drive(_Part):
    """Say "front", and "stop" when about `mm` have been driven."""

    do: Literal["drive"]
    mm: float = Field(gt=0)


class Through(_Part):
    """Line up with a doorway and drive through it until the whole chair is behind it."""

    do: Literal["through"]
    doorway: str


class DriveUntil(_Part):
    """Say "front" until the chair stops by itself before `stopped_by`."""

    do: Literal["drive_until"]
    stopped_by: str


class Turn(_Part):
    """Say "left" or "right" until the chair looks that way (to half a step)."""

    do: Literal["turn"]
    to_deg: float


class Say(_Part):
    """Say one word that is one step (back, reverse) and wait until it has been done."""

    do: Literal["say"]
    word: Literal["back", "reverse", "left", "right"]


Leg = Annotated[Drive | Through | DriveUntil | Turn | Say, Field(discriminator="do")]


class Home(_Part):
    """Everything that stands in the home, who walks in it, and the tour."""

    name: str
    ceiling_mm: float = 2500.0
    start: Start
    floor: tuple[Floor, ...]
    wall: tuple[Wall, ...] = ()
    box: tuple[Box, ...] = ()
    cylinder: tuple[Cylinder, ...] = ()
    person: Person | None = None
    doorway: tuple[Doorway, ...] = ()
    tour: tuple[Leg, ...] = ()

    def door(self, name: str) -> Doorway:
        """The doorway of that name. Raises KeyError."""
        for doorway in self.doorway:
            if doorway.name == name:
                return doorway
        raise KeyError(f"home '{self.name}' has no doorway '{name}': name one of its [[doorway]] tables")


class HomeError(ValueError):
    """A home file that cannot be used: file, key, and what is wrong."""


def load(path: Path = HOME_FILE) -> Home:
    """Read and check a home file. Raises HomeError with file and key."""
    try:
        home = Home.model_validate(tomllib.loads(path.read_text("utf-8")))
    except OSError as error:
        raise HomeError(f"{path}: cannot be read as a home ({error.strerror}): check the path") from error
    except (tomllib.TOMLDecodeError, UnicodeDecodeError) as error:
        raise HomeError(f"{path}: cannot be read as a home ({error}): correct the file at that place") from error
    except ValidationError as error:
        first = error.errors()[0]
        raise HomeError(f"{path}: {'.'.join(map(str, first['loc']))}: {first['msg']}") from error
    known = {thing.name for thing in obstacles(home)} | {"person"}
    for leg in home.tour:
        if isinstance(leg, DriveUntil) and leg.stopped_by not in known:
            raise HomeError(f"{path}: tour: nothing is named '{leg.stopped_by}'")
        if isinstance(leg, Through) and leg.doorway not in {d.name for d in home.doorway}:
            raise HomeError(f"{path}: tour: there is no doorway '{leg.doorway}'")
    return home


@dataclass(frozen=True, slots=True)
class Obstacle:
    """Something seen from above: a convex polygon (anticlockwise) or, with `radius_mm`, a circle about `points[0]`."""

    name: str
    points: tuple[Point, ...]
    radius_mm: float = 0.0
    moving: bool = False


def wall_as_box(wall: Wall, ceiling_mm: float) -> Box:
    """The wall as the cuboid it is."""
    (ax, ay), (bx, by) = wall.from_, wall.to
    height = wall.height if wall.height is not None else ceiling_mm - wall.bottom
    return Box(
        name=wall.name,
        at=((ax + bx) / 2, (ay + by) / 2),
        size=(hypot(bx - ax, by - ay), wall.thickness, height),
        bottom=wall.bottom,
        turned_deg=degrees(atan2(by - ay, bx - ax)),
        texture=wall.texture,
    )


def corners(box: Box) -> tuple[Point, Point, Point, Point]:
    """The four corners of a box from above, anticlockwise."""
    c, s = cos(radians(box.turned_deg)), sin(radians(box.turned_deg))
    hx, hy = box.size[0] / 2, box.size[1] / 2
    x, y = box.at

    def corner(u: float, v: float) -> Point:
        return x + c * u - s * v, y + s * u + c * v

    return corner(-hx, -hy), corner(hx, -hy), corner(hx, hy), corner(-hx, hy)


def obstacles(home: Home, tall_mm: float = 1400.0) -> list[Obstacle]:
    """All that the chair and its user (up to tall_mm) can hit, and the steps they can fall down."""
    cuboids = [*home.box, *(wall_as_box(wall, home.ceiling_mm) for wall in home.wall)]
    found = [Obstacle(box.name, corners(box)) for box in cuboids if box.bottom < tall_mm]
    found += [Obstacle(c.name, (c.at,), c.radius) for c in home.cylinder if c.bottom < tall_mm]
    for floor in home.floor:
        if floor.z < 0:
            (x0, x1), (y0, y1) = floor.x, floor.y
            found.append(Obstacle(floor.name, ((x0, y0), (x1, y0), (x1, y1), (x0, y1))))
    return found


PERSON_RADIUS_MM = 230.0


def person_obstacle(x_mm: float, y_mm: float, *, moving: bool) -> Obstacle:
    """The walking person from above."""
    return Obstacle("person", ((x_mm, y_mm),), PERSON_RADIUS_MM, moving)

"""What stands where: random rooms before a chair at x = 0, looking along x (x forward, y left, z up, mm).

Rooms differ in size, materials, light, shadows, gloss, rugs and furniture; one thing stands in the way, or none does.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from math import cos, radians, sin, tan

import numpy as np
import numpy.typing as npt
from surfaces import Atlas

Floats = npt.NDArray[np.float64]
FLOOR, WALL, BELOW, THING, FURNITURE = 0, 2, 3, 10, 50
"""Ids: floor with rugs, walls, what lies below a drop, the thing in the way, furniture."""
CEILING_MM = 2500.0
FLOORS = ("plain", "tiles", "tiles", "pattern", "planks", "carpet", "terrazzo")
WALLS = ("plain", "plaster", "plaster", "plaster", "brick")


@dataclass(frozen=True, slots=True)
class Patch:
    """A convex patch of light or shadow on the floor: corners (n x 2, anticlockwise), factor, width of its rim."""

    corners: Floats
    factor: float
    rim_mm: float


@dataclass(slots=True)
class Room:
    """Faces and cylinders in the columns of `chairward_simulator.render`, and the light. gloss: the floor's, 0..1."""

    faces: list[list[float]] = field(default_factory=list)
    cylinders: list[list[float]] = field(default_factory=list)
    lamp: list[float] = field(default_factory=list)
    patches: list[Patch] = field(default_factory=list)
    gloss: float = 0.0
    materials: str = ""

    def quad(self, at: tuple[float, float, float], e1: Floats, length: float, e2: Floats, height: float, texture: int,
             thing: int, origin: float = 0.0) -> None:  # fmt: skip
        """A rectangle; its visible side is where e1 x e2 points."""
        row = [*at, *e1, *e2, *np.cross(e1, e2), length, height, texture, origin, origin, 0, thing]
        self.faces.append([float(v) for v in row])

    def level(self, x: tuple[float, float], y: tuple[float, float], z: float, texture: int, thing: int) -> None:
        """A horizontal rectangle, seen from above."""
        self.quad((x[0], y[0], z), np.eye(3)[0], x[1] - x[0], np.eye(3)[1], y[1] - y[0], texture, thing)

    def box(
        self, x: float, y: float, size: tuple[float, float, float], texture: int, thing: int = THING,
        bottom: float = 0.0, turned_deg: float = 0.0, shadow: float = 0.6,
    ) -> None:  # fmt: skip
        """A cuboid whose front's middle is at x, y before it is turned about its own middle; size: deep, wide, high.

        It darkens the floor around it to `shadow`.
        """
        c, s = cos(radians(turned_deg)), sin(radians(turned_deg))
        along, across, up = np.array([c, s, 0.0]), np.array([-s, c, 0.0]), np.array([0.0, 0.0, 1.0])
        middle, u, v = np.array([x + size[0] / 2, y, bottom]), along * size[0] / 2, across * size[1] / 2
        ring = [middle - u - v, middle + u - v, middle + u + v, middle - u + v]
        origin = abs(x * 7 + y * 13) % 1000
        for a, b in zip(ring, ring[1:] + ring[:1], strict=True):
            length = float(np.linalg.norm(b - a))
            self.quad(_point(a), (b - a) / length, length, up, size[2], texture, thing, origin)
        self.quad(_point(ring[0] + up * size[2]), along, size[0], across, size[1], texture, thing, origin)
        if bottom > 0:
            self.quad(_point(ring[1]), -along, size[0], across, size[1], texture, thing, origin)
        if shadow < 1.0 and bottom < 50:
            self.patches.append(Patch(np.array([p[:2] for p in ring]), shadow, 80.0))

    def post(self, x: float, y: float, radius: float, bottom: float, top: float, texture: int) -> None:
        """An upright cylinder whose front is at x."""
        self.cylinders.append([x + radius, y, radius, bottom, top, texture, x + y, 0, THING])


def _point(p: Floats) -> tuple[float, float, float]:
    return float(p[0]), float(p[1]), float(p[2])


def room(rng: np.random.Generator, atlas: Atlas, obstacle: str, distance_mm: float) -> Room:
    """A random room with `obstacle` (a key of THINGS or RARE, or "none") so far from the lens."""
    out = Room()
    floor = atlas.pick(rng, *FLOORS)
    far = rng.uniform(2800, 6500) if distance_mm < 2500 else distance_mm + rng.uniform(500, 3000)
    sides = rng.uniform(650, 2600), rng.uniform(650, 2600)
    out.materials = atlas.names[floor]
    end = (THINGS | RARE)[obstacle](out, rng, atlas, distance_mm, floor) if obstacle != "none" else None
    out.level((-2500, end if end is not None else far), (-sides[1], sides[0]), 0.0, floor, FLOOR)
    _walls(out, rng, atlas, far, sides)
    if obstacle not in ("drop", "stairs") and rng.random() < 0.3:
        x, y = rng.uniform(500, 2500), rng.uniform(-500, 500)
        out.level((x, x + rng.uniform(600, 2000)), (y - rng.uniform(300, 900), y + rng.uniform(300, 900)), 6.0,
                  atlas.pick(rng, "rug", "carpet", "pattern"), FLOOR)  # fmt: skip
    _furniture(out, rng, atlas, far, sides)
    _light(out, rng, far, sides)
    out.gloss = float(rng.uniform(0.1, 0.35)) if rng.random() < 0.3 else 0.0
    return out


def _walls(out: Room, rng: np.random.Generator, atlas: Atlas, far: float, sides: tuple[float, float]) -> None:
    forward, left, up = np.eye(3)
    side, end = atlas.pick(rng, *WALLS), atlas.pick(rng, *WALLS)
    out.quad((-2500, -sides[1], -900), forward, far + 2500, -up, -CEILING_MM - 900, side, WALL)
    out.faces[-1] = _wall((-2500.0, sides[0]), (far, sides[0]), side, -left)
    out.faces.append(_wall((-2500.0, -sides[1]), (far, -sides[1]), side, left))
    out.faces.append(_wall((far, -sides[1]), (far, sides[0]), end, -forward))
    out.quad((-2500, -sides[1], CEILING_MM), left, sum(sides), forward, far + 2500, atlas.pick(rng, "plain"), WALL)
    for _ in range(int(rng.integers(1, 5))):  # pictures, doors, shelves on the walls
        wide, high = rng.uniform(250, 1000), rng.uniform(300, 2000)
        bottom = 0.0 if high > 1500 else rng.uniform(300, 1100)
        texture = atlas.pick(rng, "print", "planks", "plain", "fabric")
        if rng.random() < 0.5:
            out.box(
                far - 40, rng.uniform(-sides[1], sides[0]) * 0.7, (40, wide, high), texture, WALL, bottom, shadow=1.0
            )
        else:
            y = sides[0] - 15 if rng.random() < 0.5 else 15 - sides[1]
            out.box(rng.uniform(200, far - 1000), y, (wide, 30, high), texture, WALL, bottom, shadow=1.0)


def _wall(start: tuple[float, float], end: tuple[float, float], texture: int, normal: Floats) -> list[float]:
    """An upright rectangle from below the floor to the ceiling whose visible side looks along `normal`."""
    a, b = np.array([*start, -900.0]), np.array([*end, -900.0])
    length, up = float(np.linalg.norm(b - a)), np.array([0.0, 0.0, 1.0])
    along = (b - a) / length
    if float(np.cross(along, up) @ normal) < 0:
        a, along = b, -along
    return [float(v) for v in [*a, *along, *up, *normal, length, CEILING_MM + 900, texture, 311, 0, 0, WALL]]


def _furniture(out: Room, rng: np.random.Generator, atlas: Atlas, far: float, sides: tuple[float, float]) -> None:
    for side in (1, -1):
        reach = sides[0] if side > 0 else sides[1]
        for _ in range(int(rng.integers(0, 4))):
            deep, high = rng.uniform(250, 600), rng.uniform(350, 1900)
            inner = reach - deep
            if inner < 480:
                continue
            texture = atlas.pick(rng, "planks", "fabric", "plain", "print")
            size = (rng.uniform(300, 1300), deep, high)
            out.box(rng.uniform(300, far - 800), side * (inner + deep / 2), size, texture, FURNITURE)


def _light(out: Room, rng: np.random.Generator, far: float, sides: tuple[float, float]) -> None:
    x, y = rng.uniform(-800, 0.7 * far), rng.uniform(-0.8 * sides[1], 0.8 * sides[0])
    ambient = rng.uniform(0.25, 0.7)
    out.lamp = [x, y, rng.uniform(1900, 2400), ambient, rng.uniform(0.6, 1.3) * (1.1 - ambient)]
    for _ in range(
        int(rng.choice([0, 0, 1, 2, 3]))
    ):  # sun through a window; the shadow of something not in the picture
        at, turned = np.array([rng.uniform(400, 3000), rng.uniform(-900, 900)]), rng.uniform(0, np.pi)
        long, wide = rng.uniform(200, 900), rng.uniform(80, 500)
        u, v = np.array([np.cos(turned), np.sin(turned)]), np.array([-np.sin(turned), np.cos(turned)])
        ring = [at + i * long * u + j * wide * v for i, j in ((-1, -1), (1, -1), (1, 1), (-1, 1))]
        factor = rng.uniform(1.3, 1.9) if rng.random() < 0.5 else rng.uniform(0.35, 0.75)
        out.patches.append(Patch(np.array(ring), factor, rng.uniform(3, 60)))


# Things in the way. Each is put `x` mm before the lens and says where the floor ends, if it does.


def _box(out: Room, rng: np.random.Generator, atlas: Atlas, x: float, *kinds: str) -> None:
    size = (rng.uniform(200, 500), rng.uniform(200, 600), rng.uniform(350, 1300))
    out.box(x, rng.uniform(-140, 140), size, atlas.pick(rng, *kinds), turned_deg=rng.uniform(-12, 12))


def _wall_ahead(out: Room, rng: np.random.Generator, atlas: Atlas, x: float, *kinds: str) -> None:
    out.box(x, 0.0, (60, 5000, CEILING_MM), atlas.pick(rng, *kinds), turned_deg=rng.uniform(-8, 8), shadow=1.0)


def _corner(out: Room, rng: np.random.Generator, atlas: Atlas, x: float) -> None:
    """A cupboard seen at its edge."""
    side = rng.uniform(300, 600)
    out.box(x, rng.uniform(-100, 100), (side * 0.7071 * 2, side, rng.uniform(700, 1900)),
            atlas.pick(rng, "planks", "print", "plaster"), turned_deg=45.0)  # fmt: skip


def _column(out: Room, rng: np.random.Generator, atlas: Atlas, x: float) -> None:
    texture = atlas.pick(rng, "plaster", "plain", "print", "fabric")
    out.post(x, rng.uniform(-120, 120), rng.uniform(60, 220), 0, CEILING_MM, texture)


def _chair(out: Room, rng: np.random.Generator, atlas: Atlas, x: float) -> None:
    texture, y = atlas.pick(rng, "planks", "plain", "fabric"), rng.uniform(-150, 150)
    for dx in (0.0, 380.0):
        for dy in (-190.0, 190.0):
            out.post(x + dx, y + dy, rng.uniform(12, 22), 0, 450, texture)
    out.box(x, y, (420, 420, 40), texture, bottom=440)
    out.box(x + 390 if rng.random() < 0.5 else x, y, (30, 420, 480), texture, bottom=470)


def _table(out: Room, rng: np.random.Generator, atlas: Atlas, x: float) -> None:
    texture, wide = atlas.pick(rng, "planks", "plain", "print"), rng.uniform(600, 1300)
    for dx in (20.0, 600.0):
        for dy in (-wide / 2 + 60, wide / 2 - 60):
            out.box(x + dx, dy, (50, 50, 700), texture)
    out.box(x, 0.0, (700, wide, 40), texture, bottom=700)
    if rng.random() < 0.6:  # a cloth that hangs down
        out.box(x, 0.0, (700, wide, rng.uniform(150, 450)), atlas.pick(rng, "fabric", "rug"), bottom=290)


def _overhang(out: Room, rng: np.random.Generator, atlas: Atlas, x: float) -> None:
    """A shelf, a bench, an open drawer: nothing below it."""
    out.box(x, rng.uniform(-100, 100), (400, rng.uniform(500, 1200), rng.uniform(40, 140)),
            atlas.pick(rng, "planks", "print", "fabric"), bottom=rng.uniform(250, 400))  # fmt: skip


def _person(out: Room, rng: np.random.Generator, atlas: Atlas, x: float) -> None:
    y, legs, coat = rng.uniform(-120, 120), atlas.pick(rng, "fabric", "plain"), atlas.pick(rng, "fabric")
    for dy in (-95.0, 95.0):
        out.post(x + 60, y + dy, rng.uniform(55, 80), 0, 850, legs)
    out.post(x, y, 190, 700 if rng.random() < 0.6 else 350, 1450, coat)
    out.post(x + 90, y, 95, 1450, 1720, atlas.pick(rng, "plain"))


def _sofa(out: Room, rng: np.random.Generator, atlas: Atlas, x: float) -> None:
    texture = atlas.pick(rng, "fabric", "rug", "plain")
    out.box(x, rng.uniform(-300, 300), (800, rng.uniform(1000, 2000), 420), texture, turned_deg=rng.uniform(-10, 10))
    out.box(x + 600, 0.0, (200, 1500, 800), texture)


def _frame(out: Room, rng: np.random.Generator, atlas: Atlas, x: float) -> None:
    """An open door seen at its edge."""
    y, texture = rng.uniform(-60, 60), atlas.pick(rng, "plain", "planks", "plaster")
    out.box(x, y, (800, 40, 2000), texture, turned_deg=rng.uniform(-20, 20))


def _low_box(out: Room, rng: np.random.Generator, atlas: Atlas, x: float) -> None:
    size, texture = (rng.uniform(150, 400), rng.uniform(180, 500), 120.0), atlas.pick(rng, "print", "planks", "fabric")
    out.box(x, rng.uniform(-120, 120), size, texture, turned_deg=rng.uniform(-15, 15))


def _cable(out: Room, rng: np.random.Generator, atlas: Atlas, x: float) -> None:
    """20 mm thick, across the way, at most 25 degrees askew; what of it the chair will meet first is at x."""
    turned = rng.uniform(-25, 25)
    out.box(x + 320 * abs(tan(radians(turned))), 0.0, (20, 1400, 20), atlas.pick(rng, "plain"), turned_deg=turned,
            shadow=1.0)  # fmt: skip


def _drop(out: Room, rng: np.random.Generator, atlas: Atlas, x: float, floor: int) -> float:
    texture = floor if rng.random() < 0.5 else atlas.pick(rng, "plaster", "carpet", "planks", "terrazzo")
    out.level((x, x + 9000), (-3000, 3000), -rng.uniform(150, 800), texture, BELOW)
    return x


def _stairs(out: Room, rng: np.random.Generator, x: float, floor: int) -> float:
    step, rise = rng.uniform(240, 300), rng.uniform(150, 190)
    for i in range(1, 6):
        out.level((x + (i - 1) * step, x + (9000 if i == 5 else i * step)), (-3000, 3000), -i * rise, floor, BELOW)
    return x


Maker = Callable[[Room, np.random.Generator, Atlas, float, int], float | None]
THINGS: dict[str, Maker] = {
    "box_tex": lambda o, r, a, x, _f: _box(o, r, a, x, "print", "planks", "fabric", "brick"),
    "box_plain": lambda o, r, a, x, _f: _box(o, r, a, x, "plain"),
    "wall_tex": lambda o, r, a, x, _f: _wall_ahead(o, r, a, x, "plaster", "brick", "print", "planks"),
    "wall_plain": lambda o, r, a, x, _f: _wall_ahead(o, r, a, x, "plain"),
    "corner": lambda o, r, a, x, _f: _corner(o, r, a, x),
    "column": lambda o, r, a, x, _f: _column(o, r, a, x),
    "chair": lambda o, r, a, x, _f: _chair(o, r, a, x),
    "table": lambda o, r, a, x, _f: _table(o, r, a, x),
    "overhang": lambda o, r, a, x, _f: _overhang(o, r, a, x),
    "person": lambda o, r, a, x, _f: _person(o, r, a, x),
    "sofa": lambda o, r, a, x, _f: _sofa(o, r, a, x),
    "door_edge": lambda o, r, a, x, _f: _frame(o, r, a, x),
    "stripes": lambda o, r, a, x, _f: _box(o, r, a, x, "stripes"),
    "camouflage": lambda o, r, _a, x, f: o.box(x, r.uniform(-100, 100), (300, r.uniform(250, 500), 600), f),
    "low_box": lambda o, r, a, x, _f: _low_box(o, r, a, x),
    "drop": _drop,
    "stairs": lambda o, r, _a, x, f: _stairs(o, r, x, f),
}
RARE: dict[str, Maker] = {"cable": lambda o, r, a, x, _f: _cable(o, r, a, x)}
"""Things that no room holds unless they are asked for."""

"""What the look of the floor adds to stereo: drives through random rendered rooms, `python benchmarks/looks.py`.

Each drive is up to 1.7 m at 500 mm/s, 15 pictures a second, both stages of a lane behind each other. `cable` (20 mm,
colour and angle random) and `low_box` (120 mm) have to be stopped for; an empty floor, shadows, gloss, rugs and
patterned tiles must not be. Decided as the arbiter does: the nearest of the last three readings of a stage.
In time: with at least IN_TIME_MM left; a stop with more than EARLY_MM left was for something else.
Results by kind, with 95 % bounds, go to benchmarks/results/looks.json; the kinds of one run replace only themselves.
"""

from __future__ import annotations

import argparse
import json
import time
from collections import deque
from collections.abc import Callable
from dataclasses import dataclass, replace
from math import cos, radians, sin
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np
import numpy.typing as npt

from chairward.components import Bench, Context, Footprint, Pose, Processor
from chairward.messages import RangeReading
from chairward.plugins import Registry, discover_only
from chairward.stages import Image, StereoFrame
from chairward_simulator.home import Home
from chairward_simulator.scene import GEOMETRY, StereoCamera, axes_of
from chairward_stereo_range.statistics import quantile, rate_pct

STAGES = ("stereo_range", "vision_obstacle")
TO_STOP_FOR = ("cable", "low_box")
TO_PASS = ("empty", "shadow", "gloss", "rug", "pattern")
STOP_MM = 600
SPEED_MM_S, FPS, DRIVE_MM = 500.0, 15.0, 1700.0
IN_TIME_MM = 300.0
"""500 mm/s, 600 mm/s^2: 208 mm of braking, and 92 mm for two pictures, the guard's tick and the wire."""
EARLY_MM = 900.0
FOOTPRINT = Footprint(front_mm=450, rear_mm=450, half_width_mm=300)
START_MM = 1800.0
FLOORS = ("carpet", "tiles", "wood", "fabric", "plain")
WALLS = ("brick", "wallpaper", "panel", "plain")
Floats = npt.NDArray[np.float64]
Paint = Callable[[Floats, Floats, npt.NDArray[np.bool_], Floats], Floats]
"""(x, y of each pixel's point along and across the way, whether it is floor, the camera's place) -> factor, h x w."""


@dataclass(frozen=True, slots=True)
class Scene:
    """A room, a camera in it, and what is painted over its pictures. way_deg: the heading of the drive."""

    home: Home
    pose: Pose
    noise: float
    way_deg: float
    paint: Paint | None
    tint: tuple[float, float, float]
    exposure: float
    note: str


def along(way_deg: float, x: float, y: float) -> tuple[float, float]:
    """A point x along and y to the left of the way, in the room's frame."""
    a = radians(way_deg)
    return x * cos(a) - y * sin(a), x * sin(a) + y * cos(a)


def scene(kind: str, seed: int) -> Scene:
    """A random room of a kind; the thing to stop for is DRIVE_MM before the footprint at the start."""
    rng = np.random.default_rng([sum(kind.encode()), seed])
    way = float(rng.choice([0, 90])) + float(rng.uniform(-12, 12))
    floor = str(rng.choice(FLOORS))
    edge = START_MM + FOOTPRINT.front_mm + DRIVE_MM
    boxes: list[dict[str, Any]] = []
    paint: Paint | None = None
    tint = (1.0, 1.0, 1.0)
    if kind == "cable":
        turned, side = float(rng.uniform(-25, 25)), float(rng.uniform(-150, 150))
        reach = 300 * abs(np.tan(radians(turned)))  # its nearest point inside the corridor is at the edge
        at = along(way, edge + 10 + reach, side)
        box = {"size": [20, 1400, 20], "texture": "plain", "turned_deg": way + turned}
        boxes.append({"name": "thing", "at": at, **box})
        level = rng.uniform(0.08, 1.2)
        b, g, r = np.clip(level * rng.uniform(0.6, 1.4, 3), 0.05, 1.3)
        tint = (float(b), float(g), float(r))
    if kind == "low_box":
        size = [float(rng.uniform(120, 400)), float(rng.uniform(150, 400)), 120.0]
        at = along(way, edge + size[0] / 2, float(rng.uniform(-250, 250)))
        texture = str(rng.choice(["cardboard", "books", "clothes", "wood", "shirt", "plain"]))
        boxes.append({"name": "thing", "at": at, "size": size, "texture": texture, "turned_deg": way})
    if kind == "rug":
        size = [float(rng.uniform(500, 1500)), float(rng.uniform(500, 2000)), float(rng.uniform(3, 12))]
        at = along(way, float(rng.uniform(2900, 3900)), float(rng.uniform(-400, 400)))
        texture = str(rng.choice(["fabric", "carpet", "poster", "clothes", "shirt"]))
        turned = way + float(rng.uniform(-20, 20))
        boxes.append({"name": "rug", "at": at, "size": size, "texture": texture, "turned_deg": turned})
    if kind == "shadow":
        paint = shadow(rng)
    if kind == "gloss":
        paint = gloss(rng)
    if kind == "pattern":
        floor, paint = str(rng.choice(["plain", "tiles"])), pattern(rng)
    end, half = 9000.0, float(rng.uniform(1200, 2200))
    corners = {"a": (-1500.0, half), "b": (end, half), "c": (end, -half), "d": (-1500.0, -half)}
    wall = str(rng.choice(WALLS))
    home = Home.model_validate(
        {
            "name": f"{kind} {seed}",
            "start": {"x_mm": 0, "y_mm": 0, "heading_deg": way},
            "floor": [{"name": "floor", "x": [-12000, 12000], "y": [-12000, 12000], "texture": floor}],
            "wall": [
                {"name": i + j, "from": along(way, *corners[i]), "to": along(way, *corners[j]), "texture": wall}
                for i, j in ("ab", "bc", "cd")
            ],
            "box": boxes,
        }
    )
    mount = Pose(x_mm=450, z_mm=400) if rng.random() < 0.5 else Pose(x_mm=450, z_mm=700, pitch_deg=15)
    return Scene(
        home,
        mount,
        float(rng.uniform(1, 4)),
        way,
        paint,
        tint,
        float(rng.uniform(0.8, 2.2)),
        f"{floor} {mount.z_mm:.0f}",
    )


def shadow(rng: np.random.Generator) -> Paint:
    """Two to five straight shadows at least 100 mm wide, edges 0 to 150 mm soft."""
    bars = [
        (
            rng.uniform(1800, 4500),
            rng.uniform(-80, 80),
            rng.uniform(50, 300),
            rng.uniform(2, 150),
            rng.uniform(0.3, 0.8),
        )
        for _ in range(int(rng.integers(2, 6)))
    ]

    def factor(x: Floats, y: Floats, floor: npt.NDArray[np.bool_], _eye: Floats) -> Floats:
        out = np.ones(x.shape)
        for at, angle, half, soft, dark in bars:
            across = np.abs((x - at) * cos(radians(angle)) + y * sin(radians(angle)))
            out *= 1 - (1 - dark) * np.clip((half - across) / soft + 0.5, 0, 1)
        return np.where(floor, out, 1.0)

    return factor


def gloss(rng: np.random.Generator) -> Paint:
    """One to three lamps mirrored in the floor: bright spots that wander with the chair."""
    lamps = [
        (rng.uniform(4000, 14000), rng.uniform(-1500, 1500), rng.uniform(1800, 2500)) for _ in range(rng.integers(1, 4))
    ]
    sharp, strength = float(rng.choice([60, 300, 1500])), float(rng.uniform(0.4, 2.0))

    def factor(x: Floats, y: Floats, floor: npt.NDArray[np.bool_], eye: Floats) -> Floats:
        out = np.ones(x.shape)
        view = np.stack([x - eye[0], y - eye[1], np.full(x.shape, -eye[2])], -1)
        view /= np.linalg.norm(view, axis=-1, keepdims=True)
        for lamp in lamps:
            to = np.stack([lamp[0] - x, lamp[1] - y, np.full(x.shape, lamp[2])], -1)
            to /= np.linalg.norm(to, axis=-1, keepdims=True)
            mirrored = view * [1, 1, -1]
            out += strength * np.clip((mirrored * to).sum(-1), 0, 1) ** sharp
        return np.where(floor, out, 1.0)

    return factor


def pattern(rng: np.random.Generator) -> Paint:
    """Tiles of 150 to 600 mm, black and white or slightly unlike, with joints of 4 to 12 mm."""
    size, dark, joint = rng.uniform(150, 600), rng.uniform(0.35, 0.9), rng.uniform(2, 6)
    turn, chequered = radians(float(rng.choice([0, 45, rng.uniform(-20, 20)]))), rng.random() < 0.6
    joint_tone = rng.uniform(0.5, 1.1)

    def factor(x: Floats, y: Floats, floor: npt.NDArray[np.bool_], _eye: Floats) -> Floats:
        u, v = (x * cos(turn) + y * sin(turn)) / size, (y * cos(turn) - x * sin(turn)) / size
        iu, iv = np.floor(u), np.floor(v)
        hashed = np.sin(iu * 12.9898 + iv * 78.233) * 43758.5453
        tone = (iu + iv) % 2 if chequered else hashed - np.floor(hashed)
        gap = np.minimum(np.minimum(u - iu, 1 + iu - u), np.minimum(v - iv, 1 + iv - v)) * size
        out = np.where(gap < joint, joint_tone, dark + (1 - dark) * tone)
        return np.where(floor, out, 1.0)

    return factor


class Eyes:
    """The camera pair: its pictures with the paint on them."""

    def __init__(self, made: Scene, seed: int) -> None:
        self._made = made
        self._cameras = [
            StereoCamera(made.home, replace(made.pose, y_mm=made.pose.y_mm - shift), made.noise, seed)
            for shift in (0.0, GEOMETRY.baseline_mm)
        ]

    def pair(self, driven_mm: float) -> tuple[Image, Image]:
        """Left and right picture; the truth of the right one is that of a camera that stands there."""
        made = self._made
        x, y = along(made.way_deg, driven_mm, 0.0)
        left, right = self._cameras[0].pair(x, y, made.way_deg)
        return self._painted(left, 0, driven_mm), self._painted(right, 1, driven_mm)

    def _painted(self, image: Image, side: int, driven_mm: float) -> Image:
        made, camera = self._made, self._cameras[side]
        depth, ids, names = camera.truth(*along(made.way_deg, driven_mm, 0.0), made.way_deg)
        factor = np.full((*ids.shape, 3), made.exposure)
        if made.paint is not None:
            g, axes, pose = camera.geometry, axes_of(0.0, camera.pose), camera.pose
            right, down = np.meshgrid(
                (np.arange(g.width_px) - g.cx_px) / g.focal_px, (np.arange(g.height_px) - g.cy_px) / g.focal_px
            )
            ray = axes[0] + right[..., None] * axes[1] + down[..., None] * axes[2]
            eye = np.array([driven_mm + pose.x_mm, pose.y_mm, pose.z_mm])
            at = eye + np.where(np.isfinite(depth), depth, 0.0)[..., None] * ray
            factor *= made.paint(at[..., 0], at[..., 1], ids == names.index("floor"), eye)[..., None]
        if "thing" in names:
            factor[ids == names.index("thing")] *= made.tint
        return np.asarray(np.clip(image * factor, 0, 255), np.uint8)


def stages(registry: Registry, pose: Pose, folder: Path) -> list[Processor]:
    """Both stages as a lane makes them."""
    context = Context(lane="front", run_dir=folder, chair_dir=folder, pose=pose, footprint=FOOTPRINT)
    parts = [registry.stage(name)[1] for name in STAGES]
    return [part.make(part.settings.model_validate({"panes": False}), context) for part in parts]


@dataclass(frozen=True, slots=True)
class Drive:
    """left_mm: room left at the stop, by stage (nan: never asked for one); blind: share of readings that cannot see."""

    note: str
    left_mm: dict[str, float]
    blind: dict[str, float]


def drive(kind: str, seed: int, registry: Registry) -> Drive:
    """One drive."""
    made = scene(kind, seed)
    eyes = Eyes(made, seed + 1)
    left: dict[str, float] = dict.fromkeys(STAGES, float("nan"))
    blind = dict.fromkeys(STAGES, 0)
    windows = {name: deque[int](maxlen=3) for name in STAGES}
    number = 0
    with TemporaryDirectory() as folder:
        lane = stages(registry, made.pose, Path(folder))
        for driven in np.arange(0.0, DRIVE_MM - IN_TIME_MM, SPEED_MM_S / FPS):
            number += 1
            bench = Bench()
            left_picture, right_picture = eyes.pair(START_MM + float(driven))
            at_ns = round(number * 1e9 / FPS)
            frame = StereoFrame(
                left=left_picture, right=right_picture, captured_ns=at_ns, seq=number, geometry=GEOMETRY
            )
            bench.put(frame)
            for name, stage in zip(STAGES, lane, strict=True):
                (reading,) = stage.process(bench)
                assert isinstance(reading, RangeReading)
                blind[name] += not reading.can_see
                windows[name].append(5000 if reading.ahead_mm is None else reading.ahead_mm)
                if np.isnan(left[name]) and min(windows[name]) <= STOP_MM:
                    left[name] = DRIVE_MM - float(driven)
    return Drive(made.note, left, {name: count / number for name, count in blind.items()})


def summary(kind: str, drives: list[Drive]) -> dict[str, Any]:
    """Figures of one kind, with both stages together and with stereo alone."""
    out: dict[str, Any] = {"drives": len(drives), "metres": round(len(drives) * (DRIVE_MM - IN_TIME_MM) / 1000, 1)}
    for name, of in {"together": STAGES, "stereo_range": STAGES[:1], "vision_obstacle": STAGES[1:]}.items():
        stops = [max((d.left_mm[s] for s in of if not np.isnan(d.left_mm[s])), default=float("nan")) for d in drives]
        known = [s for s in stops if not np.isnan(s)]
        if kind in TO_STOP_FOR:
            good = sum(IN_TIME_MM <= s <= EARLY_MM for s in known)
            rate = rate_pct(good, len(stops))
            rest = {"in_time_pct": rate.value, "early": sum(s > EARLY_MM for s in known)}
            rest |= {"left_mm_p5": quantile(known, 0.05).value, "left_mm_median": quantile(known, 0.5).value}
        else:
            rate = rate_pct(len(known), len(stops))
            rest = {"drives_stopped_pct": rate.value}
        rest["blind_pct"] = 100 * float(np.mean([max(d.blind[s] for s in of) for d in drives]))
        bounds = [None if v is None else round(v, 1) for v in (rate.low, rate.high)]
        out[name] = {k: v if v is None else round(v, 1) for k, v in rest.items()} | {"n": rate.n, "bounds_95": bounds}
    return out


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--kinds", nargs="*", default=[*TO_STOP_FOR, *TO_PASS], choices=[*TO_STOP_FOR, *TO_PASS])
    parser.add_argument("--drives", type=int, default=100, help="of each kind")
    parser.add_argument("--first", type=int, default=0, help="seed of the first drive")
    parser.add_argument("--each", action="store_true", help="print every drive")
    parser.add_argument("--out", type=Path, default=Path(__file__).parent / "results" / "looks.json")
    arguments = parser.parse_args()
    registry = discover_only(STAGES)
    results = json.loads(arguments.out.read_text("utf-8")) if arguments.out.exists() else {}
    for kind in arguments.kinds:
        start, drives = time.process_time(), []
        for seed in range(arguments.first, arguments.first + arguments.drives):
            drives.append(drive(kind, seed, registry))
            if arguments.each:
                print(kind, seed, drives[-1], flush=True)
        results[kind] = summary(kind, drives)
        print(kind, json.dumps(results[kind]), f"{time.process_time() - start:.0f} s", flush=True)
    arguments.out.write_text(json.dumps(results, indent=1) + "\n", encoding="utf-8")


if __name__ == "__main__":
    main()

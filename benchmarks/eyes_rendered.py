"""The eyes in rooms that they were not tuned to: `python benchmarks/eyes_rendered.py [--pairs N --drives N --seed S]`.

Renders pairs and drives (rendered/: seeded rooms, materials, light, shadows, gloss, cameras, poses, baselines, focal
lengths) into a temporary folder with a manifest in the format of the test sets, and measures them with the code of
`chairward range evaluate`. Prints the figures and writes benchmarks/results/eyes_rendered.json. `--keep FOLDER` keeps
the pictures of each lot there, takes what it finds there instead of rendering it again, and leaves manifests for
`chairward range evaluate FOLDER/1-0-150-14/manifest.csv --report out/`. A lot is the same whether measured in one run
or in several (`--first 10 --lots 5`). Drives are measured with the votes of both stages, and by stereo alone beside.
`--oracle`: what perfect depth would tell; `--only cable --pairs 0 --drives 60 --out FILE`: drives at such things.
"""

from __future__ import annotations

import argparse
import csv
import json
import sys
import tempfile
from dataclasses import replace
from multiprocessing import Pool
from pathlib import Path
from typing import Any

import cv2
import numpy as np

sys.path.insert(0, str(Path(__file__).parent / "rendered"))
from oracle import Oracle, true_disparity
from photographs import Photographer, Sensor, sensor
from rooms import BELOW, FLOOR, RARE, THINGS, WALL, room
from surfaces import Atlas, atlas

from chairward.components import Pose
from chairward.messages import NOTHING_NEAR_MM
from chairward.stages import Floats, StereoGeometry
from chairward_stereo_range import evaluate, figures, manifest
from chairward_stereo_range.beside import USUAL, stage_maker
from chairward_stereo_range.finder import Options, RangeFinder
from chairward_stereo_range.geometry import make_view, rays, thesis_trapezoid

COLUMNS = (
    "split", "name", "kind", "left", "right", "gt", "gt_format", "baseline_mm", "focal_px", "doffs",
    "nearest_in_roi_mm", "licence", "source", "note",
)  # fmt: skip
APART = {"stairs": "drop"}
"""Reported with the kind that test sets know."""
SPEED_MM_S, FPS = 500.0, 15.0
HALF_WIDTH_MM, HEIGHT_MM = 320.0, 1400.0
PAIRS_A_LOT, DRIVES_A_LOT = 150, 15
"""One set of materials each."""
WALLS_MM = (600.0, 700.0, 830.0, 1000.0, 1300.0, 2500.0)


def geometry(rng: np.random.Generator) -> StereoGeometry:
    """Mostly the thesis' pair; else other focal lengths, baselines and 640 x 480."""
    width, height, f, b = 320, 240, 300.0, 50.0
    if rng.random() < 0.4:
        f, b = float(rng.uniform(240, 420)), float(rng.uniform(40, 110))
        if rng.random() < 0.3:
            width, height, f = 640, 480, 2 * f
    return rig(f, b, width, height)


def rig(focal_px: float, baseline_mm: float, width_px: int = 320, height_px: int = 240) -> StereoGeometry:
    """A rectified pair, principal point in the middle."""
    return StereoGeometry(
        focal_px=focal_px,
        baseline_mm=baseline_mm,
        cx_px=(width_px - 1) / 2,
        cy_px=(height_px - 1) / 2,
        width_px=width_px,
        height_px=height_px,
        doffs_px=0.0,
    )


def mount(rng: np.random.Generator) -> Pose:
    """The sets' two mounts, or any other that sees the floor ahead."""
    kind = rng.integers(3)
    if kind < 2:
        return (Pose(z_mm=400.0), Pose(z_mm=700.0, pitch_deg=15.0))[kind]
    z = float(rng.uniform(300, 900))
    low, high = (0.0, 8.0) if z < 500 else (8.0, 20.0)
    return Pose(z_mm=z, pitch_deg=float(rng.uniform(low, high)), roll_deg=float(rng.uniform(-1, 1)))


def nearest_mm(depth: Any, ids: Any, g: StereoGeometry, pose: Pose, corridor: bool) -> float:
    """Truth of one picture, as the test sets define it; in the corridor: the forward distance instead of the depth."""
    forward, left, up = rays(g, replace(pose, x_mm=0.0, y_mm=0.0))
    with np.errstate(invalid="ignore"):
        if corridor:
            height = pose.z_mm + depth * up
            inside = (np.abs(depth * left) <= HALF_WIDTH_MM) & (height < HEIGHT_MM)
            far = depth * forward
        else:
            inside, far = thesis_trapezoid(g.width_px, g.height_px), depth
    values = np.sort(far[inside & (ids > FLOOR) & (ids != BELOW) & np.isfinite(depth)])
    rank = round(manifest.NEAREST_RANK * (g.height_px / 240) ** 2)
    return float("inf") if values.size < 20 else float(values[min(rank, values.size // 2)])


class Writer:
    """A manifest and its pictures in one folder."""

    def __init__(self, folder: Path, truths: list[Floats] | None = None) -> None:
        self.folder, self.truths = folder, truths
        self._rows: list[list[str]] = []

    def look(self, photographer: Photographer, g: StereoGeometry, pose: Pose, heading_deg: float) -> None:
        """Keep the true disparities of a frame, where they are wanted."""
        if self.truths is not None:
            self.truths.append(true_disparity(photographer, g, pose, heading_deg))

    def add(self, name: str, kind: str, g: StereoGeometry, pose: Pose, nearest: float, note: str) -> None:
        """One row; the pictures' names follow from `name`."""
        number = "_%03d" if kind == "sequence" else ""
        left, right = (f"{name}_{side}{number}.jpg" if kind == "sequence" else f"{name}_{side}.png" for side in "LR")
        gt = f"{name}.csv" if kind == "sequence" else ""
        near = "" if np.isinf(nearest) else f"{nearest:.1f}"
        where = f"z_mm={pose.z_mm:.1f} pitch_deg={pose.pitch_deg:.3f} roll_deg={pose.roll_deg:.3f}"
        self._rows.append(
            ["own", name, kind, left, right, gt, "", str(g.baseline_mm), str(g.focal_px), "0", near, "own render",
             "eyes_rendered.py", f"{note} {where}"]
        )  # fmt: skip

    def close(self) -> Path:
        """The manifest's path."""
        path = self.folder / "manifest.csv"
        with path.open("w", newline="", encoding="utf-8") as file:
            csv.writer(file).writerows([COLUMNS, *self._rows])
        return path


def add_pair(out: Writer, rng: np.random.Generator, materials: Atlas, name: str) -> None:
    """A quarter with something within the stop distance, some between, most of them clear."""
    kind, what = rng.random(), str(rng.choice(list(THINGS)))
    if kind < 0.24:
        distance = float(rng.uniform(290, 600))
    elif kind < 0.34:
        distance = float(rng.uniform(600, 1200))
    else:
        what, distance = ("none", 3000.0) if rng.random() < 0.65 else (what, float(rng.uniform(1250, 2600)))
    made = room(rng, materials, what, distance)
    g, pose, heading = geometry(rng), mount(rng), float(rng.uniform(-6, 6))
    cameras, photographer = sensor(rng), Photographer(made, materials)
    pair = photographer.pair(g, pose, heading, cameras, rng)
    out.look(photographer, g, pose, heading)
    for side, picture in zip("LR", pair, strict=True):
        cv2.imwrite(str(out.folder / f"{name}_{side}.png"), picture, [cv2.IMWRITE_PNG_COMPRESSION, 1])
    nearest = nearest_mm(*photographer.truth(g, pose, heading), g, pose, corridor=False)
    look = f"floor={made.materials} gloss={made.gloss:.2f} noise={cameras.noise:.1f}"
    note = f"{APART.get(what, what)} D={distance:.0f} {look}"
    out.add(name, "synthetic", g, pose, nearest, note)


def add_drive(out: Writer, rng: np.random.Generator, materials: Atlas, name: str, only: str) -> None:
    """Two metres straight on: at a thing, through a doorway, along a wall, or over the floor of an empty room.

    only: at such a thing; "": at any.
    """
    what = only or str(rng.choice([*THINGS, "doorway", "side_wall", "none", "none"]))
    is_thing = what in THINGS | RARE
    start = float(rng.uniform(1350, 1600))
    made = room(rng, materials, what if is_thing else "none", start if is_thing else 5000.0)
    if what == "doorway":
        texture = materials.pick(rng, "plaster", "planks", "plain", "brick")
        for side in (1, -1):
            made.box(start, side * (405 + 1500), (120, 3000, 2500), texture, WALL, shadow=1.0)
    elif what == "side_wall":
        texture = materials.pick(rng, "plaster", "brick", "planks", "plain")
        made.box(-1000, float(rng.choice([520, -520])), (5000, 100, 2500), texture, WALL, shadow=1.0)
    hard = what in ("cable", "low_box", "drop", "stairs")
    corridor = not is_thing or hard or rng.random() < 0.5
    g, pose, cameras = geometry(rng), mount(rng), sensor(rng)
    photographer = Photographer(made, materials, finer=1)
    truths = []
    for i in range(int((start - 400.0) / SPEED_MM_S * FPS)):
        driven = i * SPEED_MM_S / FPS
        at = replace(pose, x_mm=driven, y_mm=15.0 * float(np.sin(driven / 700.0)))
        heading = 0.8 * float(np.cos(driven / 500.0))
        depth, ids = photographer.truth(g, at, heading)
        nearest = start - driven if what in ("drop", "stairs") else nearest_mm(depth, ids, g, pose, corridor)
        truths.append((driven, nearest))
        out.look(photographer, g, at, heading)
        for side, picture in zip("LR", photographer.pair(g, at, heading, cameras, rng), strict=True):
            cv2.imwrite(str(out.folder / f"{name}_{side}_{i:03d}.jpg"), picture, [cv2.IMWRITE_JPEG_QUALITY, 98])
    if corridor and is_thing:  # what has gone under the view is still there
        ahead = min(driven + mm for driven, mm in truths)
        truths = [(driven, ahead - driven) for driven, _ in truths]
    lines = [f"{i},{mm if np.isfinite(mm) else 'inf'}" for i, (_, mm) in enumerate(truths)]
    (out.folder / f"{name}.csv").write_text("\n".join(["frame,mm", *lines]), encoding="utf-8")
    region = "corridor" if corridor else "trapezoid"
    note = f"{APART.get(what, what)} region={region} fps={FPS:.0f} speed_mm_s={SPEED_MM_S:.0f} floor={made.materials}"
    out.add(name, "sequence", g, pose, float("inf"), note)


def lot(task: tuple[int, int, int, int, str, bool, str]) -> evaluate.Results:
    """Render and measure one lot: (seed, its number, pairs, drives, folder to keep it in or "", oracle?, only)."""
    cv2.setNumThreads(1)
    seed, number, pairs, drives, keep, perfect, only = task
    options = Options(region="trapezoid")
    with tempfile.TemporaryDirectory() as temporary:
        folder = Path(keep or temporary) / f"{only}{seed}-{number}-{pairs}-{drives}"
        made = folder / "manifest.csv"
        if perfect:
            truths: list[Floats] = []
            made = render(folder, seed, number, pairs, drives, truths, only)
            return evaluate.run(manifest.read(made), options, 240, prepare=Oracle(iter(truths)).prepare)
        if not made.exists():
            made = render(folder, seed, number, pairs, drives, None, only)
        return evaluate.run(manifest.read(made), options, 240, also=stage_maker(USUAL))


def render(
    folder: Path, seed: int, number: int, pairs: int, drives: int, truths: list[Floats] | None, only: str
) -> Path:
    """The manifest of one lot, its pictures beside it; true disparities go to `truths`."""
    folder.mkdir(parents=True, exist_ok=True)
    materials, out = atlas(seed * 100_003 + number), Writer(folder, truths)
    for i in range(pairs):
        add_pair(out, np.random.default_rng([seed, number, 0, i]), materials, f"p{number}_{i}")
    for i in range(drives):
        add_drive(out, np.random.default_rng([seed, number, 1, i]), materials, f"d{number}_{i}", only)
    return out.close()


def wall_table(seed: int) -> dict[str, float]:
    """Mean error (mm) of the reading before textured facing walls; f 300, B 50, 320 x 240, six walls a distance."""
    g, pose = rig(300.0, 50.0), Pose(z_mm=400.0)
    finder = RangeFinder(make_view(g, pose, manifest.FOOTPRINT), Options(region="trapezoid"))
    cameras = Sensor((0.95, 0.95), (1, 1, 1), 2.0, 0.45, 90, (0.0, 0.0, 0.0))
    errors: dict[float, list[float]] = {far: [] for far in WALLS_MM}
    for i in range(6):
        materials = atlas(seed + i)
        for far in WALLS_MM:
            rng = np.random.default_rng([seed, i])
            made = room(rng, materials, "none", 6000.0)
            made.box(far, 0.0, (60, 6000, 2500), materials.pick(rng, "print", "brick", "fabric"), shadow=1.0)
            ahead = finder.measure(*Photographer(made, materials).pair(g, pose, 0.0, cameras, rng)).ahead
            errors[far].append(abs((ahead.depth_mm if ahead else float(NOTHING_NEAR_MM)) - far))
    return {f"{far:.0f}": round(float(np.mean(e)), 1) for far, e in errors.items()}


def by_obstacle(results: evaluate.Results) -> dict[str, Any]:
    """The figures of each kind of thing."""
    out: dict[str, Any] = {}
    entries = [*(r.entry for r in results.pairs), *(r.entry for r in results.sequences)]
    for name in sorted({entry.obstacle for entry in entries}):
        out[name] = {
            "synthetic": figures.synthetic([r for r in results.pairs if r.entry.obstacle == name]),
            "sequence": figures.sequence([r for r in results.sequences if r.entry.obstacle == name]),
        }
    return out


def summarised(results: evaluate.Results, seed: int, measured: int, lots: int) -> dict[str, Any]:
    """All that is written: the figures, and those of each kind of thing."""
    return {
        "seed": seed,
        "lots": f"{measured} of {lots}",
        **figures.summary(results),
        "by_obstacle": by_obstacle(results),
    }


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--pairs", type=int, default=5200)
    parser.add_argument("--drives", type=int, default=480)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--lots", type=int, help="only the first so many lots of about 150 pairs and 14 drives")
    parser.add_argument("--first", type=int, default=0, help="number of the first lot")
    parser.add_argument("--oracle", action="store_true", help="with the renderer's disparities: the geometry's limit")
    parser.add_argument("--only", default="", choices=["", *THINGS, *RARE], help="drives at such a thing (--pairs 0)")
    parser.add_argument("--jobs", type=int, default=1)
    parser.add_argument("--keep", default="")
    parser.add_argument("--out", type=Path, default=Path(__file__).parent / "results" / "eyes_rendered.json")
    arguments = parser.parse_args()
    lots = max(1, round(max(arguments.pairs / PAIRS_A_LOT, arguments.drives / DRIVES_A_LOT)))
    share = [[n * (i + 1) // lots - n * i // lots for n in (arguments.pairs, arguments.drives)] for i in range(lots)]
    chosen = range(lots)[arguments.first :][: arguments.lots]
    tasks = [(arguments.seed, i, *share[i], arguments.keep, arguments.oracle, arguments.only) for i in chosen]
    results = evaluate.Results()
    with Pool(arguments.jobs) as pool:
        for i, part in enumerate(pool.imap(lot, tasks)):
            results.pairs += part.pairs
            results.sequences += part.sequences
            print(f"lot {i + 1} of {len(chosen)}", file=sys.stderr, flush=True)
    summary = summarised(results, arguments.seed, len(chosen), lots)
    if not arguments.oracle and not arguments.only:
        summary["textured_wall_mean_error_mm"] = wall_table(arguments.seed)
    arguments.out.write_text(json.dumps(summary, indent=1) + "\n", encoding="utf-8")
    for kind in ("synthetic", "sequence"):
        if kind not in summary:
            continue
        print(kind, json.dumps({k: v for k, v in summary[kind].items() if k not in ("n", "bounds_95")}))


if __name__ == "__main__":
    main()

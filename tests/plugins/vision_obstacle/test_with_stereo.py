"""Behind the real stereo stage: on recorded pairs (false stops, cables), and driving in the simulator's renderer."""

from __future__ import annotations

import csv
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest

from chairward.components import Bench, Context, Footprint, Pose, Processor
from chairward.messages import RangeReading
from chairward.plugins import discover
from chairward.stages import StereoFrame, StereoGeometry
from chairward_simulator.home import Home
from chairward_simulator.scene import StereoCamera

SHARED = Path(__file__).resolve().parents[4] / "shared" / "data"
MOUNTS = {"A": Pose(z_mm=400), "B": Pose(z_mm=700, pitch_deg=15)}
PERIOD_NS = 66_666_667


class Eyes:
    """stereo_range and vision_obstacle in one lane; `see` gives what vision_obstacle says."""

    def __init__(self, folder: Path, pose: Pose, front_mm: float) -> None:
        footprint = Footprint(front_mm=front_mm, rear_mm=450, half_width_mm=300)
        context = Context(lane="front", run_dir=folder, chair_dir=folder, pose=pose, footprint=footprint)
        registry = discover()
        self._stages: list[Processor] = []
        for name in ("stereo_range", "vision_obstacle"):
            _, component = registry.stage(name)
            self._stages.append(component.make(component.settings(panes=False), context))
        self._number = 0

    def see(self, left: Any, right: Any, geometry: StereoGeometry) -> RangeReading:
        self._number += 1
        at_ns = self._number * PERIOD_NS
        bench = Bench()
        bench.put(StereoFrame(left=left, right=right, captured_ns=at_ns, seq=self._number, geometry=geometry))
        for stage in self._stages:
            (reading,) = stage.process(bench)
        assert isinstance(reading, RangeReading)
        return reading


def rows(folder: str) -> Iterator[tuple[dict[str, str], dict[str, str]]]:
    """(row, its note) of a manifest of renders whose mount is known."""
    path = SHARED / folder / "manifest.csv"
    if not path.is_file():
        pytest.skip(f"needs ../shared/data/{folder}")
    with path.open(newline="", encoding="utf-8") as file:
        for row in csv.DictReader(file):
            words = row["note"].split()
            note = dict(w.split("=", 1) for w in words if "=" in w)
            if words and "=" not in words[0]:
                note["obstacle"] = words[0]
            if row["kind"] == "synthetic" and "mount" in note:
                yield row, note


def pair(folder: str, row: dict[str, str]) -> tuple[Any, Any, StereoGeometry]:
    left, right = (cv2.imread(str(SHARED / folder / row[side])) for side in ("left", "right"))
    height, width = left.shape[:2]
    geometry = StereoGeometry(
        focal_px=float(row["focal_px"]),
        baseline_mm=float(row["baseline_mm"]),
        cx_px=(width - 1) / 2,
        cy_px=(height - 1) / 2,
        width_px=width,
        height_px=height,
    )
    return left, right, geometry


@pytest.mark.needs_shared
@pytest.mark.parametrize("folder", ["stereo", "stereo_photoreal"])
def test_no_clear_view_is_stopped_for_and_few_are_called_unseen(folder: str, tmp_path: Path) -> None:
    stops, blind, count = [], [], 0
    for row, note in rows(folder):
        truth = float(row["nearest_in_roi_mm"] or "inf")
        if truth <= 1200 or note["obstacle"] == "drop":
            continue
        eyes = Eyes(tmp_path, MOUNTS[note["mount"]], 0.0)
        views = pair(folder, row)
        for _ in range(5):
            reading = eyes.see(*views)
        count += 1
        blind += [row["name"]] * (not reading.can_see)
        stops += [(row["name"], reading.ahead_mm)] * (reading.ahead_mm is not None and reading.ahead_mm <= 900)
    assert count >= 40
    assert stops == []
    assert len(blind) <= 0.05 * count, blind


@pytest.mark.needs_shared
def test_most_cables_in_view_are_seen(tmp_path: Path) -> None:
    seen = []
    for row, note in rows("stereo_photoreal"):
        if note["obstacle"] == "cable":
            eyes = Eyes(tmp_path, MOUNTS[note["mount"]], 0.0)
            views = pair("stereo_photoreal", row)
            for _ in range(6):
                reading = eyes.see(*views)
            seen.append(reading.ahead_mm is not None and abs(reading.ahead_mm - float(note["D"])) < 150)
    assert sum(seen) >= 0.75 * len(seen) > 0


def room(floor: str, *boxes: dict[str, Any]) -> Home:
    walls = [([9000, -2500], [9000, 2500]), ([-2000, 1600], [9000, 1600]), ([-2000, -1600], [9000, -1600])]
    return Home.model_validate(
        {
            "name": "room",
            "start": {"x_mm": 0, "y_mm": 0, "heading_deg": 0},
            "floor": [{"name": "floor", "x": [-2000, 9000], "y": [-2500, 2500], "texture": floor}],
            "wall": [{"name": f"w{i}", "from": a, "to": b, "texture": "brick"} for i, (a, b) in enumerate(walls)],
            "box": list(boxes),
        }
    )


def driven(home: Home, mount: str, tmp_path: Path, end_mm: float) -> list[tuple[float, int]]:
    """(driven, ahead) at 500 mm/s and 15 pictures a second; the footprint's front is 450 mm before the axle."""
    pose = MOUNTS[mount]
    pose = Pose(x_mm=450, z_mm=pose.z_mm, pitch_deg=pose.pitch_deg)
    camera, eyes = StereoCamera(home, pose, 2.0, 1), Eyes(tmp_path, pose, 450.0)
    found = []
    for x in np.arange(1200.0, end_mm, 500 / 15):
        reading = eyes.see(*camera.pair(float(x), 0.0, 0.0), camera.geometry)
        assert reading.can_see
        found.append((float(x), reading.ahead_mm if reading.ahead_mm is not None else 0))
    return found


LOW_BOX = {"name": "low box", "at": [3500, 50], "size": [200, 300, 120], "texture": "cardboard"}
CABLE = {"name": "cable", "at": [3500, 0], "size": [20, 1400, 20], "texture": "plain"}


@pytest.mark.parametrize(
    ("floor", "mount", "thing", "edge_mm"),
    [
        ("carpet", "A", LOW_BOX, 3400),
        ("carpet", "B", LOW_BOX, 3400),
        ("tiles", "A", LOW_BOX, 3400),
        ("wood", "B", LOW_BOX, 3400),
        ("carpet", "A", CABLE, 3490),
        ("fabric", "B", CABLE, 3490),
    ],
)
def test_low_things_are_stopped_for_in_time(
    floor: str, mount: str, thing: dict[str, Any], edge_mm: float, tmp_path: Path
) -> None:
    way = driven(room(floor, thing), mount, tmp_path, edge_mm - 450)
    left_mm = next(edge_mm - 450 - x for x, ahead in way if ahead <= 600)
    assert 430 <= left_mm <= 720


@pytest.mark.parametrize(("floor", "mount"), [("carpet", "A"), ("tiles", "B"), ("wood", "A"), ("plain", "B")])
def test_nothing_is_stopped_for_on_an_empty_floor(floor: str, mount: str, tmp_path: Path) -> None:
    assert min(ahead for _, ahead in driven(room(floor), mount, tmp_path, 3000)) > 600

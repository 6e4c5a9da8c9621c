"""Test sets: a CSV of stereo pairs and sequences with truth, as other tools made them.

Columns used: name, kind (stereo_gt, synthetic, sequence; others are skipped), left, right, gt, gt_format, baseline_mm,
focal_px, doffs, nearest_in_roi_mm, source, note. Paths are relative to the CSV. `note` holds words like mount=A, or
z_mm=520 pitch_deg=8 roll_deg=0 where the mount is neither A nor B. A sequence with region=corridor has the forward
distance to the nearest thing in the chair's way as its truth, instead of a depth in the thesis' trapezoid. So has a
drive at something low that tells its speed and the distance at the start (D, mm on the floor): it goes under the view.
"""

from __future__ import annotations

import csv
import re
from collections.abc import Iterator
from dataclasses import dataclass
from math import inf, nan
from pathlib import Path

import numpy as np
import numpy.typing as npt

from chairward.components import Footprint, Pose
from chairward.stages import Floats, Image, StereoGeometry
from chairward_stereo_range.geometry import thesis_trapezoid, working_size
from chairward_stereo_range.opencv import opencv
from chairward_stereo_range.region import RegionKind

MOUNTS = {"A": Pose(z_mm=400.0, pitch_deg=0.0), "B": Pose(z_mm=700.0, pitch_deg=15.0)}
"""The two camera mounts of the sets: height above the floor and downward pitch."""
HARD = frozenset({"glass", "mirror", "cable", "low_box", "drop"})
"""Reported apart: nothing to match on (glass, mirror), nearly on the floor, or no floor at all."""
LOW = frozenset({"cable", "low_box", "drop"})
"""What goes under the camera's view while it is still ahead."""
NEAREST_RANK = 75
"""Truth is the depth of this nearest non-floor pixel of the region (the thesis counts 75 pixels, too)."""
NOMINAL_SEARCH_PX = 64
"""Disparities searched at 240 rows where a set gives no metric geometry."""


class ManifestError(ValueError):
    """A manifest or one of its files cannot be used: one sentence with the file and what is allowed."""


@dataclass(frozen=True, slots=True)
class Entry:
    """One row. Where the set does not tell, focal_px and baseline_mm are nan, doffs_px is 0 and metric is False."""

    name: str
    kind: str
    source: str
    left: Path
    right: Path
    gt: Path | None
    gt_format: str
    focal_px: float
    baseline_mm: float
    doffs_px: float
    metric: bool
    nearest_mm: float
    note: dict[str, str]

    @property
    def obstacle(self) -> str:
        """What stands there, as the set calls it."""
        return self.note.get("obstacle", "")

    @property
    def hard(self) -> bool:
        """One of the kinds that are reported apart."""
        return self.obstacle in HARD

    @property
    def pose(self) -> Pose:
        """The camera's mount; z_mm 0 when the note does not name one."""
        if "z_mm" not in self.note:
            return MOUNTS.get(self.note.get("mount", ""), Pose())
        z, pitch, roll = (float(self.note.get(word, "0")) for word in ("z_mm", "pitch_deg", "roll_deg"))
        return Pose(z_mm=z, pitch_deg=pitch, roll_deg=roll)

    @property
    def region(self) -> RegionKind:
        """Where its truth was looked for."""
        return "corridor" if self.note.get("region") == "corridor" or self.is_told_by_its_start else "trapezoid"

    @property
    def is_told_by_its_start(self) -> bool:
        """A drive at something low that tells how far it is at first, and no truth of its frames but pictures."""
        pictures = self.kind == "sequence" and self.gt is not None and self.gt.suffix != ".csv"
        return pictures and self.obstacle in LOW and {"D", "speed_mm_s"} <= self.note.keys()

    def geometry(self, width_px: int, height_px: int) -> StereoGeometry:
        """Of the set's own pictures, principal point in the middle."""
        metric = self.metric
        return StereoGeometry(
            focal_px=self.focal_px if metric else float(width_px),
            baseline_mm=self.baseline_mm if metric else 100.0,
            cx_px=(width_px - 1) / 2,
            cy_px=(height_px - 1) / 2,
            width_px=width_px,
            height_px=height_px,
            doffs_px=self.doffs_px,
        )


def read(path: Path) -> list[Entry]:
    """All usable rows of a manifest. Raises ManifestError."""
    try:
        with path.open(newline="", encoding="utf-8") as file:
            rows = list(csv.DictReader(file))
    except OSError as error:
        raise ManifestError(f"{path}: {error.strerror or error}: give the CSV file of a test set") from error
    entries = []
    for number, row in enumerate(rows, start=2):
        try:
            entry = _entry(path.parent, row)
        except (KeyError, ValueError) as error:
            raise ManifestError(f"{path}: line {number}: {error}: see the columns in the README") from error
        if entry is not None:
            entries.append(entry)
    if not entries:
        raise ManifestError(f"{path}: no row of kind stereo_gt, synthetic or sequence: nothing to evaluate")
    return entries


def _entry(folder: Path, row: dict[str, str]) -> Entry | None:
    if row["kind"] not in ("stereo_gt", "synthetic", "sequence"):
        return None
    focal, baseline = _number(row["focal_px"]), _number(row["baseline_mm"])
    doffs = _number(row["doffs"])
    return Entry(
        name=row["name"],
        kind=row["kind"],
        source=re.sub(r"\s+seed \d+$|\s*\(.*\)$", "", row["source"]) or row["source"],
        left=folder / row["left"],
        right=folder / row["right"],
        gt=folder / row["gt"] if row["gt"] else None,
        gt_format=row["gt_format"],
        focal_px=focal,
        baseline_mm=baseline,
        doffs_px=0.0 if np.isnan(doffs) else doffs,
        metric=not (np.isnan(focal) or np.isnan(baseline) or np.isnan(doffs)),
        nearest_mm=inf if np.isnan(_number(row["nearest_in_roi_mm"])) else _number(row["nearest_in_roi_mm"]),
        note=_note(row.get("note") or ""),
    )


def _number(text: str) -> float:
    return float(text) if text.strip() else nan


def _note(text: str) -> dict[str, str]:
    """key=value words; a first word without '=' is the obstacle's name."""
    words = text.split()
    found = dict(word.split("=", 1) for word in words if "=" in word)
    if words and "=" not in words[0]:
        found.setdefault("obstacle", words[0])
    return found


def image(path: Path) -> Image:
    """A colour picture. Raises ManifestError."""
    cv2 = opencv()
    found = cv2.imread(str(path), cv2.IMREAD_COLOR)
    if found is None:
        raise ManifestError(f"{path}: cannot be read as a picture: check the manifest's path")
    return np.asarray(found, np.uint8)


def pair(left: Path, right: Path, height_px: int) -> tuple[Image, Image, tuple[int, int]]:
    """Both pictures at the working height, and the (width, height) they had."""
    cv2 = opencv()
    a, b = image(left), image(right)
    if a.shape != b.shape:
        raise ManifestError(
            f"{left} is {a.shape[1]}x{a.shape[0]}, {right} is {b.shape[1]}x{b.shape[0]}: need equal sizes"
        )
    size = working_size(a.shape[1], a.shape[0], height_px)
    was = (a.shape[1], a.shape[0])
    if size != was:
        how = cv2.INTER_AREA if size[1] < was[1] else cv2.INTER_LINEAR
        a, b = cv2.resize(a, size, interpolation=how), cv2.resize(b, size, interpolation=how)
    return np.asarray(a, np.uint8), np.asarray(b, np.uint8), was


def true_disparity(entry: Entry, width_px: int, height_px: int) -> Floats:
    """Ground-truth disparity of a stereo_gt row at the working size, px, NaN unknown."""
    cv2 = opencv()
    if entry.gt is None:
        raise ManifestError(f"{entry.name}: kind stereo_gt needs a gt file")
    raw = cv2.imread(str(entry.gt), cv2.IMREAD_UNCHANGED)
    if raw is None:
        raise ManifestError(f"{entry.gt}: cannot be read: check the manifest's path")
    factor = re.search(r"disparity\*(\d+)", entry.gt_format)
    d = raw.astype(np.float32) / (float(factor.group(1)) if factor else 1.0)
    d[(raw == 0) | ~np.isfinite(d)] = np.nan
    scale = width_px / d.shape[1]
    return np.asarray(cv2.resize(d, (width_px, height_px), interpolation=cv2.INTER_NEAREST) * scale, np.float32)


def numbered(entry: Entry) -> Iterator[tuple[int, Path, Path]]:
    """(index, left, right) of a sequence's frames, until a file is missing."""
    index = 0
    while Path(str(entry.left) % index).exists() and Path(str(entry.right) % index).exists():
        yield index, Path(str(entry.left) % index), Path(str(entry.right) % index)
        index += 1
    if index == 0:
        raise ManifestError(f"{str(entry.left) % 0}: no such frame: the sequence's pattern must count from 0")


def sequence_truth(entry: Entry) -> dict[int, float]:
    """Frame -> depth of the nearest thing, mm (inf: nothing), for the frames whose truth is known."""
    if entry.gt is None:
        return {}
    if entry.gt.suffix == ".csv":
        with entry.gt.open(newline="", encoding="utf-8") as file:
            rows = list(csv.reader(file))
        return {int(row[0]): float(row[1]) for row in rows[1:] if len(row) > 1 and row[1]}
    if entry.is_told_by_its_start:
        step_mm = float(entry.note["speed_mm_s"]) / float(entry.note.get("fps", "15") or 15)
        return {index: float(entry.note["D"]) - index * step_mm for index, _, _ in numbered(entry)}
    ids = entry.note.get("id", "")
    root = Path(str(entry.gt)).parent.parent
    found: dict[int, float] = {}
    for index, _left, _right in numbered(entry):
        found[index] = _nearest_of_pictures(Path(str(entry.gt) % index), root / (ids % index) if ids else None)
    return found


def _nearest_of_pictures(depth: Path, ids: Path | None) -> float:
    cv2 = opencv()
    z = cv2.imread(str(depth), cv2.IMREAD_UNCHANGED)
    if z is None:
        raise ManifestError(f"{depth}: cannot be read: a sequence's gt pattern needs a depth picture for each frame")
    inside: npt.NDArray[np.bool_] = thesis_trapezoid(z.shape[1], z.shape[0]) & (z < 65535)
    if ids is not None:
        what = cv2.imread(str(ids), cv2.IMREAD_UNCHANGED)
        if what is not None:
            inside &= (what > 1) & (what != 3)
    near = np.sort(z[inside])
    rank = round(NEAREST_RANK * (z.shape[0] / 240) ** 2)
    return inf if near.size < 20 else float(near[min(rank, near.size // 2)])


FOOTPRINT = Footprint(front_mm=0.0, rear_mm=1000.0, half_width_mm=320.0)
"""The footprint of evaluations: distances are measured from the lens, as the sets' truth is."""

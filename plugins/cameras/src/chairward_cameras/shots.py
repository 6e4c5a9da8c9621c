"""What a file-backed source plays: a list of shots, each one pair of picture files. Reading of manifests and folders.

Manifest columns (as ../shared/data/stereo/manifest.csv): name, kind, left, right, gt, baseline_mm, focal_px, doffs,
nearest_in_roi_mm, note. Paths are relative to the manifest. `left`, `right`, `gt` of a sequence hold a %d pattern.
"""

from __future__ import annotations

import csv
import logging
from collections.abc import Iterator
from dataclasses import dataclass
from fnmatch import fnmatchcase
from math import isfinite
from pathlib import Path

from chairward.components import DeviceLost
from chairward_cameras.settings import CamerasSettings

log = logging.getLogger(__name__)

COLUMNS = ("name", "kind", "left", "right", "gt", "baseline_mm", "focal_px", "doffs", "nearest_in_roi_mm", "note")
DEFAULT_FPS = 15.0


@dataclass(frozen=True, slots=True, kw_only=True)
class Mount:
    """Height of the cameras above the floor, and how far they look down."""

    z_mm: float
    pitch_deg: float


MOUNTS = {"A": Mount(z_mm=400.0, pitch_deg=0.0), "B": Mount(z_mm=700.0, pitch_deg=15.0)}
"""What `mount=` in a note may say."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Optics:
    """Geometry of a rectified pair, for pictures as they are stored: Z_mm = focal * baseline / (disparity + doffs)."""

    focal_px: float
    baseline_mm: float
    doffs_px: float = 0.0


@dataclass(frozen=True, slots=True, kw_only=True)
class Shot:
    """One pair of files, shown `repeat` times at `fps`.

    truth_mm: depth of the nearest thing ahead, from the camera; None where nobody measured it.
    depth, ids: pictures from which the truth can be measured (renders); used when truth_mm is None.
    mount: where they were taken from, as far as the list tells.
    """

    name: str
    kind: str
    left: Path
    right: Path
    fps: float
    repeat: int = 1
    optics: Optics | None = None
    truth_mm: float | None = None
    depth: Path | None = None
    ids: Path | None = None
    mount: Mount | None = None


def shots(settings: CamerasSettings) -> list[Shot]:
    """Everything the settings ask for, in order. Raises DeviceLost, naming file and line."""
    found = list(_of_manifest(settings) if settings.kind == "manifest" else _of_folder(settings))
    if not found:
        where = settings.manifest if settings.kind == "manifest" else settings.folder
        raise DeviceLost(
            f"{where}: nothing to play: no row of kinds {', '.join(settings.kinds)} has a name like "
            f"'{settings.names}': correct cameras.kinds or cameras.names"
        )
    return found


def _of_manifest(settings: CamerasSettings) -> Iterator[Shot]:
    path = settings.manifest
    if path is None:
        raise DeviceLost("cameras.kind is 'manifest' but cameras.manifest names no file: set it")
    try:
        with path.open(newline="", encoding="utf-8") as file:
            reader = csv.DictReader(file)
            missing = [c for c in COLUMNS if c not in (reader.fieldnames or ())]
            if missing:
                raise DeviceLost(
                    f"{path}, line 1: column(s) {', '.join(missing)} missing; needed: {', '.join(COLUMNS)}"
                )
            rows = [(reader.line_num, row) for row in reader]
    except (OSError, UnicodeDecodeError, csv.Error) as error:
        raise DeviceLost(f"{path}: the manifest cannot be read ({error}): correct cameras.manifest") from error
    for line, raw in rows:
        row = _Row(path, line, {k: (v or "").strip() for k, v in raw.items() if k is not None and isinstance(v, str)})
        if row.text("kind") in settings.kinds and fnmatchcase(row.text("name"), settings.names):
            yield from row.shots(settings)


def _of_folder(settings: CamerasSettings) -> Iterator[Shot]:
    folder = settings.folder
    if folder is None or not folder.is_dir():
        raise DeviceLost(f"cameras.folder: '{folder}' is not a folder: give the one that holds the pictures")
    left, right = sorted(folder.glob(settings.left_glob)), sorted(folder.glob(settings.right_glob))
    if not left or len(left) != len(right):
        raise DeviceLost(
            f"{folder}: {len(left)} pictures like '{settings.left_glob}' but {len(right)} like "
            f"'{settings.right_glob}': the pairs must be complete (cameras.left_glob, cameras.right_glob)"
        )
    if (settings.focal_px is None) != (settings.baseline_mm is None):
        raise DeviceLost(
            "cameras.focal_px and cameras.baseline_mm belong together: set both, or neither (raw pictures)"
        )
    optics = None
    if settings.focal_px is not None and settings.baseline_mm is not None:
        optics = Optics(focal_px=settings.focal_px, baseline_mm=settings.baseline_mm, doffs_px=settings.doffs_px)
    fps = _fps(settings, None)
    for index, (a, b) in enumerate(zip(left, right, strict=True)):
        lead_in = max(1, round(settings.lead_in_s * fps)) if index == 0 else 1
        yield Shot(name=a.stem, kind="folder", left=a, right=b, fps=fps, repeat=lead_in, optics=optics)


def _fps(settings: CamerasSettings, recorded: float | None) -> float:
    """Pairs a second (0: flat out): the setting, else as recorded, else 15."""
    if settings.playback_fps is not None:
        return settings.playback_fps
    return recorded or DEFAULT_FPS


@dataclass(frozen=True, slots=True)
class _Row:
    """One row of a manifest; every complaint names file, line and column."""

    path: Path
    line: int
    cells: dict[str, str]

    def text(self, column: str) -> str:
        return self.cells.get(column, "")

    def wrong(self, sentence: str) -> DeviceLost:
        return DeviceLost(f"{self.path}, line {self.line} ({self.text('name') or 'no name'}): {sentence}")

    def number(self, column: str, *, above: float | None = None) -> float | None:
        """The finite number in a column, None when the cell is empty."""
        text = self.text(column)
        if not text:
            return None
        try:
            value = float(text)
        except ValueError:
            value = float("nan")
        if not isfinite(value) or (above is not None and value <= above):
            need = "a number" if above is None else f"a number above {above:g}"
            raise self.wrong(f"{column} is '{text}', but {need} is needed")
        return value

    def notes(self) -> dict[str, str]:
        """The key=value pairs of the note."""
        return dict(part.split("=", 1) for part in self.text("note").split() if "=" in part)

    def mount(self) -> Mount | None:
        """What the note says about the cameras' place."""
        letter = self.notes().get("mount")
        if letter is not None and letter not in MOUNTS:
            raise self.wrong(f"the note says mount={letter}, but only {' or '.join(MOUNTS)} is known")
        return None if letter is None else MOUNTS[letter]

    def file(self, column: str, text: str) -> Path:
        """An existing file, named relative to the manifest."""
        if not text:
            raise self.wrong(f"{column} is empty, but a file name is needed")
        found = self.path.parent / text
        if not found.is_file():
            raise self.wrong(f"{column} names '{text}', but there is no such file")
        return found

    def optics(self) -> Optics | None:
        """None (with a line in the log) where the row gives no focal length or baseline."""
        focal, baseline = self.number("focal_px", above=0), self.number("baseline_mm", above=0)
        doffs = self.number("doffs") or 0.0
        if focal is None or baseline is None:
            return None
        return Optics(focal_px=focal, baseline_mm=baseline, doffs_px=doffs)

    def shots(self, settings: CamerasSettings) -> Iterator[Shot]:
        optics, truth = self.optics(), self.number("nearest_in_roi_mm", above=0)
        if optics is None:
            log.warning("%s", self.wrong("left out: a rectified pair needs focal_px and baseline_mm"))
            return
        name, kind = self.text("name"), self.text("kind")
        if kind == "sequence":
            yield from self._sequence(settings, name, optics)
            return
        yield Shot(
            name=name,
            kind=kind,
            left=self.file("left", self.text("left")),
            right=self.file("right", self.text("right")),
            fps=_fps(settings, None),
            repeat=settings.hold_frames,
            optics=optics,
            truth_mm=truth,
            mount=self.mount(),
        )

    def _sequence(self, settings: CamerasSettings, name: str, optics: Optics) -> Iterator[Shot]:
        """Frames 0, 1, 2, ... for as long as the left file exists (or as many as the note's `frames=` says)."""
        left, right, gt = self.text("left"), self.text("right"), self.text("gt")
        notes = self.notes()
        try:
            recorded, count = float(notes.get("fps", DEFAULT_FPS)), int(notes.get("frames", 0))
            if not (isfinite(recorded) and recorded > 0 and count >= 0):
                raise ValueError(f"fps={recorded}, frames={count}")
            if left % 0 == left % 1 or right % 0 == right % 1:
                raise ValueError("the pattern does not count")
        except (ValueError, TypeError) as error:
            raise self.wrong(
                "a sequence needs file patterns like left_%03d.png, and numbers for fps and frames in its note "
                f"({error})"
            ) from error
        if not count:
            while (self.path.parent / (left % count)).is_file():
                count += 1
        if not count:
            raise self.wrong(f"left names '{left}', but there is no first file '{left % 0}'")
        truths = self._truth_table(gt) if gt.endswith(".csv") else {}
        rendered = gt if "%" in gt and "%" in notes.get("id", "") else ""
        fps = _fps(settings, recorded)
        for index in range(count):
            yield Shot(
                name=f"{name}/{index:03d}",
                kind="sequence",
                left=self.file("left", left % index),
                right=self.file("right", right % index),
                fps=fps,
                repeat=max(1, round(settings.lead_in_s * fps)) if index == 0 else 1,
                optics=optics,
                truth_mm=truths.get(index),
                depth=self.file("gt", gt % index) if rendered else None,
                ids=self.file("note id=", notes["id"] % index) if rendered else None,
                mount=self.mount(),
            )

    def _truth_table(self, gt: str) -> dict[int, float]:
        """frame -> distance, from a CSV file of two columns (frame, distance in mm, empty where not measured)."""
        path = self.file("gt", gt)
        table: dict[int, float] = {}
        with path.open(newline="", encoding="utf-8") as file:
            for line, cells in enumerate(csv.reader(file), start=1):
                if line == 1 or len(cells) < 2 or not cells[1].strip():
                    continue
                try:
                    frame, value = int(cells[0]), float(cells[1])
                    if not (isfinite(value) and value > 0):
                        raise ValueError("not a distance")
                except ValueError as error:
                    raise DeviceLost(f"{path}, line {line}: '{','.join(cells)}' is not frame,distance_mm") from error
                table[frame] = value
        return table

"""`range evaluate`: measures every pair and drives every sequence of a manifest; figures.py says what came of it.

Distances are depths from the left lens and the region is the thesis' trapezoid, as the truth of the sets is defined;
sequences with region=corridor are measured as a chair measures: forward from its footprint, in the way it will sweep.
While driving a second stage of the lane has its vote (beside.py); single pairs are stereo's alone.
Times are CPU time of this thread, from BGR pair to reading, so that other work on the machine does not spoil them.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Iterable
from dataclasses import dataclass, field, replace

import numpy as np

from chairward.components import Pose, Processor
from chairward.messages import NOTHING_NEAR_MM
from chairward.stages import Floats, Image, RectifiedPair, StereoGeometry
from chairward_stereo_range import manifest
from chairward_stereo_range.beside import MakeStage, Vote, vote
from chairward_stereo_range.finder import Measurement, Options, RangeFinder
from chairward_stereo_range.geometry import make_view, scaled
from chairward_stereo_range.manifest import Entry
from chairward_stereo_range.matching import whole_frame_disparity
from chairward_stereo_range.mount import estimate_mount
from chairward_stereo_range.region import Bools
from chairward_stereo_range.tracker import Tracker

MOUNT_FRAMES = 100
Gate = Callable[[Image, Image, StereoGeometry], Bools | None]
"""Appearance's mask for the thesis methods."""


@dataclass(frozen=True, slots=True)
class PairResult:
    """One pair: distance read (5000: nothing), and for stereo_gt the error of the disparity map inside the region."""

    entry: Entry
    read_mm: float
    can_see: bool
    coverage: float
    reason: str
    seconds: float
    disparity_error: Floats | None = None
    region_pixels: int = 0


@dataclass(frozen=True, slots=True)
class Frame:
    """One frame of a sequence; truth_mm None where it is not known, infinite where nothing is ahead.

    read_mm, can_see: stereo's; beside_mm, beside_sees: the second stage's, in the same measure.
    """

    index: int
    truth_mm: float | None
    read_mm: float
    can_see: bool
    reason: str
    seconds: float
    beside_mm: float = np.inf
    beside_sees: bool = True


@dataclass(frozen=True, slots=True)
class SequenceResult:
    """A drive: frames in order."""

    entry: Entry
    frames: list[Frame]


@dataclass(slots=True)
class Results:
    """Everything that was measured."""

    pairs: list[PairResult] = field(default_factory=list)
    sequences: list[SequenceResult] = field(default_factory=list)


def run(
    entries: Iterable[Entry],
    options: Options,
    height_px: int,
    gate: Gate | None = None,
    progress: Callable[[Entry], None] = lambda _entry: None,
    keep: Callable[[Entry, Image, Measurement], None] = lambda _entry, _left, _found: None,
    prepare: Callable[[RangeFinder], None] = lambda _finder: None,
    also: MakeStage | None = None,
) -> Results:
    """Measure every entry. prepare: is given every finder before its first pair. also: what makes a second stage.

    Raises manifest.ManifestError.
    """
    results = Results()
    finders: dict[object, RangeFinder] = {}
    for entry in entries:
        progress(entry)
        if entry.kind == "sequence":
            results.sequences.append(_drive(entry, options, height_px, gate, prepare, also))
            continue
        left, right, was = manifest.pair(entry.left, entry.right, height_px)
        key = (was, entry.focal_px, entry.baseline_mm, entry.doffs_px, entry.pose, entry.metric)
        if key not in finders:
            finders[key] = _finder(entry, was, left, options)
            prepare(finders[key])
        found, seconds = _timed(finders[key], left, right, gate)
        keep(entry, left, found)
        results.pairs.append(_pair_result(entry, finders[key], found, seconds))
    return results


def _finder(entry: Entry, was: tuple[int, int], left: Image, options: Options, pose: Pose | None = None) -> RangeFinder:
    geometry = scaled(entry.geometry(*was), left.shape[1], left.shape[0])
    if not entry.metric:
        options = replace(options, farthest_mm=np.inf)
        # Not metric: the search is set in pixels, by a baseline that puts 64 px (at 240 rows) at nearest_mm.
        pixels = manifest.NOMINAL_SEARCH_PX * left.shape[0] / 240
        geometry = replace(geometry, baseline_mm=pixels * options.nearest_mm / geometry.focal_px)
    return RangeFinder(make_view(geometry, pose or entry.pose, manifest.FOOTPRINT), options)


def _timed(finder: RangeFinder, left: Image, right: Image, gate: Gate | None) -> tuple[Measurement, float]:
    start = time.thread_time()
    mask = None if gate is None else gate(left, right, finder.view.geometry)
    found = finder.measure(left, right, mask)
    return found, time.thread_time() - start


def _read(found: Measurement) -> float:
    return float(NOTHING_NEAR_MM) if found.ahead is None else found.ahead.depth_mm


def _pair_result(entry: Entry, finder: RangeFinder, found: Measurement, seconds: float) -> PairResult:
    error, pixels = None, 0
    if entry.kind == "stereo_gt":
        g = finder.view.geometry
        truth = manifest.true_disparity(entry, g.width_px, g.height_px)
        inside = finder.region.trapezoid & np.isfinite(truth)
        pixels = int(inside.sum())
        error = np.abs(found.disparity - truth)[inside & np.isfinite(found.disparity)]
    return PairResult(entry, _read(found), found.can_see, found.coverage, found.reason, seconds, error, pixels)


def _drive(
    entry: Entry,
    options: Options,
    height_px: int,
    gate: Gate | None,
    prepare: Callable[[RangeFinder], None],
    also: MakeStage | None,
) -> SequenceResult:
    truth = manifest.sequence_truth(entry)
    tracker: Tracker | None = None
    beside: Processor | None = None
    fps = float(entry.note.get("fps", "15") or 15)
    frames = []
    pose = entry.pose if entry.pose.z_mm > 0 else _mount(entry, height_px)
    if entry.region == "corridor":
        options = replace(options, region="corridor")
    for index, left_path, right_path in manifest.numbered(entry):
        left, right, was = manifest.pair(left_path, right_path, height_px)
        if tracker is None:
            finder = _finder(entry, was, left, options, pose)
            prepare(finder)
            tracker = Tracker(finder)
            beside = also(pose) if also is not None and pose.z_mm > 0 else None
        start = time.thread_time()
        mask = None if gate is None else gate(left, right, tracker.finder.view.geometry)
        at_ns = int(index * 1e9 / fps)
        step = tracker.step(left, right, at_ns, mask=mask)
        seconds = time.thread_time() - start
        other = Vote()
        if beside is not None:
            geometry = tracker.finder.view.geometry
            taken = RectifiedPair(left=left, right=right, geometry=geometry, captured_ns=at_ns, seq=index, pose=pose)
            other = vote(beside, taken, step.measurement, tracker.finder)
        read, other_mm = step.depth_mm, tracker.depth_mm(other.ahead_mm)
        if entry.region == "corridor":
            read, other_mm = step.ahead_mm, other.ahead_mm
        read = min(read, float(NOTHING_NEAR_MM))
        frames.append(Frame(index, truth.get(index), read, step.can_see, step.reason, seconds, other_mm, other.can_see))
    return SequenceResult(entry, frames)


def _mount(entry: Entry, height_px: int) -> Pose:
    """The mount of a sequence that does not tell it, from the floor of its own first frames."""
    disparities: list[Floats] = []
    geometry: StereoGeometry | None = None
    for index, left_path, right_path in manifest.numbered(entry):
        if index > MOUNT_FRAMES:
            break
        if index % 10:
            continue
        left, right, was = manifest.pair(left_path, right_path, height_px)
        geometry = scaled(entry.geometry(*was), left.shape[1], left.shape[0])
        disparities.append(whole_frame_disparity(left, right, geometry))
    found = estimate_mount(disparities, geometry) if geometry is not None else None
    return Pose() if found is None else found.pose(Pose())

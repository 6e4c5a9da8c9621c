"""`range evaluate`: a manifest in, the figures that the eyes are judged by out.

Definitions: a stop is due when the truth is under 590 mm; the way is clear when it is over 1200 mm (or nothing is
there). A miss is a stop due with a reading over 600 mm; it is unflagged when the sensor also said that it can see.
Distances are depths from the left lens and the region is the thesis' trapezoid, as the truth of the sets is defined.
Sequences are driven as the arbiter would: the nearest of the last three readings stops, any blind one stops too.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, field, replace
from math import isfinite
from pathlib import Path

import numpy as np

from chairward.components import Pose
from chairward.messages import NOTHING_NEAR_MM
from chairward.stages import Floats, Image, StereoGeometry
from chairward_stereo_range import manifest
from chairward_stereo_range.finder import Measurement, Options, RangeFinder
from chairward_stereo_range.geometry import make_view, scaled
from chairward_stereo_range.manifest import Entry
from chairward_stereo_range.matching import whole_frame_disparity
from chairward_stereo_range.mount import estimate_mount
from chairward_stereo_range.region import Bools
from chairward_stereo_range.statistics import Figure, as_dict, mean, quantile, rate_pct
from chairward_stereo_range.tracker import Tracker

STOP_MM, STOP_DUE_MM, CLEAR_MM, NEAR_MM = 600.0, 590.0, 1200.0, 1100.0
WINDOW = 3
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
    """One frame of a sequence; truth_mm None where it is not known."""

    index: int
    truth_mm: float | None
    read_mm: float
    can_see: bool
    reason: str
    seconds: float


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
) -> Results:
    """Measure every entry. Raises manifest.ManifestError."""
    results = Results()
    finders: dict[object, RangeFinder] = {}
    for entry in entries:
        progress(entry)
        if entry.kind == "sequence":
            results.sequences.append(_drive(entry, options, height_px, gate))
            continue
        left, right, was = manifest.pair(entry.left, entry.right, height_px)
        key = (was, entry.focal_px, entry.baseline_mm, entry.doffs_px, entry.pose, entry.metric)
        if key not in finders:
            finders[key] = _finder(entry, was, left, options)
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
    start = time.perf_counter()
    mask = None if gate is None else gate(left, right, finder.view.geometry)
    found = finder.measure(left, right, mask)
    return found, time.perf_counter() - start


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


def _drive(entry: Entry, options: Options, height_px: int, gate: Gate | None) -> SequenceResult:
    truth = manifest.sequence_truth(entry)
    tracker: Tracker | None = None
    fps = float(entry.note.get("fps", "15") or 15)
    frames = []
    pose = entry.pose if entry.pose.z_mm > 0 else _mount(entry, height_px)
    for index, left_path, right_path in manifest.numbered(entry):
        left, right, was = manifest.pair(left_path, right_path, height_px)
        tracker = tracker or Tracker(_finder(entry, was, left, options, pose))
        start = time.perf_counter()
        mask = None if gate is None else gate(left, right, tracker.finder.view.geometry)
        step = tracker.step(left, right, int(index * 1e9 / fps), mask=mask)
        seconds = time.perf_counter() - start
        read = min(step.depth_mm, float(NOTHING_NEAR_MM))
        frames.append(Frame(index, truth.get(index), read, step.can_see, step.reason, seconds))
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


def stereo_gt(results: Sequence[PairResult]) -> dict[str, object]:
    """Accuracy of the disparity map in the region, at the working size, and of the nearest distance where metric."""
    errors = [r.disparity_error for r in results if r.disparity_error is not None and r.disparity_error.size]
    metric = [r for r in results if r.entry.metric and isfinite(r.entry.nearest_mm)]
    relative = [
        100 * abs(r.read_mm - r.entry.nearest_mm) / r.entry.nearest_mm for r in metric if r.read_mm < NOTHING_NEAR_MM
    ]
    return as_dict(
        {
            "pairs": len(results),
            "median_px": mean([float(np.median(e)) for e in errors]),
            "bad1_pct": mean([100 * float((e > 1).mean()) for e in errors]),
            "coverage_pct": mean(
                [
                    100 * r.disparity_error.size / max(1, r.region_pixels)
                    for r in results
                    if r.disparity_error is not None
                ]
            ),
            "nearest_rel_median_pct": quantile(relative, 0.5),
            "nearest_rel_p90_pct": quantile(relative, 0.9),
            "nearest_missed_pct": rate_pct(len(metric) - len(relative), len(metric)),
        }
    )


def synthetic(results: Sequence[PairResult]) -> dict[str, object]:
    """Stops due, false stops, blindness and errors, as vision.md defines them (near: truth below 1.1 m)."""
    due = [r for r in results if r.entry.nearest_mm < STOP_DUE_MM]
    clear = [r for r in results if r.entry.nearest_mm > CLEAR_MM]
    missed = [r for r in due if r.read_mm > STOP_MM]
    false = [r for r in clear if r.read_mm <= STOP_MM]
    spoilt = [r for r in clear if r.read_mm <= STOP_MM or not r.can_see]
    errors = [
        (r.entry.nearest_mm, abs(r.read_mm - r.entry.nearest_mm))
        for r in results
        if r.read_mm < NOTHING_NEAR_MM and r.can_see and 380 <= r.entry.nearest_mm <= 3000
    ]
    near = [e for truth, e in errors if truth <= NEAR_MM]
    figures: dict[str, Figure | int] = {
        "frames": len(results),
        "stops_due": len(due),
        "clear": len(clear),
        "missed_pct": rate_pct(len(missed), len(due)),
        "missed_unflagged_pct": rate_pct(sum(r.can_see for r in missed), len(due)),
        "false_stop_pct": rate_pct(len(false), len(clear)),
        "false_or_blind_pct": rate_pct(len(spoilt), len(clear)),
        "usable_clear_pct": rate_pct(len(clear) - len(spoilt), len(clear)),
        "near_median_mm": quantile(near, 0.5),
        "near_p95_mm": quantile(near, 0.95),
        "median_mm": quantile([e for _, e in errors], 0.5),
    }
    return as_dict(figures)


@dataclass(frozen=True, slots=True)
class _Drive:
    """What driving one sequence showed."""

    approach: bool
    stop_at_mm: float | None
    false_stops: int
    blind_stops: int
    metres: float


def drive(result: SequenceResult) -> _Drive:
    """Drive as the arbiter would, with the nearest of the last three readings; a blind frame stops as well.

    An approach ends with a truth under 590 mm. The stop counts from where it was given; a stop with the nearest thing
    farther than 690 mm (15 % over 600) has no cause. Going on needs three clear readings.
    """
    frames = result.frames
    speed = float(result.entry.note.get("speed_mm_s", "0") or 0)
    fps = float(result.entry.note.get("fps", "15") or 15)
    known = [f.truth_mm for f in frames if f.truth_mm is not None and isfinite(f.truth_mm)]
    travelled = float(np.abs(np.diff(known)).sum()) if speed == 0 and len(known) > 1 else speed * len(frames) / fps
    approach = any(f.truth_mm is not None and f.truth_mm < STOP_DUE_MM for f in frames)
    stopped_for: str = ""
    stop_at: float | None = None
    false = blind = 0
    for i, frame in enumerate(frames):
        window = frames[max(0, i - WINDOW + 1) : i + 1]
        near = min(f.read_mm for f in window) <= STOP_MM
        dark = not all(f.can_see for f in window)
        now = "near" if near else "blind" if dark else ""
        if now and not stopped_for:
            truth = frame.truth_mm
            if truth is not None and truth > 1.15 * STOP_MM:
                false += now == "near"
                blind += now == "blind"
            elif truth is not None and stop_at is None:
                stop_at = truth
        elif now and stop_at is None and frame.truth_mm is not None and frame.truth_mm <= 1.15 * STOP_MM:
            stop_at = frame.truth_mm
        stopped_for = now
    return _Drive(approach, stop_at, false, blind, travelled / 1000.0)


def sequence(results: Sequence[SequenceResult]) -> dict[str, object]:
    """Approaches, where they were stopped, stops without a cause, and errors below 1.1 m."""
    drives = [drive(r) for r in results if not r.entry.hard]
    approaches = [d for d in drives if d.approach]
    stops = [d.stop_at_mm for d in approaches if d.stop_at_mm is not None]
    metres = sum(d.metres for d in drives)
    errors = [
        abs(f.read_mm - f.truth_mm)
        for r in results
        if not r.entry.hard
        for f in r.frames
        if f.truth_mm is not None and f.truth_mm <= NEAR_MM and f.read_mm < NOTHING_NEAR_MM
    ]
    per_100m = 100.0 / metres if metres else 0.0
    return {
        **as_dict(
            {
                "sequences": len(results),
                "frames": sum(len(r.frames) for r in results),
                "approaches": len(approaches),
                "missed_approaches": len(approaches) - len(stops),
                "missed_approaches_pct": rate_pct(len(approaches) - len(stops), len(approaches)),
                "abs_error_median_mm": quantile(errors, 0.5),
                "abs_error_p95_mm": quantile(errors, 0.95),
            }
        ),
        "stop_distance_mm": {
            "median": float(np.median(stops)) if stops else None,
            "min": min(stops) if stops else None,
            "max": max(stops) if stops else None,
        },
        "metres": round(metres, 2),
        "false_stops_per_100m": round(sum(d.false_stops for d in drives) * per_100m, 2),
        "blind_stops_per_100m": round(sum(d.blind_stops for d in drives) * per_100m, 2),
    }


def timing(seconds: Sequence[float]) -> dict[str, object]:
    """ms per frame, one thread, from BGR pair to reading (the first frames, which fill caches, left out)."""
    ms = [1000 * s for s in (seconds[3:] if len(seconds) > 20 else seconds)]
    return as_dict({"median": quantile(ms, 0.5), "p99": quantile(ms, 0.99)})


def summary(results: Results) -> dict[str, object]:
    """All figures: by kind, by kind and source, and the hard kinds of obstacle apart."""
    out: dict[str, object] = dict(_by_kind(results.pairs, results.sequences))
    sources = sorted({r.entry.source for r in results.pairs} | {r.entry.source for r in results.sequences})
    out["per_source"] = {
        source: _by_kind(
            [r for r in results.pairs if r.entry.source == source],
            [r for r in results.sequences if r.entry.source == source],
        )
        for source in sources
    }
    hard = [r for r in results.pairs if r.entry.kind == "synthetic" and r.entry.hard]
    out["hard"] = {
        name: synthetic([r for r in hard if r.entry.obstacle == name])
        for name in sorted({r.entry.obstacle for r in hard})
    }
    seconds = [r.seconds for r in results.pairs] + [f.seconds for s in results.sequences for f in s.frames]
    out["ms_per_frame"] = timing(seconds)
    return out


def _by_kind(pairs: Sequence[PairResult], sequences: Sequence[SequenceResult]) -> dict[str, object]:
    out: dict[str, object] = {}
    if truth := [r for r in pairs if r.entry.kind == "stereo_gt"]:
        out["stereo_gt"] = {**stereo_gt(truth), "ms_per_frame": timing([r.seconds for r in truth])}
    if made := [r for r in pairs if r.entry.kind == "synthetic"]:
        easy = [r for r in made if not r.entry.hard]
        out["synthetic"] = {**synthetic(easy), "ms_per_frame": timing([r.seconds for r in made])}
    if sequences:
        seconds = [f.seconds for s in sequences for f in s.frames]
        out["sequence"] = {**sequence(sequences), "ms_per_frame": timing(seconds)}
    return out


def worst(results: Results, count: int) -> list[PairResult]:
    """The pairs that went most wrong: unflagged misses, false stops, then the largest relative errors."""

    def badness(r: PairResult) -> float:
        truth = min(r.entry.nearest_mm, float(NOTHING_NEAR_MM))
        if truth < STOP_DUE_MM and r.read_mm > STOP_MM:
            return 3.0 if r.can_see else 0.9
        if truth > CLEAR_MM and r.read_mm <= STOP_MM:
            return 2.0
        if r.read_mm >= NOTHING_NEAR_MM or not r.can_see:
            return 0.5 if truth > CLEAR_MM and not r.can_see else 0.0
        return min(abs(r.read_mm - truth) / truth, 1.5)

    made = [r for r in results.pairs if r.entry.kind == "synthetic"]
    return sorted(made, key=badness, reverse=True)[:count]


def default_report_name(path: Path) -> str:
    """A file name for the report of a manifest."""
    return f"{path.parent.name or 'range'}.html"

"""What an evaluation came to: the figures that the eyes are judged by, each with n and 95 % bounds.

Definitions: a stop is due when the truth is under 590 mm; the way is clear when it is over 1200 mm (or nothing is
there). A miss is a stop due with a reading over 600 mm; it is unflagged when the sensor also said that it can see.
Sequences are driven as the arbiter would: the nearest of the last three readings stops, any blind one stops too, and
every stage of the lane has its vote. Errors are of stereo's readings.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from math import isfinite

import numpy as np

from chairward.messages import NOTHING_NEAR_MM
from chairward_stereo_range.evaluate import PairResult, Results, SequenceResult
from chairward_stereo_range.statistics import Figure, as_dict, mean, per_100, quantile, rate_pct

STOP_MM, STOP_DUE_MM, CLEAR_MM, NEAR_MM = 600.0, 590.0, 1200.0, 1100.0
CAUSE_MM = 1.15 * STOP_MM
"""A stop with the nearest thing farther than this has no cause."""
IN_TIME_MM = 400.0
"""A stop given while the thing is still so far comes to rest before it (0.5 m/s, 0.6 m/s^2, 0.3 s: 360 mm)."""
WINDOW = 3


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
class Drive:
    """What driving one sequence showed. stop_at_mm: truth when the stop came that had a cause, None: it never came."""

    approach: bool
    passage: bool
    stop_at_mm: float | None
    false_stops: int
    blind_stops: int
    metres: float


def drive(result: SequenceResult, alone: bool = False) -> Drive:
    """Drive as the arbiter would, with the nearest of the last three readings; a blind frame stops as well.

    An approach ends with a truth under 590 mm; a passage never comes within 690 mm of anything. The stop counts from
    where it was given; one with the nearest thing farther than 690 mm (15 % over 600) has no cause. Going on needs
    three clear readings. alone: by stereo's readings alone.
    """
    frames = result.frames
    speed = float(result.entry.note.get("speed_mm_s", "0") or 0)
    fps = float(result.entry.note.get("fps", "15") or 15)
    truths = [f.truth_mm for f in frames if f.truth_mm is not None]
    known = [t for t in truths if isfinite(t)]
    travelled = float(np.abs(np.diff(known)).sum()) if speed == 0 and len(known) > 1 else speed * len(frames) / fps
    stopped_for: str = ""
    stop_at: float | None = None
    false = blind = 0
    for i, frame in enumerate(frames):
        window = frames[max(0, i - WINDOW + 1) : i + 1]
        near = min(f.read_mm if alone else min(f.read_mm, f.beside_mm) for f in window) <= STOP_MM
        dark = not all(f.can_see and (alone or f.beside_sees) for f in window)
        now = "near" if near else "blind" if dark else ""
        caused = frame.truth_mm is not None and frame.truth_mm <= CAUSE_MM
        if now and caused and stop_at is None:
            stop_at = frame.truth_mm
        elif now and not stopped_for and frame.truth_mm is not None and not caused:
            false += now == "near"
            blind += now == "blind"
        stopped_for = now
    return Drive(
        approach=any(t < STOP_DUE_MM for t in truths),
        passage=bool(truths) and min(truths) > CAUSE_MM,
        stop_at_mm=stop_at,
        false_stops=false,
        blind_stops=blind,
        metres=travelled / 1000.0,
    )


def sequence(results: Sequence[SequenceResult]) -> dict[str, object]:
    """Approaches, where they were stopped, stops without a cause, passages, and errors below 1.1 m.

    stereo_alone: the same without the votes of a second stage.
    """
    return {**_sequence(results, False), "stereo_alone": _sequence(results, True)}


def _sequence(results: Sequence[SequenceResult], alone: bool) -> dict[str, object]:
    drives = [drive(r, alone) for r in results]
    approaches = [d for d in drives if d.approach]
    passages = [d for d in drives if d.passage]
    stops = [d.stop_at_mm for d in approaches if d.stop_at_mm is not None]
    metres = sum(d.metres for d in drives)
    errors = [
        abs(f.read_mm - f.truth_mm)
        for r in results
        for f in r.frames
        if f.truth_mm is not None and f.truth_mm <= NEAR_MM and f.read_mm < NOTHING_NEAR_MM
    ]
    free = sum(d.false_stops + d.blind_stops == 0 for d in passages)
    where = as_dict({name: quantile(stops, q) for name, q in (("median", 0.5), ("min", 0.0), ("max", 1.0))})
    return {
        **as_dict(
            {
                "sequences": len(results),
                "frames": sum(len(r.frames) for r in results),
                "approaches": len(approaches),
                "missed_approaches": len(approaches) - len(stops),
                "missed_approaches_pct": rate_pct(len(approaches) - len(stops), len(approaches)),
                "stopped_in_time_pct": rate_pct(sum(s >= IN_TIME_MM for s in stops), len(approaches)),
                "passages": len(passages),
                "passed_without_stop_pct": rate_pct(free, len(passages)),
                "false_stops_per_100m": per_100(sum(d.false_stops for d in drives), metres, len(drives)),
                "blind_stops_per_100m": per_100(sum(d.blind_stops for d in drives), metres, len(drives)),
                "abs_error_median_mm": quantile(errors, 0.5),
                "abs_error_p95_mm": quantile(errors, 0.95),
            }
        ),
        "metres": round(metres, 2),
        "stop_distance_mm": where,
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
    out["hard"] = _hard(results)
    seconds = [r.seconds for r in results.pairs] + [f.seconds for s in results.sequences for f in s.frames]
    out["ms_per_frame"] = timing(seconds)
    return out


def _hard(results: Results) -> dict[str, object]:
    """The kinds that are reported apart, each as pairs and, where there are drives at it, as a sequence."""
    pairs = [r for r in results.pairs if r.entry.kind == "synthetic" and r.entry.hard]
    drives = [r for r in results.sequences if r.entry.hard]
    out: dict[str, object] = {}
    for name in sorted({r.entry.obstacle for r in pairs} | {r.entry.obstacle for r in drives}):
        figures = synthetic([r for r in pairs if r.entry.obstacle == name])
        at_it = [r for r in drives if r.entry.obstacle == name]
        out[name] = {**figures, "sequence": sequence(at_it)} if at_it else figures
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
        easy_drives = [s for s in sequences if not s.entry.hard]
        out["sequence"] = {**sequence(easy_drives), "ms_per_frame": timing(seconds)}
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

"""The eyes beside the field's yardsticks, in one run: `python benchmarks/eyes.py MANIFEST.csv [MANIFEST.csv ...]`.

Prints one line a method and set, and writes benchmarks/results/eyes.json. All methods share the geometry, the texture
gate, the floor removal and the nearest-thing rule, so that the table compares the matchers; the thesis modes are the
thesis from end to end. Times are CPU time of one thread (this process), so that a busy machine does not spoil them.
The plain pipelines do what is done without a region: SGBM over the whole frame, padded so that it measures the left
columns as ours does, and every pixel to 3-d.
"""

from __future__ import annotations

import argparse
import json
import platform
import time
from pathlib import Path
from typing import Any

import cv2
import numpy as np

from chairward.messages import NOTHING_NEAR_MM
from chairward_stereo_range import evaluate, figures, manifest
from chairward_stereo_range.finder import Measurement, Options, RangeFinder
from chairward_stereo_range.gate import thesis_gate
from chairward_stereo_range.geometry import make_view, scaled, thesis_trapezoid
from chairward_stereo_range.matching import BLOCK_METHODS, Method, semi_global_matcher
from chairward_stereo_range.statistics import as_dict, quantile

METHODS: list[Method] = [
    "pyramid",
    "bm",
    "sgbm_3way",
    "sgbm",
    "sgbm_hh",
    "zncc",
    "ncc",
    "sad",
    "ssd",
    "thesis_code",
    "thesis_text",
]
WHOLE = ("sgbm", "sgbm_3way", "sgbm_hh")
SIZES = (240, 480)
REPEATS, REPEATS_SLOW = 25, 6
SLOW = (*BLOCK_METHODS, "thesis_code", "thesis_text")


def cpu_ms(work: Any, repeats: int = REPEATS) -> dict[str, float]:
    """Median and 99th percentile of the CPU time of `work()`, ms, after two calls that fill the caches."""
    work()
    work()
    spent = []
    for _ in range(repeats):
        start = time.process_time()
        work()
        spent.append(1000 * (time.process_time() - start))
    return {"median": round(float(np.median(spent)), 2), "p99": round(float(np.quantile(spent, 0.99)), 2)}


def timing(entry: manifest.Entry, method: Method, height: int) -> dict[str, float]:
    """From BGR pair to measurement."""
    left, right, was = manifest.pair(entry.left, entry.right, height)
    geometry = scaled(entry.geometry(*was), left.shape[1], left.shape[0])
    options = Options(method=method, region="trapezoid")
    finder = RangeFinder(make_view(geometry, entry.pose, manifest.FOOTPRINT), options)
    return cpu_ms(lambda: finder.measure(left, right), REPEATS_SLOW if method in SLOW else REPEATS)


def whole_frame(entry: manifest.Entry, mode: str, height: int) -> dict[str, float]:
    """A plain pipeline, from BGR pair to points."""
    left, right, _ = manifest.pair(entry.left, entry.right, height)
    matcher = semi_global_matcher(0, 64 * height // 240, mode)

    def work() -> None:
        grey = [np.asarray(cv2.cvtColor(picture, cv2.COLOR_BGR2GRAY), np.uint8) for picture in (left, right)]
        cv2.reprojectImageTo3D(matcher(grey[0], grey[1]), np.eye(4))

    return cpu_ms(work, 10)


class NearestPart:
    """Was the true nearest part matched at all? What limits near distances: the errors where it was, and where not.

    For sets with depth and id pictures. The nearest part: what of the region is within 2 % of the true distance.
    """

    def __init__(self) -> None:
        self._share: dict[str, float] = {}

    def look(self, entry: manifest.Entry, _left: Any, found: Measurement) -> None:
        """Note the share of a pair's nearest part that has a disparity."""
        ids = entry.note.get("id", "")
        if entry.gt is None or entry.kind != "synthetic" or not ids or not np.isfinite(entry.nearest_mm):
            return
        size = found.disparity.shape[::-1]
        pictures = [np.asarray(cv2.imread(str(p), cv2.IMREAD_UNCHANGED)) for p in (entry.gt, entry.gt.parents[1] / ids)]
        depth, what = (cv2.resize(p, size, interpolation=cv2.INTER_NEAREST) for p in pictures)
        nearest = thesis_trapezoid(*size) & (what > 1) & (what != 3) & (depth <= 1.02 * entry.nearest_mm)
        if nearest.any():
            self._share[entry.name] = float(np.isfinite(found.disparity[nearest]).mean())

    def errors(self, results: evaluate.Results) -> dict[str, object]:
        """Median and 95th percentile below 1.1 m, mm, of both groups."""
        errors: dict[str, list[float]] = {"matched": [], "unmatched": []}
        for r in results.pairs:
            near, share = r.entry.nearest_mm, self._share.get(r.entry.name)
            told = r.can_see and r.read_mm < NOTHING_NEAR_MM and not r.entry.hard
            if told and share is not None and 380 <= near <= figures.NEAR_MM:
                errors["matched" if share > 0.3 else "unmatched"].append(abs(r.read_mm - near))
        quantiles = (("median", 0.5), ("p95", 0.95))
        return as_dict({f"{g}_{name}_mm": quantile(e, q) for g, e in errors.items() for name, q in quantiles})


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("manifests", nargs="+", type=Path)
    parser.add_argument("--methods", nargs="*", default=METHODS)
    parser.add_argument(
        "--sequences", action="store_true", help="drive the sequences with every method, not ours alone"
    )
    parser.add_argument("--out", type=Path, default=Path(__file__).parent / "results" / "eyes.json")
    arguments = parser.parse_args()
    cv2.setNumThreads(1)
    out: dict[str, Any] = {"machine": platform.processor() or platform.machine(), "opencv": cv2.__version__}
    sets = {path.parent.name: manifest.read(path) for path in arguments.manifests}
    typical = next(e for entries in sets.values() for e in entries if e.kind == "synthetic" and e.obstacle == "none")
    out["ms_cpu"] = {
        str(height): {
            **{method: timing(typical, method, height) for method in arguments.methods},
            **{f"whole frame {mode} + reprojection": whole_frame(typical, mode, height) for mode in WHOLE},
        }
        for height in SIZES
    }
    for height, times in out["ms_cpu"].items():
        for name, ms in times.items():
            times_ours = ms["median"] / times[METHODS[0]]["median"]
            print(f"{height} rows  {name:38s} {ms['median']:8.2f} ms  p99 {ms['p99']:8.2f}  {times_ours:5.1f} x ours")
    out["sets"] = {}
    for name, entries in sets.items():
        out["sets"][name] = {}
        for method in arguments.methods:
            drives = arguments.sequences or method == METHODS[0]
            chosen = [e for e in entries if drives or e.kind != "sequence"]
            options = Options(method=method, region="trapezoid")
            part = NearestPart()
            results = evaluate.run(chosen, options, SIZES[0], thesis_gate(method), keep=part.look)
            summary = {**figures.summary(results), "near_by_nearest_part": part.errors(results)}
            out["sets"][name][method] = summary
            print(f"{name:18s} {method:12s} {line(summary)}", flush=True)
    arguments.out.parent.mkdir(parents=True, exist_ok=True)
    arguments.out.write_text(json.dumps(out, indent=1) + "\n", encoding="utf-8")


def line(summary: dict[str, Any]) -> str:
    """The figures that matter, on one line."""
    parts = []
    if s := summary.get("synthetic"):
        parts.append(
            f"missed {s['missed_pct']} unflagged {s['missed_unflagged_pct']} false {s['false_stop_pct']} "
            f"or blind {s['false_or_blind_pct']} % (due {s['stops_due']}, clear {s['clear']}); "
            f"near {s['near_median_mm']}/{s['near_p95_mm']} mm"
        )
    if g := summary.get("stereo_gt"):
        parts.append(
            f"bad1 {g['bad1_pct']} % of {g['coverage_pct']} % median {g['median_px']} px; "
            f"nearest p90 {g['nearest_rel_p90_pct']} %"
        )
    if q := summary.get("sequence"):
        parts.append(f"sequences {q['abs_error_median_mm']}/{q['abs_error_p95_mm']} mm")
    return "; ".join(parts)


if __name__ == "__main__":
    main()

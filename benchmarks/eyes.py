"""The eyes beside the field's yardsticks, in one run: `python benchmarks/eyes.py MANIFEST.csv [MANIFEST.csv ...]`.

Prints one line a method and set, and writes benchmarks/results/eyes.json. All methods share the geometry, the texture
gate, the floor removal and the nearest-thing rule, so that the table compares the matchers; the thesis modes are the
thesis from end to end. Times are CPU time of one thread (this process), so that a busy machine does not spoil them.
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

from chairward_stereo_range import evaluate, figures, manifest
from chairward_stereo_range.finder import Options, RangeFinder
from chairward_stereo_range.gate import thesis_gate
from chairward_stereo_range.geometry import make_view, scaled
from chairward_stereo_range.matching import Method
from chairward_stereo_range.opencv import opencv

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
SIZES = (240, 480)
REPEATS = 25


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
    return cpu_ms(lambda: finder.measure(left, right))


def whole_frame_sgbm(entry: manifest.Entry, height: int) -> dict[str, float]:
    """What a plain pipeline does: SGBM over the whole frame, then every pixel to 3-d."""
    left, right, _ = manifest.pair(entry.left, entry.right, height)
    grey = [cv2.cvtColor(p, cv2.COLOR_BGR2GRAY) for p in (left, right)]
    matcher = opencv().StereoSGBM_create(0, 64 * height // 240, 5, 200, 800, 1, 31, 10)

    def work() -> None:
        cv2.reprojectImageTo3D(matcher.compute(*grey).astype(np.float32) / 16, np.eye(4))

    return cpu_ms(work, 10)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("manifests", nargs="+", type=Path)
    parser.add_argument("--methods", nargs="*", default=METHODS)
    parser.add_argument("--sequences", action="store_true", help="drive the sequences too (slow for the block methods)")
    parser.add_argument("--out", type=Path, default=Path(__file__).parent / "results" / "eyes.json")
    arguments = parser.parse_args()
    cv2.setNumThreads(1)
    out: dict[str, Any] = {"machine": platform.processor() or platform.machine(), "opencv": cv2.__version__}
    sets = {path.parent.name: manifest.read(path) for path in arguments.manifests}
    typical = next(e for entries in sets.values() for e in entries if e.kind == "synthetic" and e.obstacle == "none")
    out["ms_cpu"] = {
        str(height): {
            **{method: timing(typical, method, height) for method in arguments.methods},
            "whole-frame SGBM + reprojection": whole_frame_sgbm(typical, height),
        }
        for height in SIZES
    }
    for height, times in out["ms_cpu"].items():
        for name, ms in times.items():
            print(f"{height} rows  {name:32s} {ms['median']:8.2f} ms  p99 {ms['p99']:8.2f}")
    out["sets"] = {}
    for name, entries in sets.items():
        out["sets"][name] = {}
        chosen = entries if arguments.sequences else [e for e in entries if e.kind != "sequence"]
        for method in arguments.methods:
            options = Options(method=method, region="trapezoid")
            results = evaluate.run(chosen, options, SIZES[0], thesis_gate(method))
            summary = figures.summary(results)
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

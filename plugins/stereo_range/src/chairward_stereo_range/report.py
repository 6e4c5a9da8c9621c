"""The HTML report of an evaluation: tables, error against distance, the worst cases. One file, no scripts."""

from __future__ import annotations

import base64
from html import escape
from pathlib import Path
from typing import Any

import numpy as np

from chairward.messages import NOTHING_NEAR_MM
from chairward.stages import Image
from chairward_stereo_range import evaluate, figures, panes
from chairward_stereo_range.evaluate import Gate, PairResult, Results
from chairward_stereo_range.finder import Measurement, Options
from chairward_stereo_range.manifest import Entry
from chairward_stereo_range.opencv import opencv

STYLE = "body{font:15px sans-serif;margin:2em;max-width:70em}td,th{padding:.2em .8em;text-align:left}img{margin:.2em}"
FARTHEST_MM = 3000


def write_report(
    folder: Path, manifest: Path, results: Results, summary: dict[str, Any], options: Options, height_px: int,
    gate: Gate | None,
) -> Path:  # fmt: skip
    """Write `<set>.html` into `folder` and return its path."""
    cases = figures.worst(results, 12)
    pictures: dict[str, str] = {}

    def keep(entry: Entry, left: Image, found: Measurement) -> None:
        side_by_side = np.hstack(
            [panes.overlay(left, found, int(figures.STOP_MM)), panes.disparity_picture(found, 0, 64)]
        )
        pictures[entry.name] = _png(side_by_side)

    evaluate.run([case.entry for case in cases], options, height_px, gate, keep=keep)
    body = [
        f"<h1>Range evaluation of {escape(manifest.name)}</h1>",
        f"<p>method {escape(str(summary['method']))}, size {escape(str(summary['size']))}</p>",
        _table(summary),
        "<h2>Error against distance</h2>",
        _scatter(results),
        "<h2>Worst cases</h2>",
        *(_case(case, pictures.get(case.entry.name, "")) for case in cases),
    ]
    folder.mkdir(parents=True, exist_ok=True)
    path = folder / f"{manifest.parent.name or 'range'}.html"
    text = f"<!doctype html><meta charset=utf-8><title>Range evaluation</title><style>{STYLE}</style>" + "\n".join(body)
    path.write_text(text, encoding="utf-8")
    return path


def _table(figures: dict[str, Any], depth: int = 2) -> str:
    rows, below = [], []
    bounds, n = figures.get("bounds_95", {}), figures.get("n", {})
    for key, value in figures.items():
        if key in ("n", "bounds_95"):
            continue
        if isinstance(value, dict):
            below.append(f"<h{min(depth, 5)}>{escape(key)}</h{min(depth, 5)}>{_table(value, depth + 1)}")
        else:
            rows.append(
                f"<tr><td>{escape(key)}<td>{escape(str(value))}"
                f"<td>{escape(str(bounds.get(key, '')))}<td>{n.get(key, '')}"
            )
    head = "<tr><th>figure<th>value<th>95 % bounds<th>n" if rows else ""
    return (f"<table>{head}{''.join(rows)}</table>" if rows else "") + "".join(below)


def _scatter(results: Results) -> str:
    """Reading minus truth (mm) against truth (mm), of every pair and every frame of a sequence, as SVG."""
    seen = [(r.entry.name, r.entry.nearest_mm, r.read_mm, r.can_see) for r in results.pairs]
    for q in results.sequences:
        seen += [(f"{q.entry.name} {f.index}", f.truth_mm or np.inf, f.read_mm, f.can_see) for f in q.frames]
    dots = []
    for name, truth, read, can_see in seen:
        if truth > FARTHEST_MM or read >= NOTHING_NEAR_MM:
            continue
        error = float(np.clip(read - truth, -300, 300))
        colour = "#36c" if can_see else "#c33"
        title = escape(f"{name}: truth {truth:.0f}, read {read:.0f}")
        dots.append(
            f'<circle cx="{40 + truth / 4:.1f}" cy="{150 - error / 2:.1f}" r="3" fill="{colour}" fill-opacity="0.5">'
            f"<title>{title}</title></circle>"
        )
    grid = [f'<path d="M{40 + mm / 4} 0V300" stroke="#ddd"/><text x="{25 + mm / 4}" y="315">{mm}</text>'
            for mm in range(0, FARTHEST_MM + 1, 500)]  # fmt: skip
    grid += [f'<path d="M40 {150 - mm / 2}H790" stroke="#ddd"/><text x="0" y="{154 - mm / 2}">{mm:+d}</text>'
             for mm in (-200, -100, 0, 100, 200)]  # fmt: skip
    svg = f'<svg width="800" height="320" font-size="11">{"".join(grid + dots)}</svg>'
    return svg + "<p>reading minus truth (clipped to +-300 mm) against truth, mm; red: said it cannot see</p>"


def _case(case: PairResult, picture: str) -> str:
    truth = f"{case.entry.nearest_mm:.0f} mm" if np.isfinite(case.entry.nearest_mm) else "nothing there"
    text = f"{case.entry.name}: truth {truth}, read {case.read_mm:.0f} mm, can see: {case.can_see}. {case.reason}"
    return f'<p>{escape(text)}<br><img src="data:image/png;base64,{picture}">'


def _png(image: Image) -> str:
    cv2 = opencv()
    return base64.b64encode(cv2.imencode(".png", image)[1].tobytes()).decode("ascii")

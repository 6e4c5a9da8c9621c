"""The HTML report of an evaluation: tables, error against distance, the worst cases. One file, no scripts."""

from __future__ import annotations

import base64
from html import escape
from pathlib import Path
from typing import Any

import numpy as np

from chairward.stages import Image
from chairward_stereo_range import evaluate, figures, panes
from chairward_stereo_range.evaluate import Gate, PairResult, Results
from chairward_stereo_range.finder import Measurement, Options
from chairward_stereo_range.manifest import Entry
from chairward_stereo_range.opencv import opencv

STYLE = "body{font:15px sans-serif;margin:2em;max-width:70em}td,th{padding:.2em .8em;text-align:left}img{margin:.2em}"


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
        _scatter(results.pairs),
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


def _scatter(pairs: list[PairResult]) -> str:
    """Reading minus truth (mm) against truth (mm), as SVG."""
    dots = []
    for r in pairs:
        truth = r.entry.nearest_mm
        if not np.isfinite(truth) or truth > 3000 or r.read_mm >= 5000:
            continue
        error = float(np.clip(r.read_mm - truth, -300, 300))
        colour = "#c33" if not r.can_see else "#36c"
        title = escape(f"{r.entry.name}: truth {truth:.0f}, read {r.read_mm:.0f}")
        dots.append(
            f'<circle cx="{truth / 4:.1f}" cy="{150 - error / 2:.1f}" r="3" fill="{colour}">'
            f"<title>{title}</title></circle>"
        )
    axes = '<path d="M0 150H750M150 0V300" stroke="#999"/><text x="600" y="145">truth, 0..3000 mm</text>'
    svg = f'<svg width="760" height="310">{axes}{"".join(dots)}</svg>'
    return svg + "<p>error clipped to +-300 mm; red: said it cannot see</p>"


def _case(case: PairResult, picture: str) -> str:
    truth = f"{case.entry.nearest_mm:.0f} mm" if np.isfinite(case.entry.nearest_mm) else "nothing there"
    text = f"{case.entry.name}: truth {truth}, read {case.read_mm:.0f} mm, can see: {case.can_see}. {case.reason}"
    return f'<p>{escape(text)}<br><img src="data:image/png;base64,{picture}">'


def _png(image: Image) -> str:
    cv2 = opencv()
    return base64.b64encode(cv2.imencode(".png", image)[1].tobytes()).decode("ascii")

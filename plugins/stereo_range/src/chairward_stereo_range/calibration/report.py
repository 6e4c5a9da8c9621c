"""The report of a calibration: one HTML file with a rectified pair, what is left over in each view, and the views."""

from __future__ import annotations

from base64 import b64encode
from html import escape
from pathlib import Path

import numpy as np

from chairward.stages import Image
from chairward_stereo_range.calibration.solve import Array, Result, epipolar_error
from chairward_stereo_range.calibration_file import Rectifier
from chairward_stereo_range.opencv import opencv

LINES = 16
ARROW = 60
"""Residuals are drawn so many times too long."""
STYLE = (
    "body{font:16px sans-serif;margin:2em;max-width:80em}table{border-collapse:collapse}"
    "td,th{padding:.2em .8em;text-align:left;border-bottom:1px solid #ccc}img,svg{max-width:100%;border:1px solid #888}"
)


def rectified_pair(result: Result) -> Image:
    """The pair of the view with the largest board, rectified, side by side, with lines along the rows (h x 2w x 3)."""
    cv2 = opencv()
    view = max(result.views, key=lambda v: float(np.ptp(v.left[:, 0], axis=0).prod()))
    height, width = view.pictures[0].shape
    both = np.hstack(Rectifier(result.calibration, width, height)(*view.pictures))
    picture = np.asarray(cv2.cvtColor(both, cv2.COLOR_GRAY2BGR), np.uint8)
    for row in np.linspace(0, height, LINES + 1)[1:-1]:
        cv2.line(picture, (0, int(row)), (2 * width, int(row)), (80, 200, 80), 1)
    return picture


def residual_plot(result: Result, side: int) -> str:
    """SVG: an arrow at every corner of every view, ARROW times too long, of the left (0) or right (1) picture."""
    height, width = result.views[0].pictures[side].shape
    corners = np.array([(view.left, view.right)[side][:, 0] for view in result.views])
    ends = corners + ARROW * result.solved.residual[side]
    lines = "".join(
        f'<line x1="{x:.0f}" y1="{y:.0f}" x2="{u:.0f}" y2="{v:.0f}"/>'
        for (x, y), (u, v) in zip(corners.reshape(-1, 2), ends.reshape(-1, 2), strict=True)
    )
    name = ("left", "right")[side]
    return (
        f'<svg viewBox="0 0 {width} {height}" width="{min(width, 560)}" role="img" '
        f'aria-label="residuals of the {name} picture"><g stroke="#0050b0">{lines}</g></svg>'
    )


def epipolar_plot(errors: Array) -> str:
    """SVG: how often the rows of a corner differ by so much after rectification, in steps of 0.05 px."""
    counts = np.bincount((errors / 0.05).astype(int).clip(0, 19), minlength=20)
    bars = "".join(
        f'<rect x="{20 * i}" y="{150 - 150 * n / counts.max():.0f}" width="18" height="{150 * n / counts.max():.0f}"/>'
        for i, n in enumerate(counts)
    )
    return (
        f'<svg viewBox="0 0 400 170" width="400" role="img" aria-label="rows apart after rectification">'
        f'<g fill="#0050b0">{bars}</g><text x="0" y="166" font-size="13">0 px</text>'
        f'<text x="190" y="166" font-size="13">0.5</text><text x="350" y="166" font-size="13">1 or more</text></svg>'
    )


def write_report(result: Result, path: Path) -> None:
    """Write the page: all pictures are inside it."""
    cv2 = opencv()
    c = result.calibration
    jpeg = b64encode(cv2.imencode(".jpg", rectified_pair(result), [cv2.IMWRITE_JPEG_QUALITY, 80])[1]).decode()
    figures = {
        "date": c.made,
        "picture": f"{c.image_width_px} x {c.image_height_px} px",
        "board": f"{c.board} inner corners, {c.square_mm:g} mm squares, bent by up to {c.board_bend_mm:.2f} mm",
        "views": f"{len(c.views_used)} used, {len(c.views_dropped)} dropped",
        "error (RMS)": f"left {c.left.rms_px:.3f}, right {c.right.rms_px:.3f}, both {c.rms_stereo_px:.3f} px",
        "rows apart": f"mean {c.epipolar_mean_px:.3f}, 95 % below {c.epipolar_p95_px:.3f} px; "
        f"on views left out of the solution 95 % below {c.epipolar_p95_unseen_px or 0:.3f} px",
        "baseline": f"{float(np.linalg.norm(c.translation_mm)):.2f} mm",
    }
    views = [(name, f"{rms:.3f} px") for name, rms in zip(c.views_used, result.solved.view_rms, strict=True)]
    views += [(name, f"dropped: {reason}") for name, reason in c.views_dropped.items()]
    text = (
        f'<!doctype html><html lang="en"><meta charset="utf-8"><title>Calibration</title><style>{STYLE}</style>'
        f"<h1>Calibration of {escape(c.made[:10])}</h1>{_table(list(figures.items()))}"
        "<h2>Rectified pair</h2><p>The same corner must lie on the same line in both pictures.</p>"
        f'<img alt="rectified pair with lines" src="data:image/jpeg;base64,{jpeg}">'
        f"<h2>What is left over</h2><p>Found minus expected, {ARROW} times too long: left, then right.</p>"
        f"{residual_plot(result, 0)} {residual_plot(result, 1)}"
        f"<h2>Rows apart after rectification</h2>{epipolar_plot(epipolar_error(result.views, result.solved))}"
        f"<h2>Views</h2>{_table(views)}</html>\n"
    )
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(text, encoding="utf-8")


def _table(rows: list[tuple[str, str]]) -> str:
    cells = "".join(f"<tr><th>{escape(name)}</th><td>{escape(text)}</td></tr>" for name, text in rows)
    return f"<table>{cells}</table>"

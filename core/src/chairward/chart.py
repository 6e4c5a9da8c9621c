"""Line charts as SVG text, without a library: for reports that open in any browser, on paper and for the colour-blind
(each line has its own dashes beside its colour)."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from html import escape
from itertools import pairwise
from math import floor, log10

WIDTH, HEIGHT, LEFT, RIGHT, TOP, BOTTOM = 900, 260, 64, 16, 34, 40
LOOKS = (("#0b5fa5", ""), ("#c2410c", "7 4"), ("#15803d", "2 3"), ("#6b21a8", "10 3 2 3"))
MOST_POINTS = 1500


@dataclass(frozen=True, slots=True)
class Line:
    """One curve; a y of None breaks it."""

    name: str
    xs: Sequence[float]
    ys: Sequence[float | None]


@dataclass(frozen=True, slots=True)
class Bar:
    """A horizontal mark, for example a limit."""

    name: str
    y: float


def chart(title: str, x_name: str, y_name: str, lines: Sequence[Line], bars: Sequence[Bar] = ()) -> str:
    """An SVG element with axes, grid, legend and the lines."""
    xs = [x for line in lines for x in line.xs] or [0.0, 1.0]
    ys = [y for line in lines for y in line.ys if y is not None] + [bar.y for bar in bars] + [0.0]
    x0, x1, y0, y1 = min(xs), max(xs), min(ys), max(ys)
    x1, y1 = (x1 if x1 > x0 else x0 + 1.0), (y1 if y1 > y0 else y0 + 1.0)

    def at(x: float, y: float) -> str:
        across = LEFT + (x - x0) / (x1 - x0) * (WIDTH - LEFT - RIGHT)
        down = HEIGHT - BOTTOM - (y - y0) / (y1 - y0) * (HEIGHT - TOP - BOTTOM)
        return f"{across:.1f},{down:.1f}"

    out = [
        f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {WIDTH} {HEIGHT}" role="img" '
        f'font-family="sans-serif" font-size="12"><title>{escape(title)}</title>',
        f'<rect width="{WIDTH}" height="{HEIGHT}" fill="white"/>',
        f'<text x="{LEFT}" y="16" font-weight="bold">{escape(title)}</text>',
        f'<text x="{WIDTH - RIGHT}" y="{HEIGHT - 6}" text-anchor="end">{escape(x_name)}</text>',
        f'<text x="4" y="{TOP - 6}">{escape(y_name)}</text>',
    ]
    for y in _ticks(y0, y1):
        out.append(f'<path d="M{at(x0, y)} L{at(x1, y)}" stroke="#ddd"/>')
        out.append(_label(at(x0, y), f"{y:g}", "end", -6, 4))
    out += [_label(at(x, y0), f"{x:g}", "middle", 0, 16) for x in _ticks(x0, x1)]
    for bar in bars:
        out.append(f'<path d="M{at(x0, bar.y)} L{at(x1, bar.y)}" stroke="#b91c1c" stroke-dasharray="1 3"/>')
        out.append(_label(at(x1, bar.y), bar.name, "end", -2, -3))
    for nth, line in enumerate(lines):
        colour, dashes = LOOKS[nth % len(LOOKS)]
        out += [
            f'<polyline points="{" ".join(at(x, y) for x, y in run)}" fill="none" stroke="{colour}" '
            f'stroke-width="1.6" stroke-dasharray="{dashes}"/>'
            for run in _runs(line)
        ]
        left = WIDTH - RIGHT - 190 * (len(lines) - nth)
        out.append(f'<path d="M{left},12 l28,0" stroke="{colour}" stroke-width="2" stroke-dasharray="{dashes}"/>')
        out.append(f'<text x="{left + 34}" y="16">{escape(line.name)}</text>')
    return "\n".join([*out, "</svg>"])


def _label(at: str, text: str, anchor: str, dx: float, dy: float) -> str:
    x, y = (float(part) for part in at.split(","))
    return f'<text x="{x + dx:.1f}" y="{y + dy:.1f}" text-anchor="{anchor}" fill="#555">{escape(text)}</text>'


def _runs(line: Line) -> list[list[tuple[float, float]]]:
    """The unbroken runs of points, thinned so that a picture stays small; a change of value is never thinned away."""
    step = max(1, len(line.xs) // MOST_POINTS)
    points = list(zip(line.xs, line.ys, strict=True))
    kept = {nth + side for nth, (a, b) in enumerate(pairwise(line.ys)) if _jumps(a, b) for side in (0, 1)}
    runs: list[list[tuple[float, float]]] = [[]]
    for nth, (x, y) in enumerate(points):
        if y is None:
            runs.append([])
        elif nth % step == 0 or nth in kept or nth == len(points) - 1:
            runs[-1].append((x, y))
    return [run for run in runs if run]


def _jumps(a: float | None, b: float | None) -> bool:
    """A change that the eye would miss: to or from nothing, or from and to zero."""
    return (a is None) != (b is None) or (a == 0.0) != (b == 0.0)


def _ticks(low: float, high: float) -> list[float]:
    """Four to eight round values between two."""
    step = 10.0 ** floor(log10((high - low) / 4.0))
    step *= next(m for m in (1, 2, 5, 10) if (high - low) / (step * m) <= 8)
    first = -(-low // step)
    return [round((first + nth) * step, 9) for nth in range(9) if (first + nth) * step <= high + 1e-9]

"""The report of an acceptance run: one HTML file that needs nothing else, to be read, printed, signed and filed."""

from __future__ import annotations

import base64
import hashlib
import platform
from collections.abc import Sequence
from dataclasses import dataclass
from html import escape
from pathlib import Path

from chairward.chart import Line, chart
from chairward.check.result import Result
from chairward.check.timing import Timing
from chairward.plan import Plan

STYLE = """
body { font-family: sans-serif; max-width: 60rem; margin: 2rem auto; padding: 0 1rem; color: #111; }
table { border-collapse: collapse; width: 100%; }
th, td { border: 1px solid #999; padding: .35rem .6rem; text-align: left; }
.pass, .fail { white-space: nowrap; }
.pass { color: #15603a; } .fail { color: #a11; font-weight: bold; }
figure { margin: 1.2rem 0; page-break-inside: avoid; }
img { width: 320px; image-rendering: pixelated; border: 1px solid #999; }
.sign td { height: 3rem; } svg { width: 100%; height: auto; border: 1px solid #ddd; }
"""


@dataclass(frozen=True, slots=True)
class Head:
    """What was tried, when and by whom. on: date and time. versions: of what was installed."""

    on: str
    by: str
    versions: Sequence[str]


def html(plan: Plan, results: Sequence[Result], timing: Timing | None, head: Head) -> str:
    """The whole page."""
    failed = sum(not result.ok for result in results)
    verdict = "passed" if results and not failed else f"NOT passed: {failed} of {len(results)} steps failed"
    facts = [
        ("chair", f"{plan.chair} ({plan.kind.value})"),
        ("chair file", f"{Path(plan.chair_file).name}, SHA-256 {digest(Path(plan.chair_file))}"),
        ("person", plan.person),
        ("drive", plan.drive.component),
        ("date", head.on),
        ("tried by", head.by or "—"),
        (
            "computer",
            f"{platform.machine()}, {platform.system()} {platform.release()}, Python {platform.python_version()}",
        ),
        ("software", ", ".join(head.versions)),
        ("limits", _limits(plan)),
    ]
    if timing is not None:
        facts.append(("reaction, glass to wire", f"{timing} ({timing.method})"))
    figures = [_figure(result) for result in results if result.curve or result.picture]
    return "\n".join(
        [
            "<!doctype html>",
            f'<html lang="en"><head><meta charset="utf-8"><title>{escape(plan.chair)}: acceptance run</title>',
            f"<style>{STYLE}</style></head><body>",
            f"<h1>Acceptance run of '{escape(plan.chair)}': {escape(verdict)}</h1>",
            "<p>Wheels off the ground. This is no certificate: Chairward is not a certified medical device, and its "
            "stop is a protective stop.</p>",
            "<table>",
            *(f"<tr><th>{escape(name)}</th><td>{escape(value)}</td></tr>" for name, value in facts),
            "</table><h2>Steps</h2><table><tr><th>step</th><th>result</th><th>found</th><th>allowed</th></tr>",
            *(_row(result) for result in results),
            "</table><h2>Signed off</h2>",
            '<table class="sign"><tr><th>integrator</th><th>date</th><th>signature</th></tr>',
            "<tr><td></td><td></td><td></td></tr><tr><td></td><td></td><td></td></tr></table>",
            "<h2>Figures</h2>",
            *figures,
            "</body></html>",
        ]
    )


def digest(path: Path) -> str:
    """By which the chair file can be told to be the one that was tried."""
    return hashlib.sha256(path.read_bytes()).hexdigest() if path.is_file() else "(not there)"


def _limits(plan: Plan) -> str:
    limits = plan.limits
    return (
        f"stop at {limits.stop_mm} mm, {limits.forward_mm_s:g} mm/s forward, "
        f"reaction {limits.reaction_s * 1000:.0f} ms, {limits.decel_mm_s2:.0f} mm/s²"
    )


def _row(result: Result) -> str:
    kind, word = ("pass", "✓ pass") if result.ok else ("fail", "✗ FAIL")
    cells = (result.found, result.allowed)
    return (
        f'<tr><td>{escape(result.step)}</td><td class="{kind}">{word}</td>'
        + "".join(f"<td>{escape(text)}</td>" for text in cells)
        + "</tr>"
    )


def _figure(result: Result) -> str:
    parts = [f"<figure><figcaption>{escape(result.step)}</figcaption>"]
    if result.picture:
        data = base64.b64encode(result.picture).decode()
        parts.append(f'<img alt="what the camera saw: {escape(result.step)}" src="data:image/png;base64,{data}">')
    if curve := result.curve:
        lines = [Line("told", curve.s, curve.told), Line("reported", curve.s, curve.reported)]
        parts.append(chart(result.step, "s", curve.unit, lines))
    return "\n".join([*parts, "</figure>"])

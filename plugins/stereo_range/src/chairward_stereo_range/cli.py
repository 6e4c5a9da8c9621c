"""`chairward range ...`."""

from __future__ import annotations

import json
import re
from pathlib import Path
from typing import Annotated, Any

import typer

range_app = typer.Typer(no_args_is_help=True, help="Distances by stereo: how good are they?")


@range_app.callback()
def _range() -> None:
    """Keep `range evaluate` a sub-command."""


def _fail(message: str) -> typer.Exit:
    typer.echo(f"chairward: {message}", err=True)
    return typer.Exit(2)


@range_app.command("evaluate")
def evaluate_command(
    manifest: Annotated[Path, typer.Argument(help="CSV of stereo pairs and sequences with truth")],
    method: Annotated[str | None, typer.Option(help="How to match (default: the stage's own default)")] = None,
    size: Annotated[
        str, typer.Option(help="Working size; its height counts, the pictures keep their aspect")
    ] = "320x240",
    also: Annotated[
        str, typer.Option(help="Stage that has a vote beside stereo while driving; none: stereo alone")
    ] = "vision_obstacle",
    as_json: Annotated[bool, typer.Option("--json", help="One JSON object on standard output")] = False,
    report: Annotated[
        Path | None, typer.Option(help="Write an HTML page with the worst cases into this folder")
    ] = None,
) -> None:
    """Measure distances on a test set and compare them with its truth."""
    from typing import get_args

    from chairward.plugins import PluginError
    from chairward_stereo_range import beside, evaluate, figures
    from chairward_stereo_range import manifest as sets
    from chairward_stereo_range.gate import thesis_gate
    from chairward_stereo_range.matching import Method
    from chairward_stereo_range.settings import StereoRangeSettings
    from chairward_stereo_range.stage import options_of

    allowed = get_args(Method)
    if method is not None and method not in allowed:
        raise _fail(f"--method {method}: use one of {', '.join(allowed)}")
    found = re.fullmatch(r"(\d+)x(\d+)", size)
    if found is None or not 120 <= int(found.group(2)) <= 1080:
        raise _fail(f"--size {size}: write WIDTHxHEIGHT with 120..1080 rows, e.g. 320x240")
    settings = StereoRangeSettings.model_validate({"region": "trapezoid", **({"method": method} if method else {})})
    try:
        gate = thesis_gate(settings.method)
        second = beside.stage_maker(beside.NO_STAGE if settings.method.startswith("thesis") else also)
        entries = sets.read(manifest)
        results = evaluate.run(entries, options_of(settings), int(found.group(2)), gate, also=second)
        summary: dict[str, Any] = {
            "manifest": manifest.name,
            "method": settings.method,
            "gated": gate is not None,
            "also": None if second is None else also,
            "size": size,
            **figures.summary(results),
        }
        if report is not None:
            from chairward_stereo_range.report import write_report

            path = write_report(report, manifest, results, summary, options_of(settings), int(found.group(2)), gate)
            summary["report"] = str(path)
    except (sets.ManifestError, PluginError) as error:
        raise _fail(str(error)) from error
    typer.echo(json.dumps(summary) if as_json else "\n".join(_lines(summary)))


def _lines(summary: dict[str, Any], indent: str = "") -> list[str]:
    """The figures as text: name, value, [95 % bounds], n."""
    lines = []
    for key, value in summary.items():
        if key in ("n", "bounds_95"):
            continue
        if isinstance(value, dict):
            lines += [f"{indent}{key}:", *_lines(value, indent + "  ")]
        else:
            low_high = summary.get("bounds_95", {}).get(key) if isinstance(summary.get("bounds_95"), dict) else None
            n = summary["n"][key] if low_high else None
            extra = f"  [{low_high[0]}, {low_high[1]}]  n {n}" if low_high and low_high[0] is not None else ""
            lines.append(f"{indent}{key:24s} {value}{extra}")
    return lines

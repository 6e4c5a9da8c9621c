"""`chairward range ...` and `chairward calibrate ...`."""

from __future__ import annotations

import glob
import json
import re
from pathlib import Path
from typing import Annotated, Any

import typer

range_app = typer.Typer(no_args_is_help=True, help="Distances by stereo: how good are they?")
calibrate_app = typer.Typer(no_args_is_help=True, help="Calibrate what the chair sees with.")


@range_app.callback()
def _range() -> None:
    """Keep `range evaluate` a sub-command."""


@calibrate_app.callback()
def _calibrate() -> None:
    """Keep `calibrate stereo` a sub-command."""


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
    as_json: Annotated[bool, typer.Option("--json", help="One JSON object on standard output")] = False,
    report: Annotated[
        Path | None, typer.Option(help="Write an HTML page with the worst cases into this folder")
    ] = None,
) -> None:
    """Measure distances on a test set and compare them with its truth."""
    from typing import get_args

    from chairward_stereo_range import evaluate, figures
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
        entries = sets.read(manifest)
        results = evaluate.run(entries, options_of(settings), int(found.group(2)), gate)
        summary: dict[str, Any] = {
            "manifest": manifest.name,
            "method": settings.method,
            "gated": gate is not None,
            "size": size,
            **figures.summary(results),
        }
        if report is not None:
            from chairward_stereo_range.report import write_report

            path = write_report(report, manifest, results, summary, options_of(settings), int(found.group(2)), gate)
            summary["report"] = str(path)
    except sets.ManifestError as error:
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


@calibrate_app.command("stereo")
def calibrate_stereo(
    left: Annotated[str, typer.Option(help="Pattern of the left pictures, e.g. 'boards/left*.jpg'")],
    right: Annotated[
        str, typer.Option(help="Pattern of the right pictures; paired with the left ones by order of name")
    ],
    out: Annotated[Path, typer.Option(help="The calibration file to write")],
    board: Annotated[str, typer.Option(help="Inner corners, COLUMNSxROWS")] = "9x6",
    square_mm: Annotated[float, typer.Option(min=1.0, max=500.0, help="Side of one square, mm")] = 25.0,
    as_json: Annotated[bool, typer.Option("--json", help="One JSON object on standard output")] = False,
) -> None:
    """Calibrate a stereo pair from pictures of a chessboard, and write the chair's calibration file."""
    from chairward_stereo_range import calibrate as work
    from chairward_stereo_range.calibration_file import CalibrationError

    found = re.fullmatch(r"(\d+)x(\d+)", board)
    if found is None or min(int(found.group(1)), int(found.group(2))) < 3:
        raise _fail(f"--board {board}: write the inner corners as COLUMNSxROWS, at least 3x3, e.g. 9x6")
    columns, rows = int(found.group(1)), int(found.group(2))
    try:
        pairs = _pairs(left, right)
        views, dropped, size = work.find_views(pairs, (columns, rows))
        result = work.calibrate(views, dropped, size, (columns, rows), square_mm)
        result.save(out)
    except CalibrationError as error:
        raise _fail(str(error)) from error
    summary = {
        "views_used": len(result.views_used),
        "views_dropped": len(result.views_dropped),
        "dropped": result.views_dropped,
        "rms_left": round(result.left.rms_px, 4),
        "rms_right": round(result.right.rms_px, 4),
        "rms_stereo": round(result.rms_stereo_px, 4),
        "epipolar_mean": round(result.epipolar_mean_px, 4),
        "epipolar_p95": round(result.epipolar_p95_px, 4),
        "out": str(out),
    }
    typer.echo(json.dumps(summary) if as_json else "\n".join(_lines(summary)))


def _natural(path: str) -> list[int | str]:
    return [int(part) if part.isdigit() else part for part in re.split(r"(\d+)", path)]


def _pairs(left: str, right: str) -> list[tuple[Path, Path]]:
    """Left and right pictures by their numbers where all names have one that both sides share, else by order."""
    from chairward_stereo_range.calibration_file import CalibrationError

    sides = [sorted(glob.glob(pattern), key=_natural) for pattern in (left, right)]
    for option, pattern, names in (("--left", left, sides[0]), ("--right", right, sides[1])):
        if not names:
            raise CalibrationError(f"{option} {pattern}: matches no file")
    by_number = [
        {m.group(0): name for name in names if (m := re.search(r"\d+(?=\D*$)", Path(name).name))} for names in sides
    ]
    shared = [number for number in by_number[0] if number in by_number[1]]
    if shared and all(len(n) == len(s) for n, s in zip(by_number, sides, strict=True)):
        return [(Path(by_number[0][n]), Path(by_number[1][n])) for n in shared]
    if len(sides[0]) != len(sides[1]):
        raise CalibrationError(
            f"--left matches {len(sides[0])} files, --right {len(sides[1])}: give equally many, or number them alike"
        )
    return [(Path(a), Path(b)) for a, b in zip(*sides, strict=True)]

"""`chairward calibrate ...`: the camera pair, and how it stands on the chair."""

from __future__ import annotations

import glob
import json
import re
from collections.abc import Callable
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import TYPE_CHECKING, Annotated, Any

import typer

if TYPE_CHECKING:
    from chairward_stereo_range.calibration.boards import View
    from chairward_stereo_range.calibration.camera_pair import CameraPair
    from chairward_stereo_range.calibration.live import Progress
    from chairward_stereo_range.calibration.solve import Result

app = typer.Typer(no_args_is_help=True, help="Calibrate what the chair sees with.")

Json = Annotated[bool, typer.Option("--json", help="One JSON object on standard output")]
Chair = Annotated[str | None, typer.Option(help="Take the pictures from the camera lane of this chair")]
Lane = Annotated[str | None, typer.Option(help="... from this lane of it (default: its first with a camera pair)")]
Sets = Annotated[list[str] | None, typer.Option("--set", help="... with component.key=value in place of the file's")]


def _fail(message: str) -> typer.Exit:
    typer.echo(f"chairward: {message}", err=True)
    return typer.Exit(2)


@app.command("stereo")
def stereo(
    out: Annotated[Path, typer.Option(help="The calibration file to write")],
    left: Annotated[
        str | None, typer.Option(help="Pattern of the left pictures, e.g. 'boards/left*.jpg'; live: the left device")
    ] = None,
    right: Annotated[
        str | None, typer.Option(help="Pattern of the right pictures, paired by number or order; live: the device")
    ] = None,
    board: Annotated[str, typer.Option(help="Inner corners, COLUMNSxROWS")] = "9x6",
    square_mm: Annotated[float, typer.Option(min=1.0, max=500.0, help="Side of one square, mm")] = 25.0,
    live: Annotated[
        bool, typer.Option("--live", help="Take pictures now: --chair, or --left and --right devices")
    ] = False,
    chair: Chair = None,
    lane: Lane = None,
    sets: Sets = None,
    size: Annotated[str, typer.Option(help="Live with devices: picture size, WIDTHxHEIGHT")] = "640x480",
    still: Annotated[int, typer.Option(min=0, max=30, help="Live: pictures for which the board must be still")] = 3,
    keep: Annotated[Path | None, typer.Option(help="Live: folder in which the pictures that are used are kept")] = None,
    preview: Annotated[Path | None, typer.Option(help="Live: picture file that always shows the newest pair")] = None,
    json_lines: Annotated[bool, typer.Option("--json-lines", help="Live: one JSON object for each picture")] = False,
    report: Annotated[Path | None, typer.Option(help="Write an HTML page with pictures to this file")] = None,
    as_json: Json = False,
) -> None:
    """Calibrate a stereo pair from pictures of a chessboard, and write the chair's calibration file."""
    from chairward_stereo_range.calibration import boards, solve
    from chairward_stereo_range.calibration_file import CalibrationError

    found = re.fullmatch(r"(\d+)x(\d+)", board)
    if found is None or min(int(found.group(1)), int(found.group(2))) < 3:
        raise _fail(f"--board {board}: write the inner corners as COLUMNSxROWS, at least 3x3, e.g. 9x6")
    corners = int(found.group(1)), int(found.group(2))
    try:
        dropped: dict[str, str] = {}
        if live:
            pair = _source(chair, lane, sets, left, right, size)
            views = _live(pair, corners, still, keep, preview, json_lines)
        elif left is None or right is None:
            raise _fail("give --left and --right patterns of pictures, or --live with --chair or two devices")
        else:
            views, dropped = boards.read_views(_pairs(left, right), corners)
        result = solve.calibrate(views, dropped, corners, square_mm)
        result.calibration.save(out)
        if report is not None:
            from chairward_stereo_range.calibration.report import write_report

            write_report(result, report)
    except (CalibrationError, _source_error()) as error:
        if json_lines:
            typer.echo(json.dumps({"error": str(error)}))
        raise _fail(str(error)) from error
    summary = {**_summary(result), "out": str(out), **({"report": str(report)} if report else {})}
    if json_lines:
        typer.echo(json.dumps({"result": summary}))
    else:
        typer.echo(json.dumps(summary) if as_json else "\n".join(f"{k:24s} {v}" for k, v in summary.items()))


def _summary(result: Result) -> dict[str, Any]:
    c = result.calibration
    return {
        "views_used": len(c.views_used),
        "views_dropped": len(c.views_dropped),
        "dropped": c.views_dropped,
        "rms_left": round(c.left.rms_px, 4),
        "rms_right": round(c.right.rms_px, 4),
        "rms_stereo": round(c.rms_stereo_px, 4),
        "epipolar_mean": round(c.epipolar_mean_px, 4),
        "epipolar_p95": round(c.epipolar_p95_px, 4),
        "epipolar_p95_unseen": None if c.epipolar_p95_unseen_px is None else round(c.epipolar_p95_unseen_px, 4),
        "board_bend_mm": round(c.board_bend_mm, 3),
    }


@app.command("mount")
def mount(
    chair: Annotated[str, typer.Option(help="The chair file whose camera lane looks at the floor")],
    lane: Lane = None,
    sets: Sets = None,
    pictures: Annotated[int, typer.Option(min=1, max=300, help="Pairs to look at")] = 20,
    write: Annotated[bool, typer.Option("--write", help="Change the lane's pose in the chair file")] = False,
    as_json: Json = False,
) -> None:
    """Find the cameras' height, pitch and roll from the floor that they see."""
    from chairward_stereo_range.calibration import mounting
    from chairward_stereo_range.calibration_file import CalibrationError

    try:
        source = _source(chair, lane, sets, None, None, "")
        found = mounting.measure(source, pictures)
        if write:
            mounting.write(source, found)
    except (CalibrationError, _source_error()) as error:
        raise _fail(str(error)) from error
    summary = {**found.as_json(), "lane": source.lane, "line": mounting.line(source.pose, found), "written": write}
    if as_json:
        typer.echo(json.dumps(summary))
        return
    typer.echo("\n".join(f"{name:24s} {value}" for name, value in found.as_json().items()))
    where = f"{source.chair_file}: [lane.{source.lane}]"
    typer.echo(f"{where} now says:" if write else f"{where}: put this line there, or run again with --write:")
    typer.echo(mounting.line(source.pose, found))


def _source_error() -> type[Exception]:
    from chairward_stereo_range.calibration.camera_pair import SourceError

    return SourceError


def _source(
    chair: str | None, lane: str | None, sets: list[str] | None, left: str | None, right: str | None, size: str
) -> CameraPair:
    from chairward_stereo_range.calibration import camera_pair

    if chair is not None:
        return camera_pair.of_chair(chair, lane, sets or [])
    if left is None or right is None:
        raise _fail("--live needs a camera pair: give --chair NAME, or the devices as --left and --right")
    return camera_pair.of_devices(left, right, size)


def _live(
    source: CameraPair, board: tuple[int, int], still: int, keep: Path | None, preview: Path | None, lines: bool
) -> list[View]:
    """Collect views until enough is covered, the source ends, or the person presses Ctrl-C."""
    from chairward_stereo_range.calibration import live, screen
    from chairward_stereo_range.opencv import opencv

    cv2 = opencv()
    session = live.Session(board, still)

    def save(path: Path, picture: Any) -> None:
        path.parent.mkdir(parents=True, exist_ok=True)
        part = path.with_name(f".part-{path.name}")
        if not cv2.imwrite(str(part), picture):
            raise _fail(f"{path}: cannot be written as a picture: use a name that ends in .jpg or .png")
        part.replace(path)

    def step(progress: Progress, show: Callable[[Progress], None]) -> None:
        if preview is not None:
            save(preview, live.preview(progress))
        if keep is not None and progress.taken:
            for side, picture in zip(("left", "right"), progress.pictures, strict=True):
                save(keep / f"{side}{progress.coverage.views:02d}.png", picture)
        show(progress)

    with TemporaryDirectory() as folder:
        pair = source.make(Path(folder))
        if lines:
            live.follow(pair, session, lambda progress: step(progress, _print_line))
        else:
            with screen.Screen() as shown:
                live.follow(pair, session, lambda progress: step(progress, shown.show))
    return session.views


def _print_line(progress: Progress) -> None:
    typer.echo(json.dumps(progress.as_json()))


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

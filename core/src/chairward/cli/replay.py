"""`chairward replay FILE`: every decision of a recording again, bit for bit, or under another profile."""

from __future__ import annotations

import json
import time
from pathlib import Path
from typing import Annotated

import typer
from mcap.exceptions import McapError
from rich.console import Console
from rich.table import Table

from chairward.cli.places import PlaceError, told, writable
from chairward.plan import Plan
from chairward.profile import ProfileError
from chairward.recording import read_plan

FIRST = 10


def replay(
    file: Annotated[Path, typer.Argument(help="a recording (.mcap)")],
    what_if: Annotated[
        str | None,
        typer.Option("--what-if", metavar="PROFILE", help="a person, or a chair file: what would it have changed?"),
    ] = None,
    picture: Annotated[
        Path | None, typer.Option(help="with --what-if: where the picture goes; default: beside FILE, as .svg")
    ] = None,
    cores: Annotated[int | None, typer.Option(min=1, help="use at most so many processes; default: all")] = None,
    as_json: Annotated[bool, typer.Option("--json", help="as JSON")] = False,
) -> None:
    """Decide again all that was recorded and compare. Exit code 1 when any decision comes out differently.

    With --what-if the same facts are decided under another profile, and the differences are shown.
    """
    try:
        plan = read_plan(file)
        if what_if is not None:
            picture = picture or file.with_suffix(".what-if.svg")
            writable("--picture", picture.parent)
            _what_if(file, plan, what_if, picture, as_json=as_json)
            return
        same = _again(file, plan, cores, as_json=as_json)
    except (OSError, McapError, PlaceError, ProfileError) as error:
        typer.echo(f"chairward: {told(error)}", err=True)
        raise typer.Exit(2) from None
    raise typer.Exit(0 if same else 1)


def _again(file: Path, plan: Plan, cores: int | None, *, as_json: bool) -> bool:
    from chairward.replay import replay as decide_again

    began = time.perf_counter()
    found = decide_again(file, plan.limits, cores)
    seconds = time.perf_counter() - began
    reproduced = found.decisions - len(found.differences)
    first = found.differences[:FIRST]
    if as_json:
        summary = {
            "decisions": found.decisions,
            "reproduced": reproduced,
            "missing": found.missing,
            "gaps": [{"after_tick": gap.after_tick, "count": gap.count, "at_s": gap.at_s} for gap in found.gaps],
            "recorded_s": round(found.seconds, 3),
            "seconds": round(seconds, 3),
            "first_differences": [{"tick": d.tick, "what": d.what} for d in first],
        }
        typer.echo(json.dumps(summary, indent=1))
        return not found.differences
    typer.echo(f"{reproduced} of {found.decisions} decisions reproduced bit for bit in {seconds:.2f} s")
    if found.seconds:
        typer.echo(f"{found.seconds:.1f} s were recorded: {found.seconds / seconds:.0f} times real time")
    if found.missing:
        typer.echo(f"{found.missing} more decisions were made in that time but not recorded")
    for gap in found.gaps[:FIRST]:
        typer.echo(f"at {gap.at_s} s: {gap.count} decisions after tick {gap.after_tick} are missing")
    for d in first:
        typer.echo(f"tick {d.tick}: {d.what}")
    return not found.differences


def _what_if(file: Path, plan: Plan, wanted: str, picture: Path, *, as_json: bool) -> None:
    from chairward.recording import read
    from chairward.what_if import compare

    other = _other(plan, wanted)
    names = (f"{plan.chair}, {plan.person} (recorded)", f"{other.chair}, {other.person}")
    found = compare(read(file), names, other.limits)
    picture.write_text(found.picture(), encoding="utf-8")
    if as_json:
        typer.echo(json.dumps({**found.result(), "picture": str(picture)}, indent=1))
        return
    table = Table("what", *names)
    for row in found.rows():
        table.add_row(*row)
    console = Console()
    console.print(table)
    typer.echo(f"{found.different} of {found.decisions} decisions would have been different")
    for m in found.moments:
        then, now = m.then.drive_mm_s, m.now.drive_mm_s
        typer.echo(f"at {m.at_s} s: {then:.0f} -> {now:.0f} mm/s ({m.why})")
    typer.echo("The same facts were decided again; where the chair would have gone instead is not known.")
    typer.echo(f"picture: {picture}")


def _other(plan: Plan, wanted: str) -> Plan:
    """The recorded chair with another person, or another chair with the recorded person. Raises ProfileError."""
    from chairward import profile
    from chairward.plugins import discover
    from chairward.profile import files

    registry, folder = discover(), files.directory()
    path = Path(wanted) if wanted.endswith(".toml") or "/" in wanted else None
    is_chair = path.parent.name == "chairs" if path else wanted in files.names("chairs", folder)
    if is_chair and not (path is None and wanted in files.names("people", folder)):
        return profile.load_traced(wanted, Path(plan.person_file), [], registry).plan
    return profile.load_traced(Path(plan.chair_file), wanted, [], registry).plan

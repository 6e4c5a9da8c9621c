"""`chairward record inspect|export|redact`: what can be done with a recording."""

from __future__ import annotations

import json
from dataclasses import asdict
from pathlib import Path
from typing import Annotated, NoReturn

import typer
from mcap.exceptions import McapError

from chairward.cli.places import PlaceError, told, writable
from chairward.recording import tools
from chairward.recording.redact import redact as redacted

app = typer.Typer(
    name="record", no_args_is_help=True, help="Look into recordings, take them apart, make them fit to give away."
)
File = Annotated[Path, typer.Argument(help="a recording (.mcap), whole or cut")]
LEVELS = {2: "", 3: "warning: ", 4: "ERROR: "}


def _fail(error: Exception) -> NoReturn:
    typer.echo(f"chairward: {told(error)}", err=True)
    raise typer.Exit(2) from None


@app.command()
def inspect(
    file: File,
    log: Annotated[bool, typer.Option(help="also everything that was said in it")] = False,
    as_json: Annotated[bool, typer.Option("--json", help="as JSON")] = False,
) -> None:
    """Who drove what for how long, what is in the file, and what it says it missed."""
    try:
        found = tools.inspect(file)
    except (OSError, McapError) as error:
        _fail(error)
    if as_json:
        typer.echo(json.dumps(asdict(found), indent=1))
        return
    typer.echo(f"{found.file}: {found.size / 1e6:.1f} MB, {found.seconds:.1f} s")
    if found.cut:
        typer.echo("it was cut, or is still being written: what comes after these seconds is not in it")
    typer.echo(f"{found.person} drove '{found.chair}' with {found.drive}" if found.chair else "it holds no plan")
    typer.echo(f"{found.decisions} decisions, {found.protective_stops} protective stops, {found.missed} missed")
    for topic, count in found.messages.items():
        typer.echo(f"  {count:8} {topic}")
    for said in found.log if log else ():
        typer.echo(f"{said['at_s']:8.2f} s  {LEVELS.get(said['level'], '')}{said['message']}")


@app.command()
def export(
    file: File,
    to: Annotated[Path, typer.Option(help="a folder; made if need be")],
    form: Annotated[str, typer.Option("--format", help="csv or jsonl")] = "csv",
) -> None:
    """Write a table for each kind of message, and the pictures as PNG files."""
    if form not in ("csv", "jsonl"):
        _fail(ValueError(f"--format {form}: csv or jsonl"))
    try:
        writable("--to", to)
        written = tools.export(file, to, "csv" if form == "csv" else "jsonl")
    except (OSError, PlaceError, McapError) as error:
        _fail(error)
    typer.echo(f"{to}: {len(written)} files written")


@app.command()
def redact(file: File, to: Annotated[Path, typer.Argument(help="the copy; must not be there yet")]) -> None:
    """Copy a recording without pictures, words, the person's name and any path; it replays bit for bit all the same.

    In every text "…" stands for a path, a name, and whatever was in quotes. What the chair, its lanes and components
    are called stays.
    """
    try:
        writable("the copy", to.parent)
        count = redacted(file, to)
    except (OSError, PlaceError, McapError) as error:
        _fail(error)
    typer.echo(f"{to}: {count} decisions, without pictures, words, the person's name and any path")

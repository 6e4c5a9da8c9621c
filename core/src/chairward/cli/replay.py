"""`chairward replay FILE`: every decision of a recording again, bit for bit."""

from __future__ import annotations

import json
import time
from pathlib import Path
from typing import Annotated

import typer
from mcap.exceptions import McapError

from chairward.replay import read_plan
from chairward.replay import replay as decide_again


def replay(
    file: Annotated[Path, typer.Argument(help="a recording (.mcap)")],
    as_json: Annotated[bool, typer.Option("--json", help="as JSON")] = False,
) -> None:
    """Decide again all that was recorded and compare. Exit code 1 when any decision comes out differently."""
    try:
        limits = read_plan(file).limits
        began = time.perf_counter()
        found = decide_again(file, limits)
        seconds = time.perf_counter() - began
    except (OSError, McapError) as error:
        typer.echo(f"chairward: {error}", err=True)
        raise typer.Exit(2) from None
    reproduced = found.decisions - len(found.differences)
    first = found.differences[:10]
    if as_json:
        summary = {
            "decisions": found.decisions,
            "reproduced": reproduced,
            "missing": found.missing,
            "seconds": round(seconds, 3),
            "first_differences": [{"tick": d.record.tick, "what": d.what} for d in first],
        }
        typer.echo(json.dumps(summary, indent=1))
    else:
        typer.echo(f"{reproduced} of {found.decisions} decisions reproduced bit for bit in {seconds:.2f} s")
        if found.missing:
            typer.echo(f"{found.missing} more decisions were made in that time but not recorded")
        for d in first:
            typer.echo(f"tick {d.record.tick}: {d.what}")
    raise typer.Exit(1 if found.differences else 0)

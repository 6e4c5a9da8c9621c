"""`chairward replay FILE`: every decision of a recording again, bit for bit."""

from __future__ import annotations

import json
import time
from pathlib import Path
from typing import Annotated

import typer
from mcap.exceptions import McapError

from chairward.replay import Difference, differences, read_plan


def replay(
    file: Annotated[Path, typer.Argument(help="a recording (.mcap)")],
    as_json: Annotated[bool, typer.Option("--json", help="as JSON")] = False,
) -> None:
    """Decide again all that was recorded and compare. Exit code 1 when any decision comes out differently."""
    try:
        limits = read_plan(file).limits
        began = time.perf_counter()
        results = list(differences(file, limits))
        seconds = time.perf_counter() - began
    except (OSError, McapError) as error:
        typer.echo(f"chairward: {error}", err=True)
        raise typer.Exit(2) from None
    found = [r for r in results if isinstance(r, Difference)]
    summary = {
        "decisions": len(results),
        "reproduced": len(results) - len(found),
        "seconds": round(seconds, 3),
        "first_differences": [{"tick": d.record.tick, "what": d.what} for d in found[:10]],
    }
    if as_json:
        typer.echo(json.dumps(summary, indent=1))
    else:
        typer.echo(f"{summary['reproduced']} of {len(results)} decisions reproduced bit for bit in {seconds:.2f} s")
        for d in found[:10]:
            typer.echo(f"tick {d.record.tick}: {d.what}")
    raise typer.Exit(1 if found else 0)

"""`chairward doctor`: what is wrong here, each with one fix."""

from __future__ import annotations

import json
from dataclasses import asdict
from typing import Annotated

import typer
from rich.console import Console
from rich.table import Column, Table
from rich.text import Text

from chairward.doctor.examine import examine
from chairward.plugins import discover


def doctor(
    chair: Annotated[str | None, typer.Option(help="also look at this chair's profile and devices")] = None,
    person: Annotated[str | None, typer.Option(help="with this person")] = None,
    as_json: Annotated[bool, typer.Option("--json", help="as JSON")] = False,
) -> None:
    """Find what is wrong on this machine and chair. Exit code 1 when something that is needed is missing."""
    findings = list(examine(discover(), chair, person))
    bad = any(not f.ok and f.needed for f in findings)
    if as_json:
        typer.echo(json.dumps([asdict(f) for f in findings], indent=1))
    else:
        table = Table("", "check", Column("found", overflow="fold"), Column("what to do", overflow="fold"))
        for f in findings:
            good = "[green]ok[/]" if f.tried else "[dim]not tried[/]"
            mark = good if f.ok else ("[red]wrong[/]" if f.needed else "[yellow]advice[/]")
            table.add_row(mark, f.check, Text(f.what), Text(f.fix))
        Console().print(table)
    raise typer.Exit(1 if bad else 0)

"""`chairward plugins`: what is installed, what each offers, what was refused; and how good a plugin is."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Annotated

import typer
from rich.console import Console
from rich.table import Table
from rich.text import Text

from chairward.plugins import KINDS, discover

app = typer.Typer(help="What is installed and what each offers; `grade NAME`: how good a plugin is.")


@app.callback(invoke_without_command=True)
def plugins(
    context: typer.Context,
    as_json: Annotated[bool, typer.Option("--json", help="as JSON, with the schema of the settings")] = False,
) -> None:
    """List installed plugins with what they offer, and those that were refused with the reason."""
    if context.invoked_subcommand is not None:
        return
    registry = discover()
    rows = [
        {"kind": kind, "name": name, "plugin": registry.origin[f"{kind} {name}"], "summary": component.summary}
        for kind in KINDS
        for name, component in sorted(registry.components[kind].items())
    ]
    refused = [{"plugin": r.plugin, "reason": r.reason} for r in registry.refused]
    if as_json:
        whole = [
            {**r, "settings": registry.components[r["kind"]][r["name"]].settings.model_json_schema()} for r in rows
        ]
        typer.echo(json.dumps({"components": whole, "refused": refused}, indent=1))
        return
    table = Table("kind", "component", "plugin", "what it is")
    for row in rows:
        table.add_row(*row.values())
    for row in refused:
        table.add_row("refused", "-", row["plugin"], row["reason"], style="red")
    Console().print(table)


@app.command()
def grade(
    name: Annotated[str, typer.Argument(help="of the plugin, as `chairward plugins` lists it")],
    folder: Annotated[Path, typer.Option(help="the plugin's project: its README.md, tests/ and src/")] = Path(),
    tests: Annotated[Path | None, typer.Option(help="its tests, if not in FOLDER/tests")] = None,
    as_json: Annotated[bool, typer.Option("--json")] = False,
) -> None:
    """Grade a plugin: bronze, silver, gold or platinum, with the rules that give each. Runs its tests."""
    from chairward.grades import GradeError, graded

    try:
        result = graded(
            name, folder.resolve(), (tests or folder / "tests").resolve(), say=lambda t: typer.echo(t, err=True)
        )
    except GradeError as error:
        typer.echo(f"chairward: {error}", err=True)
        raise typer.Exit(2) from error
    if as_json:
        typer.echo(json.dumps(result.as_dict(), indent=1))
        return
    table = Table("grade", "rule", "kept", "why not")
    for rule in result.rules:
        kept = {True: "yes", False: "NO", None: "not tried"}[rule.kept]
        table.add_row(rule.grade, rule.says, kept, Text(rule.why), style=None if rule.kept else "red")
    Console().print(table)
    typer.echo(f"{name}: {result.grade or 'no grade yet'}")

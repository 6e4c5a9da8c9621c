"""`chairward new-plugin`: four small files to begin a plugin with."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from chairward.plugins import discover
from chairward.scaffold import KINDS, ScaffoldError, write


def new_plugin(
    name: Annotated[str, typer.Argument(help="of the plugin: small letters, digits, underscores; e.g. garden_sonar")],
    kind: Annotated[str, typer.Option(help=f"one of {', '.join(KINDS)}")],
    into: Annotated[Path, typer.Option("--to", help="the folder in which the plugin's folder is made")] = Path(),
) -> None:
    """Make a plugin that passes its contract tests, or fails them with a sentence that says what to do."""
    registry = discover()
    taken = {plugin for plugin, _ in registry.manager.list_name_plugin()} | {one.plugin for one in registry.refused}
    taken |= {component for offered in registry.components.values() for component in offered}
    try:
        if name in taken:
            raise ScaffoldError(
                f"something named '{name}' is installed already (see `chairward plugins`): choose another name"
            )
        folder = write(name, kind, into)
    except ScaffoldError as error:
        typer.echo(f"chairward: {error}", err=True)
        raise typer.Exit(2) from error
    typer.echo(f"{folder}: now  uv pip install -e '{folder}[testing]'  and  pytest -x {folder}")
    typer.echo("(with ./run before each in a checkout)")

"""`chairward check ...`: measurements and trials on a chair, each one command of this group."""

from __future__ import annotations

import typer

from chairward.cli import check_drive

app = typer.Typer(
    name="check",
    invoke_without_command=True,
    help="Measure and try a chair before somebody sits in it. Wheels off the ground first.",
)


@app.callback()
def check(context: typer.Context) -> None:
    """Without a command: what there is to check."""
    if context.invoked_subcommand is None:
        typer.echo(context.get_help())


app.command("drive")(check_drive.drive)

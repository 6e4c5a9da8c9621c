"""`chairward sim ...`: simulated partners as programs; plugins add theirs to this shared group."""

from __future__ import annotations

import typer

app = typer.Typer(
    name="sim",
    no_args_is_help=True,
    help="Simulated controllers that a person can run, to try a drive without hardware.",
)

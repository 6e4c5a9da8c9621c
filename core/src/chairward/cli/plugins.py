"""`chairward plugins`: what is installed, what each offers, and what was refused."""

from __future__ import annotations

import json
from typing import Annotated

import typer
from rich.console import Console
from rich.table import Table

from chairward.plugins import KINDS, discover


def plugins(
    as_json: Annotated[bool, typer.Option("--json", help="as JSON, with the schema of the settings")] = False,
) -> None:
    """List installed plugins with what they offer, and those that were refused with the reason."""
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

"""The root of the command line; plugins add their own commands through the `chairward_commands` hook."""

from __future__ import annotations

import sys

import typer

from chairward.cli import chair, check, check_chair, doctor, new_plugin, plugins, profile_edit, record, replay, run, sim
from chairward.plugins import Registry, discover

app = typer.Typer(
    name="chairward",
    no_args_is_help=True,
    add_completion=False,
    pretty_exceptions_enable=False,
    help="Drive a powered wheelchair by your own words, while sensors keep it from hitting things. "
    "Not a certified medical device: its stop is a protective stop.",
)


app.command()(run.run)
app.command()(run.demo)
app.add_typer(plugins.app, name="plugins")
app.command("new-plugin")(new_plugin.new_plugin)
app.command("doctor")(doctor.doctor)
app.command("replay")(replay.replay)
app.add_typer(profile_edit.app, name="profile")
check.app.command("chair")(check_chair.chair)
check.app.command("timing")(check_chair.timing)
app.add_typer(check.app, name="check")
app.add_typer(chair.app, name="chair")
app.add_typer(record.app, name="record")


def add_plugin_commands(registry: Registry) -> None:
    """Let every plugin add its commands; one that cannot is named, the others stay."""
    for name, plugin in registry.manager.list_name_plugin():
        add_commands = getattr(plugin, "chairward_commands", None)
        if add_commands is None:
            continue
        try:
            add_commands(app=app)
        except Exception as error:  # noqa: BLE001 - one plugin's broken commands must not take the others away
            typer.echo(f"chairward: commands of plugin '{name}' are not in use: {error}", err=True)
    if sim.app.registered_commands:
        app.add_typer(sim.app)


def main() -> None:
    """Entry point of the `chairward` command."""
    registry = discover()
    for refusal in registry.refused:
        typer.echo(f"chairward: plugin '{refusal.plugin}' is not in use: {refusal.reason}", err=True)
    add_plugin_commands(registry)
    app(prog_name="chairward")
    sys.exit(0)

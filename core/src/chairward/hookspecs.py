"""The pluggy hooks. They only *register*, once, at start: no hook is called while the chair drives.

A plugin is a module (or object) behind an entry point of the group `chairward.plugins` with
`CHAIRWARD_API = 1` and any of these hooks, marked with `@hookimpl`.
"""

from __future__ import annotations

from collections.abc import Sequence

import pluggy
import typer

from chairward.components import Component
from chairward.findings import Check

PROJECT = "chairward"
ENTRY_POINT_GROUP = "chairward.plugins"

hookspec = pluggy.HookspecMarker(PROJECT)
hookimpl = pluggy.HookimplMarker(PROJECT)


@hookspec
def chairward_sources() -> Sequence[Component]:
    """Devices that yield items or messages: cameras, microphones, switches, sonars."""
    raise NotImplementedError


@hookspec
def chairward_sensors() -> Sequence[Component]:
    """Stages that turn items into RangeReading or Veto facts."""
    raise NotImplementedError


@hookspec
def chairward_recognizers() -> Sequence[Component]:
    """Stages that turn items into Intent and Alive facts."""
    raise NotImplementedError


@hookspec
def chairward_drives() -> Sequence[Component]:
    """Ways to the wheels. They run inside the guard: trusted code."""
    raise NotImplementedError


@hookspec
def chairward_observers() -> Sequence[Component]:
    """Readers of every record: dashboards, recorders, telemetry."""
    raise NotImplementedError


@hookspec
def chairward_companions() -> Sequence[Component]:
    """Programs that stand in for the outside world (simulated controller, simulated home)."""
    raise NotImplementedError


@hookspec
def chairward_checks() -> Sequence[Check]:
    """What `chairward doctor` is to look at in this plugin's devices; asked by the doctor alone."""
    raise NotImplementedError


@hookspec
def chairward_commands(app: typer.Typer) -> None:
    """Add sub-commands to the CLI."""
    raise NotImplementedError

"""What this plugin offers: registered once, at start, without touching a device."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

from chairward.components import Component, Context
from chairward.hookspecs import hookimpl
from chairward_drive_can.settings import CanSettings, SimCanSettings

if TYPE_CHECKING:
    import typer

    from chairward.doctor import Check
    from chairward_drive_can.companion import SimCan
    from chairward_drive_can.drive import CanDrive

CHAIRWARD_API = 1


def make_drive(settings: CanSettings, context: Context) -> CanDrive:
    """The drive of `[drive.can]`."""
    from chairward_drive_can.make import make

    return make(settings, context.chair_dir)


@hookimpl
def chairward_drives() -> Sequence[Component]:
    return [
        Component(
            name="can",
            settings=CanSettings,
            make=make_drive,
            summary="CAN wheelchair controllers: R-Net, any DBC file, CANopen CiA 402",
        )
    ]


def make_sim(settings: SimCanSettings, context: Context) -> SimCan:
    """The simulated controller of `[companion.X] component = "sim_can"`."""
    from chairward_drive_can.companion import SimCan

    return SimCan(settings, context)


@hookimpl
def chairward_companions() -> Sequence[Component]:
    return [
        Component(
            name="sim_can",
            settings=SimCanSettings,
            make=make_sim,
            summary="a simulated CAN controller: R-Net, the DBC file's, or CiA 402",
        )
    ]


@hookimpl
def chairward_commands(app: typer.Typer) -> None:
    from chairward_drive_can.cli import add_commands

    add_commands(app)


@hookimpl
def chairward_checks() -> Sequence[Check]:
    """The bus."""
    from chairward_drive_can.checks import checks

    return checks()

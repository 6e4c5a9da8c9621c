"""What this plugin offers: registered once, at start, without touching a device."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import typer

from chairward.components import Component, Context
from chairward.hookspecs import hookimpl
from chairward_drive_pic_serial.settings import PicSerialSettings
from chairward_drive_pic_serial.sim_pic import SimPicSettings

if TYPE_CHECKING:
    from chairward.doctor import Check

CHAIRWARD_API = 1


@hookimpl
def chairward_drives() -> Sequence[Component]:
    """The PIC16F877A motor controller."""
    return [
        Component(
            name="pic_serial",
            settings=PicSerialSettings,
            make=_make_drive,
            summary="PIC16F877A motor controller on a serial line (57600 baud, acknowledged, stops by itself)",
        )
    ]


@hookimpl
def chairward_companions() -> Sequence[Component]:
    """A simulated PIC."""
    return [
        Component(
            name="sim_pic",
            settings=SimPicSettings,
            make=_make_sim,
            summary="the PIC with its firmware, as a model or in gpsim, behind a pty",
        )
    ]


@hookimpl
def chairward_commands(app: typer.Typer) -> None:
    """`chairward pic ...` and `chairward sim pic`."""
    from chairward.cli import sim
    from chairward_drive_pic_serial.commands import pic, sim_pic

    app.add_typer(pic, name="pic")
    sim.app.command("pic")(sim_pic)


def _make_drive(settings: PicSerialSettings, _context: Context) -> Any:
    from chairward_drive_pic_serial.drive import PicSerialDrive

    return PicSerialDrive(settings)


def _make_sim(settings: SimPicSettings, context: Context) -> Any:
    from chairward_drive_pic_serial.sim_pic import SimPic

    return SimPic(settings, context.run_dir)


@hookimpl
def chairward_checks() -> Sequence[Check]:
    """The controller at its port."""
    from chairward_drive_pic_serial.checks import checks

    return checks()

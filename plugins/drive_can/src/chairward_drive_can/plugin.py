"""What this plugin offers: registered once, at start, without touching a device."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

from chairward.components import Component, Context
from chairward.hookspecs import hookimpl
from chairward_drive_can.settings import CanSettings

if TYPE_CHECKING:
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

"""The drive for a chair file's settings."""

from __future__ import annotations

from pathlib import Path

from chairward_drive_can.bus import preload
from chairward_drive_can.drive import CanDrive
from chairward_drive_can.frames import Frame
from chairward_drive_can.settings import CanSettings


def make(settings: CanSettings, chair_dir: Path = Path()) -> CanDrive:
    """The drive with its dialect; relative files are looked for beside the chair file. Raises DriveError."""
    preload()
    if settings.dialect == "rnet":
        from chairward_drive_can.rnet_dialect import RnetDialect

        exchange: list[Frame] = []
        if settings.rnet.takeover == "emulate" and settings.rnet.startup:
            from chairward_drive_can import startup

            exchange = startup.load(chair_dir / settings.rnet.startup)
        return CanDrive(settings, lambda: RnetDialect(settings, exchange))
    if settings.dialect == "dbc":
        from chairward_drive_can.dbc import DbcDialect, load

        database = load(settings.dbc, chair_dir)
        return CanDrive(settings, lambda: DbcDialect(settings, database))
    from chairward_drive_can.cia402 import Cia402Dialect

    return CanDrive(settings, lambda: Cia402Dialect(settings))

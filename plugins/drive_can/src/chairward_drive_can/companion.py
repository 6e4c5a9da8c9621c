"""`sim_can`: a simulated CAN controller beside a run, whose motors the simulated home can read."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

from chairward.components import Context
from chairward.shared_state import PIN_NAMES, SharedState
from chairward_drive_can.bus import Bus, open_bus
from chairward_drive_can.partners.run import AdapterPty, Partner, serve
from chairward_drive_can.settings import CanSettings, SimCanSettings


def new_partner(settings: SimCanSettings, folder: Path) -> Partner:
    """The simulated controller. Raises DriveError for a DBC file that does not fit."""
    if settings.dialect == "rnet":
        from chairward_drive_can.partners.rnet import RnetChair

        return RnetChair(
            joystick_module=settings.joystick_module,
            silence_ms=settings.silence_ms,
            startup_ms=settings.startup_ms,
            full_percent=settings.full_percent,
        )
    if settings.dialect == "cia402":
        from chairward_drive_can.partners.cia402 import Cia402Chair

        return Cia402Chair()
    from chairward_drive_can.dbc import load
    from chairward_drive_can.partners.dbc import DbcChair

    return DbcChair(
        settings.dbc,
        load(settings.dbc, folder),
        full_forward=settings.full_forward,
        full_turn=settings.full_turn,
        silence_ms=settings.silence_ms,
        boot_ms=settings.startup_ms,
    )


def new_end(settings: SimCanSettings) -> Bus:
    """The controller's end of the bus. Raises DriveError."""
    if settings.interface == "slcan":
        return AdapterPty(Path(settings.channel))
    place = {"interface": settings.interface, "channel": settings.channel, "bitrate": settings.bitrate}
    return open_bus(CanSettings.model_validate({"dialect": "rnet", **place}))


class SimCan:
    """`chairward.components.Companion`."""

    def __init__(self, settings: SimCanSettings, context: Context) -> None:
        self._settings, self._context = settings, context

    def run(self, ready: Callable[[], None], stopping: Callable[[], bool]) -> None:
        partner = new_partner(self._settings, self._context.chair_dir)
        pins = SharedState.create(self._context.run_dir / "pins", PIN_NAMES)
        end = new_end(self._settings)
        try:
            ready()
            serve(partner, end, stopping, pins)
        finally:
            end.close()
            pins.close()

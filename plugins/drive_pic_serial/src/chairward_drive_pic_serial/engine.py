"""What stands at the far end of the wire in simulations: the model, or the real firmware in gpsim."""

from __future__ import annotations

from typing import Protocol

from chairward_drive_pic_serial.model import FirmwareModel
from chairward_drive_pic_serial.motor import Pins


class Engine(Protocol):
    """A PIC: bytes in, bytes out, pins; its time passes only in `advance`."""

    def feed(self, data: bytes) -> None:
        """Bytes from the host; each takes its time on the line."""

    def take(self) -> bytes:
        """The bytes that have left the PIC since the last call."""

    def advance(self, microseconds: float) -> None:
        """Let time pass."""

    def line_clear_s(self) -> float:
        """Until something on the line comes to its end, as far as the engine knows; at least how soon to look again."""

    def pins(self) -> Pins:
        """The pins now."""

    def registers(self) -> tuple[int, int]:
        """(state, fault) as in the firmware's RAM."""

    def set_inputs(self, *, stop: bool | None = None, charger: bool | None = None, battery: int | None = None) -> None:
        """Stop input and charger (True: contact open, pin high), battery 0..255; None leaves as it is."""

    def restart(self) -> None:
        """Reset, as by the reset pin."""

    def close(self) -> None:
        """End it; may be called twice."""


class ModelEngine(FirmwareModel):
    """The Python model as an engine."""

    def registers(self) -> tuple[int, int]:
        """(state, fault)."""
        return int(self.state), int(self.fault)

    def set_inputs(self, *, stop: bool | None = None, charger: bool | None = None, battery: int | None = None) -> None:
        """Set the pins from outside."""
        self.stop_input = self.stop_input if stop is None else stop
        self.charger = self.charger if charger is None else charger
        self.battery_pin = self.battery_pin if battery is None else battery

    def restart(self) -> None:
        """Reset pin."""
        self.reset()

    def close(self) -> None:
        """Nothing to end."""

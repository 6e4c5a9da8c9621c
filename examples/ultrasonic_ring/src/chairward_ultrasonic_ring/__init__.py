"""Four ultrasonic rangers (HC-SR04, URM09 or the like) round the chair, read by a small board on a serial line.

The board sends, twenty times a second, one line of ASCII with a counter and a checksum (see `line.py`).
"""

from __future__ import annotations

import select
import time
from collections.abc import Sequence

import serial
from pydantic import Field

from chairward.components import Component, Context, DeviceLost, Settings
from chairward.hookspecs import hookimpl
from chairward.messages import NOTHING_NEAR_MM, RangeReading
from chairward_ultrasonic_ring.line import Echoes, newest

CHAIRWARD_API = 1
MEASURING_NS = 40_000_000
"""The board fires the four rangers one after the other: its oldest echo is that old when the line begins."""


class RingSettings(Settings):
    """Where the ring is plugged in and how it is mounted."""

    port: str = Field(min_length=1, description="serial port of the ring's board, e.g. /dev/serial/by-id/...")
    baud: int = Field(115200, ge=9600, le=921600, description="speed of the line, as set in the board")
    inset_mm: int = Field(0, ge=0, le=500, description="how far inside the chair's outline the rangers sit")


class Ring:
    """A source of range readings in all four ways."""

    def __init__(self, settings: RingSettings, context: Context) -> None:
        del context
        self.settings = settings
        self.line: serial.Serial | None = None
        self.rest, self.seq, self.last_count = b"", 0, -1

    def open(self) -> None:
        """Open the port; what waited in it is dropped. Raises DeviceLost."""
        self.close()
        try:
            self.line = serial.Serial(self.settings.port, self.settings.baud, timeout=0, exclusive=True)
            self.line.reset_input_buffer()
        except (serial.SerialException, OSError) as error:
            raise DeviceLost(f"ring {self.settings.port} cannot be opened: plug it in or correct its port") from error

    def read(self, timeout_s: float) -> RangeReading | None:
        """The newest line as a reading; None after timeout_s. Raises DeviceLost."""
        if self.line is None:
            raise DeviceLost(f"ring {self.settings.port} is not open: open() comes first")
        try:
            ready, _, _ = select.select([self.line], [], [], timeout_s)
            data = self.line.read(65536) if ready else b""
        except (serial.SerialException, OSError, ValueError, TypeError) as error:
            raise DeviceLost(f"ring {self.settings.port} was unplugged: plug it in again") from error
        echoes, self.rest = newest(self.rest + data)
        return self._reading(echoes) if echoes else None

    def close(self) -> None:
        """Give the port back; may be called twice."""
        if self.line is not None:
            self.line.close()
            self.line = None
        self.rest = b""

    def _reading(self, echoes: Echoes) -> RangeReading:
        self.seq += 1
        captured_ns = time.monotonic_ns() - MEASURING_NS
        frozen, self.last_count = echoes.count == self.last_count, echoes.count
        silent = [way for way, echo_mm in echoes.ways.items() if echo_mm is None]
        if frozen or silent:
            reason = "its counter stands still" if frozen else f"ranger {silent[0]} does not answer"
            return RangeReading(seq=self.seq, captured_ns=captured_ns, can_see=False, reason=f"ring: {reason}")
        ways = {f"{way}_mm": self._from_outline(echo_mm or 0) for way, echo_mm in echoes.ways.items()}
        return RangeReading(seq=self.seq, captured_ns=captured_ns, can_see=True, **ways)

    def _from_outline(self, echo_mm: int) -> int:
        return max(0, echo_mm - self.settings.inset_mm) if echo_mm else NOTHING_NEAR_MM


@hookimpl
def chairward_sources() -> Sequence[Component]:
    """One source, which is its own sensor."""
    what = "four ultrasonic rangers on a serial line"
    return [Component(name="ultrasonic_ring", settings=RingSettings, make=Ring, gives=(RangeReading,), summary=what)]

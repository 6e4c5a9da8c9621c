"""One classical CAN frame, as everything in this plugin hands it around; light, so that pure code needs no library."""

from __future__ import annotations

from typing import NamedTuple

MS = 1_000_000


class Frame(NamedTuple):
    """id: 11 bits, or 29 when extended. data: 0..8 bytes, empty for a remote request."""

    id: int
    data: bytes = b""
    extended: bool = False
    remote: bool = False

    def __str__(self) -> str:
        """As `cansend` writes it: 02000100#0064."""
        name = f"{self.id:08X}" if self.extended else f"{self.id:03X}"
        return f"{name}#R" if self.remote else f"{name}#{self.data.hex().upper()}"

"""The firmware's serial line in time: bytes arrive one by one, replies leave by a ring, a register and a shifter."""

from __future__ import annotations

from collections import deque
from math import inf

from chairward_drive_pic_serial import wire

CYCLES_PER_US = 5
RX_BYTE_CYCLES = 10 * 5_000_000 / wire.BAUD
TX_BYTE_CYCLES = 880
"""The PIC's own clock divides to 56818 baud."""
RING_MAX = 51
"""A reply is dropped when the ring of 64 bytes holds more than this."""


class Uart:
    """Times are instruction cycles."""

    def __init__(self) -> None:
        self._out = bytearray()
        self.reset()

    def reset(self) -> None:
        """Both ways are empty; what has left the PIC is on the wire and stays."""
        self._rx: deque[tuple[float, int]] = deque()
        self._rx_free = 0.0
        self._ring: deque[int] = deque()
        self._hold: int | None = None
        self._shift: int | None = None
        self._shift_end = 0

    def feed(self, data: bytes, now: int) -> None:
        """Bytes from the host; each takes its time on the line."""
        at = max(self._rx_free, float(now))
        for byte in data:
            at += RX_BYTE_CYCLES
            self._rx.append((at, byte))
        self._rx_free = at

    def take(self) -> bytes:
        """The bytes that have left since the last call."""
        data = bytes(self._out)
        self._out.clear()
        return data

    def send(self, data: bytes) -> None:
        """A reply, whole or not at all."""
        if len(self._ring) <= RING_MAX:
            self._ring.extend(data)

    @property
    def rx_at(self) -> float:
        """When the next byte has arrived; infinity when none is on its way."""
        return self._rx[0][0] if self._rx else inf

    @property
    def tx_at(self) -> float:
        """When the byte that is leaving has left; infinity when none is."""
        return self._shift_end if self._shift is not None else inf

    def received(self) -> int:
        """The byte that has arrived."""
        return self._rx.popleft()[1]

    def left(self) -> None:
        """The byte that was leaving is on the wire."""
        self._out.append(self._shift or 0)
        self._shift = None

    def pump(self, now: int) -> None:
        """As the main loop does: from the ring to the register, from there to the shifter."""
        while self._ring or self._hold is not None:
            if self._shift is None:
                self._shift = self._hold if self._hold is not None else self._ring.popleft()
                self._hold = None
                self._shift_end = now + TX_BYTE_CYCLES
            elif self._hold is None:
                self._hold = self._ring.popleft()
            else:
                break

    def clear_s(self, now: int) -> float:
        """Until the last byte on its way in has arrived, else out; infinity on a quiet line."""
        if self._rx:
            return (self._rx_free - now) / CYCLES_PER_US / 1e6
        if self._shift is None:
            return inf
        waiting = len(self._ring) + (self._hold is not None)
        return (self._shift_end - now + waiting * TX_BYTE_CYCLES) / CYCLES_PER_US / 1e6

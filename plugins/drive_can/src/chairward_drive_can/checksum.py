"""The one-byte checksums that controllers put into their frames; over every byte but the checksum's own."""

from __future__ import annotations

from collections.abc import Callable
from functools import reduce


def xor8(data: bytes) -> int:
    """All bytes exclusive-or'ed."""
    return reduce(lambda total, byte: total ^ byte, data, 0)


def sum8(data: bytes) -> int:
    """All bytes added, modulo 256."""
    return sum(data) & 0xFF


def _crc8(data: bytes, polynomial: int) -> int:
    """CRC-8, most significant bit first, initial value and final exclusive-or 0xFF."""
    crc = 0xFF
    for byte in data:
        crc ^= byte
        for _ in range(8):
            crc = (crc << 1 ^ polynomial if crc & 0x80 else crc << 1) & 0xFF
    return crc ^ 0xFF


def crc8_j1850(data: bytes) -> int:
    """SAE J1850: polynomial 0x1D (check value of "123456789": 0x4B)."""
    return _crc8(data, 0x1D)


def crc8_autosar(data: bytes) -> int:
    """AUTOSAR CRC8H2F: polynomial 0x2F (check value of "123456789": 0xDF)."""
    return _crc8(data, 0x2F)


KINDS: dict[str, Callable[[bytes], int]] = {
    "xor8": xor8,
    "sum8": sum8,
    "crc8_j1850": crc8_j1850,
    "crc8_autosar": crc8_autosar,
}

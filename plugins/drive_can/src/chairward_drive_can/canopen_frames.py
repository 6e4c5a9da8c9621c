"""The few CANopen frames a drive needs (CiA 301): NMT, heartbeat, expedited SDO. Pure; never raises on bytes.

The canopen package answers SDO requests by blocking its caller for up to 0.3 s, which the guard cannot allow.
"""

from __future__ import annotations

from dataclasses import dataclass

from chairward_drive_can.frames import Frame

START, STOP, PREOPERATIONAL, RESET_NODE, RESET_COMMUNICATION = 0x01, 0x02, 0x80, 0x81, 0x82
OPERATIONAL_STATE, PREOPERATIONAL_STATE = 0x05, 0x7F

ABORTS = {
    0x05040000: "no answer in time",
    0x06010002: "read only",
    0x06020000: "no such object",
    0x06040041: "cannot be mapped to a PDO",
    0x06040042: "the PDO would be too long",
    0x06070010: "wrong size",
    0x06090011: "no such sub-index",
    0x06090030: "value out of range",
    0x06090031: "value too high",
    0x06090032: "value too low",
    0x08000020: "cannot be stored",
    0x08000022: "not in this state",
}


@dataclass(frozen=True, slots=True)
class Entry:
    """One value of a node's object dictionary, to be written at set-up. size: bytes."""

    index: int
    sub: int
    size: int
    value: int
    what: str

    def __str__(self) -> str:
        return f"0x{self.index:04X}:{self.sub:02X} ({self.what})"


def nmt(command: int, node: int) -> Frame:
    """Network management: start, stop, pre-operational, reset of one node (0: all)."""
    return Frame(0x000, bytes((command, node)))


def heartbeat(node: int, state: int = OPERATIONAL_STATE) -> Frame:
    """ "I am alive", in that state."""
    return Frame(0x700 + node, bytes((state,)))


def sdo_write(node: int, entry: Entry) -> Frame:
    """Expedited download request: one frame, at most four bytes of value."""
    value = entry.value & ((1 << 8 * entry.size) - 1)
    head = 0x23 | (4 - entry.size) << 2
    return Frame(
        0x600 + node,
        bytes((head, entry.index & 0xFF, entry.index >> 8, entry.sub)) + value.to_bytes(4, "little"),
    )


def sdo_read(node: int, index: int, sub: int) -> Frame:
    """Upload request."""
    return Frame(0x600 + node, bytes((0x40, index & 0xFF, index >> 8, sub, 0, 0, 0, 0)))


@dataclass(frozen=True, slots=True)
class SdoAnswer:
    """What a node answered. abort: 0, or its reason. value: of an expedited read, else None."""

    index: int
    sub: int
    abort: int = 0
    value: int | None = None

    @property
    def reason(self) -> str:
        """The abort in words."""
        return f"{ABORTS.get(self.abort, 'refused')} (abort 0x{self.abort:08X})"


def sdo_answer(data: bytes) -> SdoAnswer | None:
    """The answer in the data of frame 0x580 + node; None for anything that is none."""
    if len(data) != 8:
        return None
    index, sub, value = data[1] | data[2] << 8, data[3], int.from_bytes(data[4:], "little")
    if data[0] == 0x80:
        return SdoAnswer(index, sub, abort=value)
    if data[0] == 0x60:
        return SdoAnswer(index, sub)
    if data[0] & 0xE2 == 0x42:
        size = 4 - (data[0] >> 2 & 3) if data[0] & 1 else 4
        return SdoAnswer(index, sub, value=value & ((1 << 8 * size) - 1))
    return None

"""The bytes between host and PIC: COBS frames ended by 0x00, payload = type, seq, body, CRC-16/IBM-3740 big-endian.

57600 baud 8N1. Every reply has a body of six bytes and echoes the sequence number of what it answers; 0 means that
nobody asked (a reset, the motion watchdog, the stop input, the charger).
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from enum import IntEnum, IntFlag

from cobs import cobs
from fastcrc import crc16

BAUD = 57_600
PROTOCOL = 1
FULL = 100
"""DRIVE values are -100..100, hundredths of full; steer is positive to the left, drive positive forward."""
SHORTEST, LONGEST = 4, 12
"""Payload lengths with CRC that either side takes."""


class Ask(IntEnum):
    """What the host sends."""

    DRIVE = 0x01
    """steer, drive: int8, absolute, both every time."""
    HELLO = 0x02
    """rise, fall: milliseconds for each hundredth faster and slower, 1..50."""
    ESTOP = 0x03
    """Latch a stop; obeyed whatever its sequence number."""
    CLEAR = 0x04
    """nonce high, low: lift the latch of exactly this boot."""
    BRAKE = 0x05
    """0: brake at once and stay armed; 1: brake and leave ARMED."""


class Reply(IntEnum):
    """What the PIC sends."""

    STATUS = 0x81
    HELLO = 0x82
    NAK = 0xFF


class State(IntEnum):
    """The firmware's states: BOOT -HELLO-> NEUTRAL -DRIVE 0,0-> ARMED; ESTOP from anywhere, left by CLEAR."""

    BOOT = 0
    NEUTRAL = 1
    ARMED = 2
    ESTOP = 3


class Fault(IntFlag):
    """Why the firmware stopped; SILENCE goes with HELLO or arming, the others with CLEAR."""

    SILENCE = 1
    STOP_INPUT = 2
    HOST = 4


class Input(IntFlag):
    """What the firmware sees now."""

    STOP = 1
    CHARGER = 2
    BRAKE = 4
    STANDING = 8


class Why(IntEnum):
    """Why a frame was not obeyed."""

    CRC = 1
    FRAME = 2
    TYPE = 3
    RANGE = 4
    STATE = 5
    SEQ = 6
    NONCE = 7
    CHARGING = 8


class Reason(IntEnum):
    """What the last reset was."""

    POWER_ON = 0
    BROWN_OUT = 1
    WATCHDOG = 2
    RESET_PIN = 3


@dataclass(frozen=True, slots=True)
class Status:
    """STATUS: applied values -100..100, battery 0..255 of the ADC's range."""

    seq: int
    state: State
    fault: Fault
    steer: int
    drive: int
    battery: int
    inputs: Input


@dataclass(frozen=True, slots=True)
class Hello:
    """HELLO reply; also sent once, with seq 0, after every reset."""

    seq: int
    protocol: int
    state: State
    nonce: int
    reason: Reason
    timeout_ms: int


@dataclass(frozen=True, slots=True)
class Nak:
    """A frame was not obeyed; seq 0 when its CRC or framing was broken."""

    seq: int
    why: Why
    state: State
    fault: Fault
    last: int


Answer = Status | Hello | Nak


def encode(payload: bytes) -> bytes:
    """Payload without CRC -> bytes on the wire, final 0x00 included."""
    return bytes(cobs.encode(payload + crc16.ibm_3740(payload).to_bytes(2, "big"))) + b"\0"


def ask(kind: Ask, seq: int, *body: int) -> bytes:
    """One frame from the host; signed values are taken modulo 256."""
    return encode(bytes([kind, seq & 0xFF, *(b & 0xFF for b in body)]))


def payload(frame: bytes) -> bytes | None:
    """One frame without its final 0x00 -> payload without CRC; None for anything broken."""
    try:
        data = bytes(cobs.decode(frame))
    except cobs.DecodeError:
        return None
    if not SHORTEST <= len(data) <= LONGEST or crc16.ibm_3740(data) != 0:
        return None
    return data[:-2]


def answer(data: bytes) -> Answer | None:
    """A reply's payload -> what it says; None for what this protocol does not know."""
    if len(data) != 8:
        return None
    kind, seq, *b = data
    try:
        if kind == Reply.STATUS:
            return Status(seq, State(b[0]), _fault(b[1]), signed(b[2]), signed(b[3]), b[4], Input(b[5] & 0x0F))
        if kind == Reply.HELLO:
            return Hello(seq, b[0], State(b[1]), b[2] << 8 | b[3], Reason(b[4]), b[5])
        if kind == Reply.NAK:
            return Nak(seq, Why(b[0]), State(b[1]), _fault(b[2]), b[3])
    except ValueError:
        return None
    return None


def signed(byte: int) -> int:
    """A byte as int8."""
    return byte - 256 if byte > 127 else byte


def _fault(byte: int) -> Fault:
    if byte > 7:
        raise ValueError(f"unknown fault bits {byte:#x}")
    return Fault(byte)


class Splitter:
    """Cuts a stream at 0x00; keeps at most `limit` bytes of a frame that does not end."""

    def __init__(self, limit: int = 64) -> None:
        self._part = bytearray()
        self._limit = limit
        self.broken = 0

    def feed(self, data: bytes) -> Iterator[bytes]:
        """The payloads of all whole and sound frames; the others are counted in `broken`."""
        self._part += data
        *frames, rest = self._part.split(b"\0")
        if len(rest) > self._limit:
            self.broken += 1
            rest = rest[-self._limit :]
        self._part = bytearray(rest)
        for frame in frames:
            if not frame:
                continue
            good = payload(bytes(frame))
            if good is None:
                self.broken += 1
            else:
                yield good

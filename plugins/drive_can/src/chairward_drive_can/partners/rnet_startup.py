"""The power-up exchange of the simulated R-Net chair: a stand-in of the right shape, with keys of our own."""

from __future__ import annotations

import random
from dataclasses import dataclass, field

from chairward_drive_can.frames import Frame
from chairward_drive_can.startup import speaker

KEYS = bytes((0x31, 0x5A, 0x07, 0x99, 0xC4, 0x18, 0xE2, 0x6D))


def conversation(serial: bytes, challenge: int) -> list[Frame]:
    """Both sides, in order: hello, serial numbers one by one, configuration, parameters, mode, run."""
    chance = random.Random(challenge)
    serials = []
    for place in range(8):
        head = 0x1F000000 | place << 20 | KEYS[place] << 8
        serials += [
            Frame(head | chance.randrange(256), extended=True, remote=True),
            Frame(head | 0x10000 | serial[place] ^ KEYS[place], extended=True),
        ]
    return [
        Frame(0x00C),
        Frame(0x7B3),
        Frame(0x7B3, remote=True),
        *serials,
        Frame(0x7B1),
        Frame(0x040, bytes(4)),
        Frame(0x780, bytes.fromhex("2081000001000000")),
        Frame(0x790, bytes.fromhex("4081000000000000")),
        Frame(0x040, bytes.fromhex("80000000")),
        Frame(0x061, bytes.fromhex("00000000")),
        Frame(0x060, bytes.fromhex("01000000")),
        Frame(0x7B0),
    ]


@dataclass
class PowerModule:
    """The power module's side: asks, and goes on only when the right answer came."""

    serial: bytes
    challenge: int = 1
    wrong: int = 0
    _at: int = 0
    _talk: list[Frame] = field(default_factory=list)

    def __post_init__(self) -> None:
        self._talk = conversation(self.serial, self.challenge)

    @property
    def running(self) -> bool:
        """The exchange is over."""
        return self._at >= len(self._talk)

    def hear(self, frame: Frame) -> list[Frame]:
        """The questions that follow a right answer; a wrong one ends it."""
        if self.running or speaker(frame) != "joystick":
            return []
        if frame != self._talk[self._at]:
            self.wrong += 1
            return []
        self._at += 1
        asked = []
        while not self.running and speaker(self._talk[self._at]) == "power":
            asked.append(self._talk[self._at])
            self._at += 1
        return asked

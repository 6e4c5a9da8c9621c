"""Holds the Python model against the firmware in gpsim: the same random steps to both, compared after each.

A frame is started so that its last byte arrives in the middle of a tick, and both are looked at just before the next
one: then tick and frame have the same order in both, and everything must be equal: replies, state, fault, every pin.
"""

from __future__ import annotations

import random
from dataclasses import dataclass

from chairward_drive_pic_serial import wire
from chairward_drive_pic_serial.engine import ModelEngine
from chairward_drive_pic_serial.gpsim import Gpsim
from chairward_drive_pic_serial.model import TICK_CYCLES
from chairward_drive_pic_serial.motor import Pins
from chairward_drive_pic_serial.uart import CYCLES_PER_US, RX_BYTE_CYCLES
from chairward_drive_pic_serial.wire import Ask

GPSIM_BOOT_CYCLES = 760
"""gpsim writes its EEPROM in no time; found from the phase of its ticks."""
LOOK = 4_500
"""Cycles after a tick at which both are looked at."""
ARRIVE = 2_500
"""Cycles after a tick at which the last byte of a frame arrives."""


@dataclass(frozen=True, slots=True)
class Step:
    """What happens to both: bytes, inputs, and the ticks that pass after them."""

    data: bytes = b""
    stop: bool | None = None
    charger: bool | None = None
    battery: int | None = None
    ticks: int = 4


@dataclass(frozen=True, slots=True)
class Seen:
    """What there is to compare."""

    replies: tuple[bytes, ...]
    registers: tuple[int, int]
    pins: Pins


class Pair:
    """A model and a gpsim with the same firmware, in step."""

    def __init__(self) -> None:
        self.model = ModelEngine(boot_cycles=GPSIM_BOOT_CYCLES)
        self.gpsim = Gpsim()
        self.model.advance_cycles(self.gpsim.now)
        self._splitters = (wire.Splitter(), wire.Splitter())
        self._seq = 0
        self.step(Step(ticks=5))

    def step(self, step: Step) -> tuple[Seen, Seen]:
        """The same to both; (model, gpsim)."""
        for engine in (self.model, self.gpsim):
            engine.set_inputs(stop=step.stop, charger=step.charger, battery=step.battery)
        if step.data:
            length = round(len(step.data) * RX_BYTE_CYCLES)
            self._to_phase((ARRIVE - length) % TICK_CYCLES)
            for engine in (self.model, self.gpsim):
                engine.feed(step.data)
            self._advance(length)
        self._to_phase(LOOK)
        self._advance(step.ticks * TICK_CYCLES)
        return self._seen(0), self._seen(1)

    def frame(self, kind: Ask, *body: int, skip: int = 1) -> bytes:
        """A sound frame with the next sequence number (or one that many on)."""
        self._seq = (self._seq + skip) & 0xFF
        return wire.ask(kind, self._seq, *body)

    def close(self) -> None:
        """End gpsim."""
        self.gpsim.close()

    def _advance(self, cycles: int) -> None:
        for engine in (self.model, self.gpsim):
            engine.advance(cycles / CYCLES_PER_US)

    def _to_phase(self, phase: int) -> None:
        self._advance((GPSIM_BOOT_CYCLES + phase - self.gpsim.now) % TICK_CYCLES)

    def _seen(self, which: int) -> Seen:
        engine = (self.model, self.gpsim)[which]
        return Seen(tuple(self._splitters[which].feed(engine.take())), engine.registers(), engine.pins())


def random_step(pair: Pair, chance: random.Random) -> Step:
    """One step of a random sequence: mostly sound frames, every kind of wrong one, inputs, silence."""
    ticks = chance.choice([4, 4, 4, 4, 4, 4, 7, 7, 7, 20, 20, 20, 60, 60, 230, 400])
    kind = chance.random()
    if kind < 0.38:
        value = chance.choice([0, 0, 3, 20, 60, 100])
        data = pair.frame(Ask.DRIVE, chance.randint(-value, value), chance.randint(-value, value))
    elif kind < 0.52:
        data = pair.frame(Ask.DRIVE, 0, 0)
    elif kind < 0.62:
        data = pair.frame(Ask.HELLO, chance.choice([1, 2, 8, 50, 0, 51]), chance.choice([1, 2, 5, 50]))
    elif kind < 0.66:
        data = pair.frame(Ask.ESTOP)
    elif kind < 0.73:
        data = pair.frame(Ask.CLEAR, pair.model.nonce >> 8, chance.choice([pair.model.nonce & 0xFF, 99]))
    elif kind < 0.80:
        data = pair.frame(Ask.BRAKE, chance.choice([0, 0, 1, 2]))
    elif kind < 0.84:
        data = pair.frame(Ask.DRIVE, 5, 10, skip=chance.choice([0, -1, -40, 100, 127, 128]))
    elif kind < 0.88:
        data = pair.frame(Ask.DRIVE, chance.randint(-128, 127), chance.choice([101, -101, 127, -128]))
    elif kind < 0.92:
        whole = bytearray(pair.frame(Ask.DRIVE, 50, 50))
        whole[chance.randrange(len(whole) - 1)] ^= 1 << chance.randrange(8)
        data = bytes(byte for byte in whole[:-1] if byte) + b"\0"
    elif kind < 0.95:
        data = bytes(chance.randint(1, 255) for _ in range(chance.randint(1, 20))) + b"\0"
    elif kind < 0.97:
        data = wire.encode(bytes([chance.randint(6, 255), chance.randint(0, 255), *range(chance.randint(0, 9))]))
    else:
        return Step(
            stop=chance.choice([None, True, False, False]),
            charger=chance.choice([None, True, False, False]),
            battery=chance.randint(0, 255),
            ticks=ticks,
        )
    return Step(data, stop=False if chance.random() < 0.5 else None, ticks=ticks)


def disagreement(pair: Pair, seed: int, steps: int = 10) -> str:
    """Run one random sequence; "" when both agree after every step, else what differs."""
    chance = random.Random(seed)
    for number in range(steps):
        step = random_step(pair, chance)
        model, gpsim = pair.step(step)
        if model != gpsim:
            return f"sequence {seed} step {number}: {step}\n model {model}\n gpsim {gpsim}"
    return ""

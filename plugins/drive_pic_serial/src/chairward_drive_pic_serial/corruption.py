"""Damages frames as a bad line does and counts what the firmware makes of them; for tests and benchmarks."""

from __future__ import annotations

import random
from dataclasses import asdict, dataclass

from chairward_drive_pic_serial import wire
from chairward_drive_pic_serial.engine import Engine
from chairward_drive_pic_serial.wire import Ask, Nak, Status

HELD = (10, 20)
"""What the good frames ask for, steer and drive; no damaged one asks for that."""


@dataclass(slots=True)
class Tally:
    """accepted: damaged frames that were obeyed. good_lost: good frames just after one that were not."""

    frames: int = 0
    naks: int = 0
    accepted: int = 0
    good_lost: int = 0

    def __add__(self, other: Tally) -> Tally:
        """Both together."""
        mine, theirs = self.told(), other.told()
        return Tally(**{name: mine[name] + theirs[name] for name in mine})

    def told(self) -> dict[str, int]:
        """By name."""
        return asdict(self)


def damage(frame: bytes, other: bytes, chance: random.Random) -> bytes:
    """One damaged copy: bits flipped, bytes lost, added or exchanged, cut off, spliced with another, or noise."""
    data = bytearray(frame)
    kind = chance.randrange(7)
    if kind == 0:
        for bit in chance.sample(range(8 * len(data)), chance.randint(1, 6)):
            data[bit // 8] ^= 1 << bit % 8
    elif kind == 1:
        for _ in range(chance.randint(1, 2)):
            del data[chance.randrange(len(data))]
    elif kind == 2:
        for _ in range(chance.randint(1, 2)):
            data.insert(chance.randrange(len(data)), chance.randrange(256))
    elif kind == 3:
        del data[chance.randrange(1, len(data)) :]
    elif kind == 4:
        data = bytearray(frame[: chance.randrange(1, len(frame))] + other[chance.randrange(1, len(other)) :])
    elif kind == 5:
        data[chance.randrange(len(data))] = chance.randrange(256)
        data[chance.randrange(len(data))] = chance.randrange(256)
    else:
        data = bytearray(chance.randrange(256) for _ in range(chance.randint(1, 20)))
    return bytes(data)


def corrupt(engine: Engine, frames: int, seed: int) -> Tally:
    """Send damaged frames, each followed by a good one, to an engine that is driving."""
    chance, splitter, tally, seq = random.Random(seed), wire.Splitter(), Tally(), 0

    def answers(data: bytes, ms: int) -> list[wire.Answer]:
        engine.feed(data)
        engine.advance(ms * 1000)
        return [a for a in map(wire.answer, splitter.feed(engine.take())) if a is not None]

    def next_seq() -> int:
        nonlocal seq
        seq = seq % 255 + 1
        return seq

    answers(b"", 30)
    answers(b"\0" + wire.ask(Ask.HELLO, next_seq(), 8, 5), 10)
    answers(b"\0" + wire.ask(Ask.DRIVE, next_seq(), 0, 0), 10)
    while tally.frames < frames:
        bad_seq, good_seq = next_seq(), next_seq()
        sound = [
            wire.ask(Ask.DRIVE, bad_seq, chance.randint(-100, -1), chance.randint(-100, 100)),
            wire.ask(Ask.DRIVE, bad_seq, chance.randint(-100, -1), 0),
            wire.ask(Ask.BRAKE, bad_seq, 0),
            wire.ask(Ask.ESTOP, bad_seq),
            wire.ask(Ask.HELLO, bad_seq, 8, 5),
        ]
        first, second = chance.sample(sound, 2)
        bad = damage(first, second, chance)
        if any(piece + b"\0" in sound for piece in (bad + b"\0").split(b"\0")):
            continue  # the damage left a whole frame: that one may be obeyed
        tally.frames += 1
        heard = answers(bad + b"\0" + wire.ask(Ask.DRIVE, good_seq, *HELD), 16)
        good = [a for a in heard if isinstance(a, Status) and a.seq == good_seq]
        others = [a for a in heard if a not in good]
        tally.naks += sum(isinstance(a, Nak) for a in others)
        tally.accepted += sum(not isinstance(a, Nak) for a in others)
        tally.good_lost += len(good) != 1
    return tally

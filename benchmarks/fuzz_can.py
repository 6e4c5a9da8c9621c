"""Coverage-guided fuzzing of everything that reads a CAN bus: the slcan line, the decoders, the three dialects.

    pip install atheris; python benchmarks/fuzz_can.py [seconds]     writes benchmarks/results/fuzz_can.json

No input may raise, and unarmed no input may bring about a frame that moves. Ends with an error at the first that does.
"""

from __future__ import annotations

import inspect
import sys
from typing import Any

from fuzzing import fuzz

from chairward.components import Motion
from chairward_drive_can import canopen_frames, describe, rnet, slcan
from chairward_drive_can.cia402 import Cia402Dialect
from chairward_drive_can.dbc import DbcDialect, read
from chairward_drive_can.dialect import Dialect
from chairward_drive_can.example import EXAMPLE_DBC, EXAMPLE_TABLE
from chairward_drive_can.frames import Frame
from chairward_drive_can.rnet_dialect import RnetDialect
from chairward_drive_can.settings import CanSettings

GO = Motion(100.0, 5.0)
DATABASE = read(EXAMPLE_DBC)
RNET = CanSettings.model_validate({"dialect": "rnet", "rnet": {"takeover": "follow"}})
DBC = CanSettings.model_validate({"dialect": "dbc", "dbc": EXAMPLE_TABLE})
CIA402 = CanSettings.model_validate({"dialect": "cia402"})
HEARTBEAT = 0x77F


def moves(frame: Frame) -> bool:
    """Whether a command frame of one of the dialects asks for motion."""
    if frame.id == 512:
        return frame.data[:4] != bytes(4) or frame.data[4] & 0xF == 1
    return any(frame.data[2:]) if len(frame.data) == 6 else frame.data != b"\0\0"


def one(data: bytes, _provider: Any) -> None:
    """Read `data` as a serial line; hand every frame in it to everything that reads frames."""
    frames = [frame for line in slcan.LineSplitter().feed(data) if (frame := slcan.decode(line))]
    if len(data) >= 5:  # and as one raw frame, so that the fuzzer need not learn hexadecimal first
        extended = bool(data[0] & 1)
        identity = int.from_bytes(data[1:5], "big") % (1 << (29 if extended else 11))
        frames.append(Frame(identity, data[5:13], extended))
    dialects: list[Dialect] = [RnetDialect(RNET), DbcDialect(DBC, DATABASE), Cia402Dialect(CIA402)]
    for number, frame in enumerate(frames):
        describe.describe_rnet(frame)
        describe.describe_canopen(frame)
        describe_dbc(frame)
        now_ns = 1_000_000_000 + number * 10_000_000
        for dialect in dialects:
            replies = [*dialect.hear(frame, now_ns, GO), *dialect.setup(now_ns), *dialect.command(now_ns, GO, False)]
            for reply in replies:
                if dialect.is_command(reply) and reply.id != HEARTBEAT and moves(reply):
                    raise AssertionError(f"{frame} brought about {reply} unarmed")
            dialect.report(now_ns)


describe_dbc = describe.describe_dbc(DATABASE)


FUNCTIONS = (
    slcan.decode,
    rnet.decode,
    rnet._decode_extended,
    rnet._decode_standard,
    canopen_frames.sdo_answer,
    *(f for kind in (RnetDialect, DbcDialect, Cia402Dialect) for f in vars(kind).values() if inspect.isfunction(f)),
)


if __name__ == "__main__":
    sys.exit(fuzz("fuzz_can", FUNCTIONS, one, max_len=200))

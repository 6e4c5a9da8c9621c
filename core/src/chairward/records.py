"""One record a decision: everything that went in and came out, so that replay needs nothing else."""

from __future__ import annotations

import msgspec

from chairward.components import Motion
from chairward.facts import Decision, Facts, State


class Record(msgspec.Struct, frozen=True, kw_only=True):
    """A decision with its whole cause.

    tick: the guard's count of decisions. due_ns, woke_ns: when the tick was due and when the guard was awake
    (equal for a decision that a message brought about). wrote_ns: when the drive had been told: by the reflex,
    unless the decision had more to say (a hard stop).
    before, facts, after, decision: decide(before, facts, limits) == (after, decision).
    told, told_hard: what the drive was last told, after this decision: not the decision's own motion where a rise
    waits for the tick, or where the decision came too late and the guard said STILL (None: recorded before 0.2).
    frame: the bytes that went on the wire for it, if the drive tells. missed: records that this observer did not get
    before this one.
    """

    tick: int
    due_ns: int
    woke_ns: int
    wrote_ns: int
    periodic: bool
    before: State
    facts: Facts
    after: State
    decision: Decision
    newest_sent_ns: int = 0
    missed: int = 0
    told: Motion | None = None
    told_hard: bool = False
    frame: bytes = b""


_encoder = msgspec.msgpack.Encoder()
_decoder = msgspec.msgpack.Decoder(Record)


def encode(record: Record) -> bytes:
    """The record as msgpack."""
    return _encoder.encode(record)


def decode(data: bytes) -> Record:
    """The record back. Raises msgspec.DecodeError."""
    return _decoder.decode(data)

"""What guard and supervisor do again and again leaves nothing behind (benchmarks/memory.py looks on for an hour)."""

from __future__ import annotations

import gc
import sys
from pathlib import Path

from rig import load

from chairward import records, wire
from chairward.border import Border
from chairward.facts import MS, State
from chairward.messages import Alive, Command, DriveStatus, Intent, Message, Parcel, RangeReading
from chairward.plan import LanePlan, Part
from chairward.supervisor import Supervisor
from chairward.testing.ride import START_NS, chair_limits, recorded
from chairward.wire import encode_parcel

LANES = {"front": "range", "voice": "words", "panel": "switch"}
BLOCKS_ALLOWED = 500
"""Of the interpreter's memory: free lists and caches move by some."""


class Chair:
    """Border, decision and record of a chair to which everything happens again and again."""

    def __init__(self) -> None:
        self.limits = chair_limits()
        plans = {lane: LanePlan(name=lane, source=Part(component=stage)) for lane, stage in LANES.items()}
        self.border, self.state, self.nth = Border(plans, self.limits), State(latch="", armed=True), 0

    def send(self, lane: str, message: Message) -> None:
        body = encode_parcel(Parcel(stage=LANES[lane], body=message))
        self.border.take(lane, body, START_NS + self.nth * 20 * MS)

    def tick(self) -> bytes:
        """Readings near and far, words, rubbish, lanes that are lost and come back, a controller that disarms.

        Returns the record of the decision.
        """
        self.nth += 1
        nth, now = self.nth, START_NS + self.nth * 20 * MS
        self.send("front", RangeReading(seq=nth, captured_ns=now, can_see=nth % 7 > 0, ahead_mm=400 + nth * 37 % 3_000))
        self.send("voice", Alive(seq=2 * nth, captured_ns=now))
        self.send("panel", Alive(seq=nth, captured_ns=now))
        if nth % 50 == 0:
            self.send("voice", Intent(seq=2 * nth + 1, captured_ns=now, command=Command.FRONT, word=f"word {nth}"))
        if nth % 31 == 0:
            self.border.take("front", b"rubbish %d" % nth, now)
        if nth % 211 == 0:
            self.border.lane_lost("front", f"its process died for the {nth}th time")
        if nth % 211 == 20:
            self.border.lane_attached("front")
        drive = DriveStatus(at_ns=now, linked=True, armed=nth % 400 > 10)
        facts = self.border.facts(now, drive, now, 0)
        record = recorded(nth, self.state, facts, self.limits)
        self.state = State(latch="", armed=True) if record.after.latch else record.after
        return records.encode(record)


def test_thousands_of_decisions_in_all_kinds_of_trouble_leave_nothing_behind() -> None:
    chair = Chair()
    for _ in range(2_000):
        chair.tick()
    gc.collect()
    before = sys.getallocatedblocks()
    for _ in range(6_000):
        chair.tick()
    gc.collect()
    assert sys.getallocatedblocks() - before < BLOCKS_ALLOWED


def test_thousands_of_records_leave_nothing_behind_in_the_supervisor(tmp_path: Path) -> None:
    chair, supervisor = Chair(), Supervisor(load(tmp_path), tmp_path, lambda record: None)
    guard_end, supervisor._records = wire.pair()

    def look_on(times: int) -> int:
        for _ in range(times):
            guard_end.send(chair.tick())
            supervisor._read_records()
        gc.collect()
        return sys.getallocatedblocks()

    before = look_on(500)
    assert look_on(1_500) - before < BLOCKS_ALLOWED
    guard_end.close()
    supervisor._records.close()

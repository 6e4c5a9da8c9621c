"""What comes over the guard's lines: lanes that say too much or leave, a supervisor that is gone, slow observers."""

from __future__ import annotations

import itertools
import socket
import time
from contextlib import suppress

from guard_rig import SELDOM_NS, rig, wait_for

from chairward import records, wire
from chairward.components import STILL
from chairward.guard import MESSAGES_A_TICK
from chairward.messages import Alive, RangeReading


def test_a_heartbeat_waits_for_the_tick_and_a_reading_does_not() -> None:
    with rig(SELDOM_NS) as it:
        for _ in range(3):
            it.say("panel", Alive)
        it.say("eyes", RangeReading, can_see=True, ahead_mm=4000)
        assert wait_for(it, 1).facts.alive["front/panel"].seq == 3
        it.say("panel", Alive, well=False, reason="pulled out")
        assert not wait_for(it, 2).facts.alive["front/panel"].well


def test_control_messages_that_make_no_sense_are_survived() -> None:
    with rig() as r:
        r.drive_off()
        for message in (wire.Attach("front"), wire.Attach("nobody"), wire.Observe(), wire.Note("hello")):
            wire.send_control(r.control, message)
        r.control.send(b"\xff not a message")
        extra, other = socket.socketpair()
        wire.send_control(r.control, wire.Attach("nobody"), [extra.fileno()])
        wire.send_control(r.control, wire.Heartbeat(), [extra.fileno()])
        extra.close()
        r.live(lambda: len(r.records) > 60, "the guard to go on")
        other.settimeout(2.0)
        assert other.recv(1) == b"", "descriptors that nobody asked for are closed"
        other.close()
    assert r.code == [0]


def test_a_lane_that_is_attached_twice_is_heard_on_its_newest_line_only() -> None:
    with rig() as r:
        r.drive_off()
        old, (first, first_lane), (second, second_lane) = r.lane, wire.pair(), wire.pair()
        r.seq = 1_000_000
        for _ in range(20):  # more than its budget: it may be muted just now
            r.say("panel", Alive)
        for end in (first, second):
            wire.send_control(r.control, wire.Attach("front"), [end.fileno()])
            end.close()
        r.lane, r.seq = second_lane, 0
        count = len(r.records)
        r.live(
            lambda: (
                r.last.facts.alive["front/panel"].seq < 1_000_000
                and len(r.records) > count + 20
                and not r.last.facts.lost
            ),
            "the new line",
        )
        for closed in (old, first_lane):
            with suppress(ConnectionResetError):  # what it had said and nobody read
                assert closed.recv(1) == b""
            closed.close()
        r.drive_off()
    assert r.code == [0]


def test_a_lane_that_closes_its_line_is_named_and_stops_the_chair() -> None:
    with rig() as r:
        r.drive_off()
        r.lane.shutdown(socket.SHUT_RDWR)
        end = time.monotonic() + 20.0
        while r.moving() and time.monotonic() < end:
            wire.send_control(r.control, wire.Heartbeat())
            r.read()
            time.sleep(0.01)
        assert not r.moving()
        assert "front" in r.last.facts.lost


def test_of_a_lane_that_says_too_much_only_so_much_is_heard_before_the_next_tick() -> None:
    with rig(SELDOM_NS) as it:
        for _ in range(MESSAGES_A_TICK + 4):
            it.say("eyes", RangeReading, can_see=False)
        end = time.monotonic() + 20.0
        while "front" not in it.guard.muted:
            assert time.monotonic() < end, "waited for the lane to be muted"
            time.sleep(0.005)
        it.read()
        assert it.last.facts.ranges["front/eyes"][-1].seq == MESSAGES_A_TICK
        assert it.code == [], "and it goes on"


def test_a_supervisor_that_is_gone_stops_the_chair_and_ends_the_guard() -> None:
    with rig() as r:
        r.drive_off()
        r.drive.told.clear()
        r.control.shutdown(socket.SHUT_RDWR)
        r.thread.join(30.0)
        assert r.code == [0]
        assert ("command", STILL, True) in r.drive.told
        assert r.drive.told[-1][0] == "close"


def test_an_observer_that_does_not_read_misses_records_and_is_told_how_many() -> None:
    with rig() as r:
        r.drive_off()
        small, mine = wire.pair(16_384)
        wire.send_control(r.control, wire.Observe(), [small.fileno()])
        small.close()
        count = len(r.records)
        r.live(lambda: len(r.records) > count + 60, "more records than it has room for")
        got = []
        while (data := wire.receive(mine, wire.RECORD_BYTES)) is not None:
            got.append(records.decode(data))
        r.live(lambda: True, "")
        count = len(r.records)
        r.live(lambda: len(r.records) > count + 3, "more records")
        while (data := wire.receive(mine, wire.RECORD_BYTES)) is not None:
            got.append(records.decode(data))
        mine.close()
        assert max(record.missed for record in got) > 0
        ticks = [record.tick for record in got]
        missing = sum(b - a - 1 for a, b in itertools.pairwise(ticks))
        assert sum(record.missed for record in got) == missing
    assert r.code == [0]

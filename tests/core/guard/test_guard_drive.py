"""The guard with a drive that is scripted to fail: it stops, latches, tells, and goes on; it never dies of a drive."""

from __future__ import annotations

import os
import time

import pytest
from guard_rig import SELDOM_NS, rig, wait_for

from chairward import arbiter, guard, wire
from chairward.components import STILL, DriveError, Motion
from chairward.facts import MS, Decision, Facts, Limits, State
from chairward.messages import Button, Press, RangeReading


def test_a_speed_waits_for_the_tick_and_a_charger_that_is_plugged_in_does_not() -> None:
    with rig(SELDOM_NS) as it:
        it.say("eyes", RangeReading, can_see=True, ahead_mm=4000)
        assert wait_for(it, 1).facts.drive.linked
        it.drive.status = {"speed_mm_s": 90.0}
        os.write(it.drive.write_end, b"speed")
        end = time.monotonic() + 20.0
        while not it.guard.drive.wakes:
            assert time.monotonic() < end, "waited for the guard to read what the drive says"
            time.sleep(0.005)
        it.drive.status = {"charging": True}
        os.write(it.drive.write_end, b"charger")
        told = wait_for(it, 2).decision.reasons
        assert any(why.detail == "a charger is connected" for why in told)


@pytest.mark.parametrize("call", ["poll", "command", "connect"])
@pytest.mark.parametrize(
    "error", [DriveError("/dev/x was unplugged: plug it in"), OSError(5, "I/O error"), ValueError("?")]
)
def test_a_drive_that_fails_in_any_call_stops_and_latches_and_the_guard_lives(call: str, error: Exception) -> None:
    with rig() as r:
        r.drive_off()
        r.drive.fail[call] = error
        r.drive.status = {"linked": False} if call == "connect" else {}
        r.live(lambda: bool(r.last.decision.latch), "a latch")
        assert r.last.decision.motion == STILL
        assert r.last.decision.hard_stop
        r.drive.fail.clear()
        r.drive.status = {}
        r.drive_off()
    assert r.code == [0]


def test_a_disarm_that_fails_does_not_keep_the_stop_from_being_sent() -> None:
    with rig() as r:
        r.drive_off()
        r.drive.fail["disarm"] = DriveError("no answer")
        r.drive.told.clear()
        r.say("panel", Press, button=Button.STOP)
        r.live(lambda: ("command", STILL, True) in r.drive.told, "the hard stop")


def test_a_status_that_cannot_be_is_a_fault_not_the_end() -> None:
    with rig() as r:
        r.drive_off()
        r.drive.status = {"battery": 2.55}
        r.live(lambda: bool(r.last.decision.latch), "a latch")
        assert "battery" in r.last.facts.drive.fault or "<= 1.0" in r.last.facts.drive.fault
        r.drive.status = {}
    assert r.code == [0]


def test_a_command_that_was_decided_too_long_ago_goes_out_as_a_stop() -> None:
    with rig() as r:
        r.drive_off()
        r.drive.told.clear()
        before = len(r.records)
        r.drive.stall_s = 0.3
        r.live(lambda: r.drive.stall_s == 0.0 and bool(r.drive.told), "a command after the stall")
        assert r.drive.told[0] == ("command", STILL, True)
        r.live(lambda: any(one.told_hard for one in r.records[before:]), "the record of that command")
        late = next(one for one in r.records[before:] if one.told_hard)
        assert late.decision.motion != STILL, "the record tells the decision as it was made"
        assert late.told == STILL, "and what the drive was told instead"
        r.live(lambda: "clock" in r.last.decision.latch, "the gap to latch")


def test_a_reading_at_the_stop_distance_stops_the_drive_before_its_reasons_are_worked_out(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    worked_out: dict[int, tuple[tuple[str, Motion, bool], int]] = {}

    def leaves_one_answer(state: State, facts: Facts) -> bool:
        near = any(reading.ahead_mm == 100 for reading in facts.ranges.get("front/eyes", ()))
        return near and state.output.drive_mm_s > 0.0 and not facts.heard and not facts.gap_ns

    def decide(state: State, facts: Facts, limits: Limits) -> tuple[State, Decision]:
        if leaves_one_answer(state, facts):
            worked_out[facts.now_ns] = (r.drive.told[-1], time.monotonic_ns())
        return decides(state, facts, limits)

    decides = arbiter.decide
    monkeypatch.setattr(arbiter, "decide", decide)
    with rig() as r:
        while not worked_out:  # a word may have come with it, or the machine have been away: then once more
            r.drive_off()
            r.say("eyes", RangeReading, can_see=True, ahead_mm=100)
            r.live(lambda: r.last.decision.motion == STILL, "the stop")
        r.live(lambda: r.last.facts.now_ns > next(iter(worked_out)), "its record")
        stop = next(one for one in r.records if one.facts.now_ns in worked_out)
    told, asked_ns = worked_out[stop.facts.now_ns]
    assert told == ("command", STILL, False)
    assert stop.decision.motion == stop.told == STILL
    assert stop.told_hard or stop.wrote_ns <= asked_ns


def test_a_machine_that_was_suspended_latches_though_its_own_clock_stood_still(monkeypatch: pytest.MonkeyPatch) -> None:
    slept_ns = [0]
    monkeypatch.setattr(guard, "suspended_ns", lambda: slept_ns[0])
    with rig() as r:
        r.drive_off()
        slept_ns[0] = 3_600_000 * MS
        woke = "its clock jumped by 3600000 ms"
        r.live(lambda: any(why.detail == woke for one in r.records for why in one.decision.reasons), "the sleep told")
        first = next(one for one in r.records if one.facts.gap_ns >= slept_ns[0])
        assert first.decision.motion == STILL
        assert first.after.needs_reset


def test_a_guard_that_is_told_to_leave_stays_until_the_controller_says_that_it_stands(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(guard, "LEAVE_WITHIN_NS", 60_000 * MS)
    with rig() as r:
        r.drive_off()
        r.drive.status = {"speed_mm_s": 300.0}
        count = len(r.records)
        wire.send_control(r.control, wire.Quit())
        r.live(lambda: len(r.records) > count + 20, "the guard to stay")
        assert r.last.decision.motion == STILL
        assert "supervisor" in r.last.facts.lost
        r.drive.status = {}
        r.thread.join(20.0)
        assert r.code == [0]


def test_a_controller_that_never_stands_does_not_keep_the_guard_for_ever(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(guard, "LEAVE_WITHIN_NS", 300 * MS)
    with rig() as r:
        r.drive_off()
        r.drive.status = {"speed_mm_s": 300.0}
        wire.send_control(r.control, wire.Quit())
        r.thread.join(20.0)
        assert r.code == [0]

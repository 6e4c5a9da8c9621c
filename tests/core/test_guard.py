"""The guard with a drive that is scripted to fail: it stops, latches, tells, and goes on; it never dies of a drive."""

from __future__ import annotations

import itertools
import os
import socket
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from typing import Any

import pytest

from chairward import guard, records, wire
from chairward.components import STILL, DriveError, Footprint, Motion
from chairward.facts import MS, Limits, SourceLimits
from chairward.guard import MESSAGES_A_TICK, Guard
from chairward.messages import Alive, Button, Command, DriveStatus, Intent, Message, Parcel, Press, RangeReading, Way
from chairward.plan import ChairKind, LanePlan, Part, Plan
from chairward.records import Record

LIMITS = Limits(
    sensors={"front/eyes": SourceLimits(freshness_ns=300 * MS, covers=frozenset({Way.AHEAD}))},
    recognizers={"front/ears": SourceLimits(freshness_ns=300 * MS)},
    stop_devices={"front/panel": SourceLimits(freshness_ns=300 * MS)},
)
STAGES = tuple(Part(component=name) for name in ("ears", "panel"))


class ScriptedDrive:
    """A drive that does all it is asked, until `fail` says in which call it raises what."""

    period_ns = 20 * MS

    def __init__(self) -> None:
        self.fail: dict[str, Exception] = {}
        self.status: dict[str, Any] = {}
        self.armed = False
        self.told: list[tuple[str, Motion, bool]] = []
        self.read_end, self.write_end = os.pipe()
        os.set_blocking(self.read_end, False)
        self.open = True
        self.stall_s = 0.0

    def fileno(self) -> int:
        return self.read_end if self.open else -1

    def _do(self, name: str) -> None:
        if name in self.fail:
            if self.open:  # as a serial drive does: the port is closed in the very call that fails
                os.close(self.read_end)
                self.open = False
            raise self.fail[name]

    def connect(self, now_ns: int) -> None:
        self._do("connect")

    def arm(self, now_ns: int) -> None:
        self._do("arm")
        self.armed = True

    def disarm(self, now_ns: int) -> None:
        self._do("disarm")
        self.armed = False

    def command(self, now_ns: int, motion: Motion, *, hard_stop: bool = False) -> None:
        self.told.append(("command", motion, hard_stop))
        self._do("command")

    def poll(self, now_ns: int) -> DriveStatus:
        if self.stall_s:
            stall, self.stall_s = self.stall_s, 0.0
            self.told.clear()
            end = time.monotonic() + stall
            while time.monotonic() < end:
                pass  # as SIGSTOP between waking and writing would do
        self._do("poll")
        if self.open:
            with suppress(BlockingIOError):
                os.read(self.read_end, 4096)
        fields: dict[str, Any] = {
            "at_ns": now_ns,
            "linked": True,
            "armed": self.armed,
            "speed_mm_s": 0.0,
            **self.status,
        }
        return DriveStatus(**fields)

    def close(self) -> None:
        self.told.append(("close", STILL, True))


class Rig:
    """A guard in a thread, one lane that says what is needed, and the records it publishes."""

    def __init__(self, period_ns: int = ScriptedDrive.period_ns) -> None:
        self.drive = ScriptedDrive()
        self.drive.period_ns = period_ns
        plan = Plan(
            chair="t",
            chair_file="/t.toml",
            kind=ChairKind.SIMULATOR,
            person="p",
            person_file="/p.toml",
            person_dir="/p",
            language="en",
            words={},
            footprint=Footprint(front_mm=1, rear_mm=1, half_width_mm=1),
            limits=LIMITS,
            drive=Part(component="scripted"),
            lanes=(
                LanePlan(
                    name="front",
                    source=Part(component="eyes"),
                    stages=STAGES,
                    may=frozenset({Button.ARM, Button.RESET, Button.STOP}),
                ),
            ),
        )
        theirs, self.lane = wire.pair()
        control, self.control = wire.pair()
        out, self.out = wire.pair(1 << 20)
        self.guard = Guard(plan, self.drive, {"front": theirs}, control, [out])
        self.records: list[Record] = []
        self.seq = 0
        self.code: list[int | BaseException] = []
        self.thread = threading.Thread(target=self._run)

    def _run(self) -> None:
        try:
            self.code.append(self.guard.run())
        except BaseException as error:  # noqa: BLE001 - the test asserts on whatever ends the guard
            self.code.append(error)

    def say(self, stage: str, message: Callable[..., Message], **fields: Any) -> None:
        self.seq += 1
        body = message(seq=self.seq, captured_ns=time.monotonic_ns(), **fields)
        wire.send(self.lane, wire.encode_parcel(Parcel(stage=stage, body=body)))

    def live(self, until: Callable[[], bool], what: str, seconds: float = 20.0, word: Command | None = None) -> None:
        """Keep every vote fresh until something is true."""
        end = time.monotonic() + seconds
        while not until():
            assert time.monotonic() < end, f"waited for {what}: {self.records[-1].decision if self.records else None}"
            assert not self.code, f"the guard ended: {self.code}"
            wire.send_control(self.control, wire.Heartbeat())
            self.say("eyes", RangeReading, can_see=True, ahead_mm=4000)
            self.say("ears", Alive)
            self.say("panel", Alive)
            if word is not None:
                self.say("ears", Intent, command=word)
            self.read()
            time.sleep(0.015)

    def read(self) -> None:
        while (data := wire.receive(self.out, wire.RECORD_BYTES)) is not None and data:
            self.records.append(records.decode(data))

    @property
    def last(self) -> Record:
        return self.records[-1]

    def moving(self) -> bool:
        return bool(self.records) and self.last.decision.motion.drive_mm_s > 20.0

    def drive_off(self) -> None:
        self.live(lambda: len(self.records) > 20, "the guard to run")
        self.say("panel", Press, button=Button.RESET)
        self.live(lambda: bool(self.records) and not self.last.after.needs_reset, "RESET")
        self.say("panel", Press, button=Button.ARM)
        self.live(lambda: self.last.after.latch == "" and self.last.after.armed, "ARM")
        self.live(self.moving, "the chair to move", word=Command.FRONT)


@contextmanager
def rig(period_ns: int = ScriptedDrive.period_ns) -> Iterator[Rig]:
    it = Rig(period_ns)
    it.thread.start()
    try:
        yield it
    finally:
        end = time.monotonic() + 20.0
        while it.thread.is_alive() and time.monotonic() < end:
            with suppress(OSError):  # it has just left
                wire.send_control(it.control, wire.Quit())  # wakes it too, where no tick does
            it.thread.join(0.05)
        for end in (it.lane, it.control, it.out):
            end.close()
    assert not it.thread.is_alive()


SELDOM_NS = 60_000 * MS
"""A tick that does not come while a test lasts: all that is decided, a message has brought about."""


def wait_for(it: Rig, count: int) -> Record:
    """That many decisions; the last of them."""
    end = time.monotonic() + 20.0
    while len(it.records) < count:
        assert time.monotonic() < end, f"waited for {count} decisions, {len(it.records)} came"
        it.read()
        time.sleep(0.005)
    assert len(it.records) == count
    assert not any(record.periodic for record in it.records)
    return it.last


def test_a_heartbeat_waits_for_the_tick_and_a_reading_does_not() -> None:
    with rig(SELDOM_NS) as it:
        for _ in range(3):
            it.say("panel", Alive)
        it.say("eyes", RangeReading, can_see=True, ahead_mm=4000)
        assert wait_for(it, 1).facts.alive["front/panel"].seq == 3
        it.say("panel", Alive, well=False, reason="pulled out")
        assert not wait_for(it, 2).facts.alive["front/panel"].well


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
        small, mine = wire.pair()
        wire.send_control(r.control, wire.Observe(), [small.fileno()])
        small.close()
        count = len(r.records)
        r.live(lambda: len(r.records) > count + 400, "many records", 20.0)
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

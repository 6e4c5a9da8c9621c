"""A guard in a thread, with a drive that is scripted to fail and one lane that says what a test tells it."""

from __future__ import annotations

import os
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from typing import Any

from chairward import records, wire
from chairward.components import STILL, Motion
from chairward.facts import MS, Limits, SourceLimits
from chairward.guard import Guard
from chairward.messages import Alive, Button, Command, DriveStatus, Intent, Message, Parcel, Press, RangeReading, Way
from chairward.plan import LanePlan, Part
from chairward.records import Record
from chairward.testing.ride import chair_plan

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

    def forget(self) -> None:
        """Give its descriptors back."""
        for fd in (self.write_end, self.read_end) if self.open else (self.write_end,):
            os.close(fd)


class Rig:
    """A guard in a thread, one lane that says what is needed, and the records it publishes."""

    def __init__(self, period_ns: int = ScriptedDrive.period_ns) -> None:
        self.drive = ScriptedDrive()
        self.drive.period_ns = period_ns
        may = frozenset({Button.ARM, Button.RESET, Button.STOP})
        lane = LanePlan(name="front", source=Part(component="eyes"), stages=STAGES, may=may)
        plan = chair_plan(limits=LIMITS, lanes=(lane,))
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
        for line in (it.lane, it.control, it.out):
            line.close()
        it.drive.forget()
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

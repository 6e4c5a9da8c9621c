"""A controller that a test can make wrong in one way, and time that jumps."""

from __future__ import annotations

from contextlib import closing
from dataclasses import dataclass, field
from typing import Any

import pytest

from chairward.check.drive import DriveCheck, Finding
from chairward.check.drive_bench import DriveBench
from chairward.check.drive_eyes import Eyes, Instruments
from chairward.components import STILL, DriveError, Motion
from chairward.messages import DriveStatus

MS = 1_000_000
FULL = Motion(500.0, 45.0)


@dataclass
class Puppet:
    """A drive and its wheels. true_full: what full deflection really is, in the wheels' own signs.

    silence_ms None: it never stops by itself. All times are of the puppet's own clock, which `wait` moves.
    """

    true_full: Motion = FULL
    drive_sign: int = 1
    turn_sign: int = 1
    crossed: bool = False
    silence_ms: float | None = 150.0
    decel_mm_s2: float = 2000.0
    arms_itself: bool = False
    rearms_itself: bool = False
    ignores_stop: bool = False
    answers: bool = True
    period_ns: int = 20 * MS
    now: int = 1_000 * MS
    linked: bool = False
    armed: bool = False
    closed: bool = False
    last_hard: bool = False
    wanted: Motion = STILL
    wheels: Motion = STILL
    commanded_ns: int = 0
    said: list[str] = field(default_factory=list)

    # the clock

    def now_ns(self) -> int:
        return self.now

    def wait(self, seconds: float, _fd: int) -> None:
        for _ in range(max(1, round(seconds * 1000))):
            self.now += MS
            self._turn()  # a millisecond

    def _turn(self) -> None:
        if self.silence_ms is not None and self.now - self.commanded_ns > self.silence_ms * MS:
            self.wanted, self.wheels = STILL, STILL
            self.armed = self.armed and self.rearms_itself
        goal = self.wanted if self.armed or self.wanted == STILL else STILL
        step = self.decel_mm_s2 / 1000.0
        parts = []
        for value, wanted, unit in zip(self.wheels, goal, (1.0, 0.1), strict=True):
            by = step * unit
            parts.append(wanted if abs(wanted - value) <= by else value + by * (1 if wanted > value else -1))
        self.wheels = Motion(*parts)

    # the drive

    def fileno(self) -> int:
        return -1

    def connect(self, now_ns: int) -> None:
        if not self.answers:
            raise DriveError("puppet: nobody answers: pull its strings")
        self.linked, self.armed = True, self.arms_itself

    def arm(self, now_ns: int) -> None:
        self.armed = self.linked

    def disarm(self, now_ns: int) -> None:
        self.armed = False

    def command(self, now_ns: int, motion: Motion, *, hard_stop: bool = False) -> None:
        self.commanded_ns, self.last_hard = self.now, hard_stop
        if self.ignores_stop and motion == STILL:
            return
        drive = motion.drive_mm_s / FULL.drive_mm_s * self.true_full.drive_mm_s * self.drive_sign
        turn = motion.turn_deg_s / FULL.turn_deg_s * self.true_full.turn_deg_s * self.turn_sign
        self.wanted = Motion(turn * 10.0, drive / 10.0) if self.crossed else Motion(drive, turn)
        if hard_stop:
            self.wheels = STILL

    def poll(self, now_ns: int) -> DriveStatus:
        return DriveStatus(
            at_ns=self.now,
            linked=self.linked,
            armed=self.armed,
            speed_mm_s=self.wheels.drive_mm_s,
            turn_deg_s=self.wheels.turn_deg_s,
        )

    def close(self) -> None:
        self.closed = True

    # what a test asks

    def bench(self) -> DriveBench:
        return DriveBench(self, self)

    def eyes(self) -> Eyes:
        return Instruments("the puppet's wheels", FULL, lambda: self.wheels, lambda: self.wheels)

    def check(self, until: str = "", **settings: Any) -> list[Finding]:
        """All findings, or those up to a step."""
        given = {"full_speed_mm_s": 500.0, "full_turn_deg_s": 45.0, "drive_sign": 1, "turn_sign": 1, **settings}
        findings = []
        with closing(DriveCheck(self.bench(), self.eyes(), given, 600.0).run()) as steps:
            for finding in steps:
                findings.append(finding)
                if finding.step == until:
                    break
        return findings


@pytest.fixture
def puppet() -> Puppet:
    return Puppet()


@pytest.fixture(scope="session")
def puppet_type() -> type[Puppet]:
    return Puppet

"""A drive on the bench, wheels off the ground: commanded tick by tick as the guard does, by nobody else meanwhile."""

from __future__ import annotations

import select
import time
from collections.abc import Callable
from typing import Protocol

from chairward.components import STILL, Drive, DriveError, Motion
from chairward.messages import DriveStatus

S = 1_000_000_000
LOOK_S = 0.002
"""How often motion is looked at: what is timed is late by at most this."""
CONNECT_S, ARM_S = 15.0, 6.0
ASK_AGAIN_S = 0.2


class BenchError(Exception):
    """The drive does not do what a measurement needs: one sentence."""


class Clock(Protocol):
    """Time, and letting it pass. Tests give one that jumps."""

    def now_ns(self) -> int:
        """CLOCK_MONOTONIC, or a stand-in."""

    def wait(self, seconds: float, fd: int) -> None:
        """Until then, or until the descriptor is readable (-1: none)."""


class RealClock:
    """The machine's."""

    def now_ns(self) -> int:
        """CLOCK_MONOTONIC."""
        return time.monotonic_ns()

    def wait(self, seconds: float, fd: int) -> None:
        """Sleep, or wake on the controller's answer."""
        select.select([fd] if fd >= 0 else [], [], [], max(0.0, seconds))


class DriveBench:
    """Holds a motion or holds its tongue; `look` is called every 2 ms meanwhile and ends it by returning True."""

    def __init__(self, drive: Drive, clock: Clock) -> None:
        self.drive, self.clock = drive, clock
        self.status = DriveStatus(at_ns=0, linked=False, armed=False)
        self.commanded_ns = 0
        self.trouble = ""

    def connect(self) -> None:
        """Until linked. Raises BenchError with the drive's own reason."""
        end = self.clock.now_ns() + int(CONNECT_S * S)
        while not self.status.linked:
            if self.clock.now_ns() > end:
                raise BenchError(self.trouble or self.status.fault or "the controller does not answer: is it on?")
            self._try(lambda: self.drive.connect(self.clock.now_ns()))
            self.hold(STILL, ASK_AGAIN_S, lambda: self.status.linked)

    def arm(self) -> None:
        """Until armed, standing. Raises BenchError with the drive's own reason."""
        end = self.clock.now_ns() + int(ARM_S * S)
        while not self.status.armed:
            if self.clock.now_ns() > end:
                raise BenchError(self.trouble or self.status.fault or "the controller does not arm")
            if not self.status.linked:
                self.connect()
            self.trouble = ""
            self._try(lambda: self.drive.arm(self.clock.now_ns()))
            self.hold(STILL, ASK_AGAIN_S, lambda: self.status.armed)

    def hold(
        self, motion: Motion, seconds: float, look: Callable[[], bool] = lambda: False, *, hard_stop: bool = False
    ) -> bool:
        """Command it at every tick, the first at once, for so long; True when `look` ended it."""
        end, due = self.clock.now_ns() + int(seconds * S), 0
        while (now := self.clock.now_ns()) < end:
            if now >= due:
                due = now + self.drive.period_ns
                self.commanded_ns = now
                self._try(lambda: self.drive.command(self.clock.now_ns(), motion, hard_stop=hard_stop))
            self.read()
            if look():
                return True
            self.clock.wait(LOOK_S, self.drive.fileno())
        return False

    def silent(self, seconds: float, look: Callable[[], bool] = lambda: False) -> bool:
        """Call nothing that speaks to the controller for so long; True when `look` ended it."""
        end = self.clock.now_ns() + int(seconds * S)
        while self.clock.now_ns() < end:
            if look():
                return True
            self.clock.wait(LOOK_S, -1)
        return False

    def read(self) -> None:
        """What the controller has said; an error counts as no link."""
        try:
            self.status = self.drive.poll(self.clock.now_ns())
        except DriveError as error:
            self.trouble = str(error)
            self.status = DriveStatus(at_ns=self.status.at_ns, linked=False, armed=False, fault=str(error)[:200])

    def leave(self) -> None:
        """A hard stop, no motion accepted any more, port given back; whatever happened before."""
        self._try(lambda: self.drive.command(self.clock.now_ns(), STILL, hard_stop=True))
        self._try(lambda: self.drive.disarm(self.clock.now_ns()))
        self.drive.close()

    def _try(self, call: Callable[[], None]) -> None:
        try:
            call()
        except DriveError as error:
            self.trouble = str(error)

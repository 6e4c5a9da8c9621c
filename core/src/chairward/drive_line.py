"""The guard's line to the drive: what it last said, what it was last told; nothing that it does can end the guard."""

from __future__ import annotations

import selectors
import time
from collections.abc import Callable

import msgspec

from chairward.components import STILL, Drive, DriveError, Motion
from chairward.facts import Decision
from chairward.messages import DriveStatus

WAKES_A_TICK = 8


class DriveLine:
    """One drive, called by one guard. `key`: under which the drive's own port is registered with the selector.

    status: what the drive last said. motion, hard: what it was last told.
    """

    def __init__(self, drive: Drive, selector: selectors.BaseSelector, key: object) -> None:
        self.status = DriveStatus(at_ns=0, linked=False, armed=False)
        self.motion = STILL
        self.hard = False
        self.wakes = 0
        self._drive = drive
        self._selector = selector
        self._key = key
        self._fd = -1
        self._fault = ""

    @property
    def period_ns(self) -> int:
        """The drive's period, which is the guard's tick."""
        return self._drive.period_ns

    @property
    def last_frame(self) -> bytes:
        """The bytes that went on the wire for the last command, if the drive tells."""
        frame: bytes = getattr(self._drive, "last_frame", b"")
        return frame

    @property
    def must_be_polled(self) -> bool:
        """The drive has failed in a call, or wakes nobody when it says something."""
        return bool(self._fault) or self._fd < 0

    def woke(self, now_ns: int) -> bool:
        """Read what the drive says. How it moves can wait for the tick, that it will not move (or will again) cannot.

        True where it cannot. A drive that never stops talking is not listened to until the tick.
        """
        self.wakes += 1
        if self.wakes > WAKES_A_TICK:
            self._follow()
            return False
        before = _readiness(self.status)
        self.poll(now_ns, connect=False)
        return _readiness(self.status) != before

    def new_tick(self) -> None:
        """Listen again."""
        self.wakes = 0

    def poll(self, now_ns: int, *, connect: bool) -> None:
        """The drive's status; whatever it raises or says that cannot be is a fault, and a fault latches."""
        fault, self._fault = self._fault, ""
        try:
            self.status = msgspec.convert(msgspec.to_builtins(self._drive.poll(now_ns)), DriveStatus)
            if connect and not self.status.linked:
                self._drive.connect(now_ns)
        except Exception as error:  # noqa: BLE001 - the guard outlives any drive: it stops, latches and connects again
            fault = _told(error)
            self.status = msgspec.structs.replace(self.status, linked=False, armed=False)
        if fault:
            self.status = msgspec.structs.replace(self.status, fault=fault[:200])
        self._follow()

    def stop(self, now_ns: int) -> int:
        """No motion, ahead of the decision that will say so.

        Returns when the drive had been told, ns (CLOCK_MONOTONIC); 0 where it already was, or failed.
        """
        if self.motion == STILL:
            return 0
        self._tell(lambda: self._drive.command(now_ns, STILL))
        if self._fault:
            return 0
        told_ns = time.monotonic_ns()
        self.motion, self.hard = STILL, False
        self._follow()
        return told_ns

    def command(self, now_ns: int, motion: Motion, decision: Decision, *, hard: bool, periodic: bool) -> None:
        """Every tick, and at once when the motion falls; a rise waits for the tick."""
        falls = (hard and not self.hard) or _falls(self.motion, motion)
        if periodic or falls or decision.arm or decision.disarm:
            self._tell(lambda: self._drive.command(now_ns, motion, hard_stop=hard))
            if decision.disarm:
                self._tell(lambda: self._drive.disarm(now_ns))
            elif decision.arm:
                self._tell(lambda: self._drive.arm(now_ns))
            self.motion, self.hard = motion, hard
            self._follow()

    def close(self) -> None:
        """Stop, and give the port back."""
        self._drive.close()

    def _tell(self, act: Callable[[], None]) -> None:
        """One call of the drive; that it fails must not keep the next from being made."""
        try:
            act()
        except Exception as error:  # noqa: BLE001 - see poll
            self._fault = self._fault or _told(error)

    def _follow(self) -> None:
        """Listen where the drive listens now: it may have closed or opened its port in any call."""
        fd = self._drive.fileno() if self.wakes <= WAKES_A_TICK else -1
        if fd == self._fd:
            return
        if self._fd >= 0:
            self._selector.unregister(self._fd)
        if fd >= 0:
            self._selector.register(fd, selectors.EVENT_READ, self._key)
        self._fd = fd


def _told(error: Exception) -> str:
    """What a drive raised, as a sentence."""
    return str(error) if isinstance(error, DriveError) else f"the drive failed: {type(error).__name__}: {error}"


def _readiness(status: DriveStatus) -> tuple[bool, bool, str, bool, bool]:
    """All that rule 9 looks at."""
    return status.linked, status.armed, status.fault, status.stopped_by_user, status.charging


def _falls(old: Motion, new: Motion) -> bool:
    return abs(new.drive_mm_s) < abs(old.drive_mm_s) or abs(new.turn_deg_s) < abs(old.turn_deg_s)

"""The drive itself: one interface, one dialect, and the promises that no dialect can break.

No frame that can move the chair leaves later than `stale_ms` after the guard's clock said so; nothing is ever sent
because time has passed, only because the guard called; after arming, motion waits for a neutral command.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from typing import NoReturn

from chairward.components import SILENCE_LIMIT_MS, STILL, DriveError, Motion
from chairward.messages import DriveStatus
from chairward_drive_can.bus import Bus, Claim, advice, bus_errors, open_bus, sentence
from chairward_drive_can.dialect import Dialect
from chairward_drive_can.frames import MS, Frame
from chairward_drive_can.scale import checked, ramped
from chairward_drive_can.settings import CanSettings

RETRY_NS = (20 * MS, 50 * MS, 100 * MS, 250 * MS, 500 * MS, 1000 * MS)
"""Waits between attempts to open the interface again."""
UNANSWERED_NS = 200 * MS
"""Nobody has acknowledged a frame for so long: the bus is cut or nobody else is on it."""
REOPEN_NS = 1000 * MS
"""After that the interface is opened anew: an adapter that has lost its answers must not stay lost."""


class CanDrive:
    """`chairward.components.Drive` for every dialect."""

    def __init__(
        self,
        settings: CanSettings,
        dialect: Callable[[], Dialect],
        *,
        opener: Callable[[CanSettings], Bus] = open_bus,
        clock: Callable[[], int] = time.monotonic_ns,
    ) -> None:
        self._settings, self._make, self._opener, self._clock = settings, dialect, opener, clock
        self._dialect = dialect()
        self.period_ns = self._dialect.period_ns
        self._name = f"{settings.interface} {settings.channel}"
        self._bus: Bus | None = None
        self._claim: Claim | None = None
        self._retry, self._retry_at_ns = 0, 0
        self._forget()
        self._sent = 0
        self.last_frame = b""
        self._fault = ""

    def _forget(self) -> None:
        """A new connection owes nothing to the old one."""
        self._asked, self._asked_ns = STILL, 0
        self._given, self._given_ns = STILL, 0
        self._neutral = self._linked = False
        self._stuck_since_ns = 0
        self._waiting: list[Frame] = []

    def fileno(self) -> int:
        return -1 if self._bus is None else self._bus.fileno()

    def connect(self, now_ns: int) -> None:
        if self._bus is None:
            if now_ns < self._retry_at_ns:
                return
            self._retry_at_ns = now_ns + RETRY_NS[min(self._retry, len(RETRY_NS) - 1)]
            self._retry += 1
            try:
                self._claim = self._claim or Claim(self._settings.interface, self._settings.channel)
                self._bus = self._opener(self._settings)
            except DriveError as error:
                self._fault = str(error)
                raise
            self._dialect = self._make()
            self._forget()
        self._send(self._dialect.setup(now_ns), now_ns)

    def arm(self, now_ns: int) -> None:
        if unproved := self._settings.silence_unproved():
            raise DriveError(f"drive.can: {unproved}")
        if self._bus is None:
            raise DriveError(f"{self._name} is not connected; {advice(self._settings)}")
        armed = self._dialect.report(now_ns).armed
        self._send(self._dialect.arm(now_ns), now_ns)
        if not armed:
            self._neutral, self._given = False, STILL

    def disarm(self, now_ns: int) -> None:
        self._asked, self._asked_ns, self._given = STILL, now_ns, STILL
        self._send(self._dialect.disarm(now_ns), now_ns)

    def command(self, now_ns: int, motion: Motion, *, hard_stop: bool = False) -> None:
        try:
            wanted = STILL if hard_stop else checked(motion, self._settings)
        except DriveError:
            self._tell(now_ns, STILL, hard_stop=True)
            raise
        self._tell(now_ns, wanted, hard_stop=hard_stop)

    def _tell(self, now_ns: int, wanted: Motion, *, hard_stop: bool) -> None:
        if self._asked_ns and now_ns - self._asked_ns > self._silence_ns:
            self.disarm(now_ns)
        self._neutral = self._neutral or wanted == STILL
        report = self._dialect.report(now_ns)
        armed = report.armed
        if not (armed and self._neutral) or now_ns - report.heard_ns >= self._dialect.quiet_ns:
            wanted = STILL
        self._asked, self._asked_ns = wanted, now_ns
        dt_s = min(max(0, now_ns - self._given_ns), 2 * self.period_ns) / 1e9
        instant = hard_stop or not armed
        self._given = STILL if instant else ramped(self._given, wanted, self._settings, dt_s)
        self._given_ns = now_ns
        if self._bus is not None:
            self._send(self._dialect.command(now_ns, self._given, hard_stop), now_ns)

    def poll(self, now_ns: int) -> DriveStatus:
        if self._bus is not None:
            for frame in self._guarded(self._bus.receive):
                motion = self._given if self._asked_ns else None
                self._send(self._dialect.hear(frame, now_ns, motion), self._asked_ns or now_ns)
            self._send(self._dialect.setup(now_ns), now_ns)
            if self._stuck_since_ns and now_ns - self._stuck_since_ns > REOPEN_NS:
                self._lost(OSError(f"no frame was acknowledged for {REOPEN_NS // MS} ms"))
        report = self._dialect.report(now_ns)
        heard = report.heard_ns > 0 and now_ns - report.heard_ns <= self._settings.link_ms * MS
        linked = self._bus is not None and heard and report.ready
        if linked:
            self._retry, self._fault = 0, ""
        elif self._linked and self._bus is not None:
            self.disarm(now_ns)
        self._linked = linked
        return DriveStatus(
            at_ns=report.heard_ns,
            linked=linked,
            armed=linked and report.armed and self._neutral,
            fault=(report.fault or self._fault or self._stuck(now_ns))[:200],
            speed_mm_s=report.speed_mm_s,
            turn_deg_s=report.turn_deg_s,
            stopped_by_user=report.stopped_by_user,
            battery=report.battery,
            charging=report.charging,
            sent_frames=self._sent,
            unanswered=self._bus.unanswered if self._bus else 0,
        )

    def close(self) -> None:
        if self._bus is not None:
            now_ns = self._clock()
            for frame in self._dialect.farewell(now_ns):
                try:
                    self._bus.send(frame)
                except bus_errors():
                    break
            self._drop()
        if self._claim is not None:
            self._claim.release()
            self._claim = None

    @property
    def _silence_ns(self) -> int:
        """After so long without a command the controller has stopped by itself: then only arming moves it again."""
        return min(self._settings.silence_stop_ms or SILENCE_LIMIT_MS, SILENCE_LIMIT_MS) * MS

    @property
    def _stale_ns(self) -> int:
        return self._settings.stale_ms * MS

    def _age_ns(self, since_ns: int) -> int:
        return self._clock() - since_ns

    def _send(self, frames: Sequence[Frame], now_ns: int) -> None:
        """Send what the guard's call of `now_ns` brought about; what could move the chair only while that is fresh."""
        waiting, self._waiting = [*self._waiting, *frames], []
        for frame in waiting:
            command = self._dialect.is_command(frame)
            if command and self._age_ns(now_ns) > self._stale_ns:
                continue
            if not self._send_one(frame, now_ns) and not command:
                self._waiting.append(frame)

    def _send_one(self, frame: Frame, now_ns: int) -> bool:
        """True when the frame is gone; False when the interface cannot take it now."""
        if self._bus is None:
            return True
        try:
            # A stop may queue behind motion that nobody has answered, so that what is hoarded ends with a stop.
            room = self._dialect.window * (2 if self._given == STILL else 1)
            if self._bus.unanswered >= room:
                raise BlockingIOError
            self._bus.send(frame)
        except BlockingIOError:
            self._stuck_since_ns = self._stuck_since_ns or now_ns
            return False
        except bus_errors() as error:
            self._lost(error)
        self._sent += 1
        self._stuck_since_ns = 0
        self.last_frame = str(frame).encode()
        return True

    def _guarded(self, receive: Callable[[], list[Frame]]) -> list[Frame]:
        try:
            return receive()
        except bus_errors() as error:
            self._lost(error)

    def _lost(self, error: Exception) -> NoReturn:
        self._drop()
        self._fault = f"{self._name} was lost: {sentence(error)}; {advice(self._settings)}"
        raise DriveError(self._fault) from error

    def _drop(self) -> None:
        bus, self._bus = self._bus, None
        self._dialect = self._make()
        self._forget()
        if bus is not None:
            try:
                bus.close()
            except bus_errors():
                return

    def _stuck(self, now_ns: int) -> str:
        if not self._stuck_since_ns or now_ns - self._stuck_since_ns < UNANSWERED_NS:
            return ""
        return f"{self._name}: frames go out but nothing acknowledges them; is the controller on, are the wires whole?"

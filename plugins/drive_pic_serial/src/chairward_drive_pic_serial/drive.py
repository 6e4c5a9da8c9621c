"""The host's side of the PIC: HELLO, NEUTRAL, neutral DRIVE, ARMED; watched answers; never a stale command.

Nothing is sent but from `command`, `arm`, `disarm` and `close`; `poll` sends only the newest command that had to wait
for an answer, and only within the period in which it was given.
"""

from __future__ import annotations

import logging
from collections import deque
from typing import NamedTuple

from chairward.components import STILL, DriveError, Motion
from chairward.messages import DriveStatus
from chairward_drive_pic_serial import wire
from chairward_drive_pic_serial.port import Port, PortError
from chairward_drive_pic_serial.settings import PicSerialSettings
from chairward_drive_pic_serial.wire import Ask, Hello, Input, Nak, State, Status, Why

MS = 1_000_000
PERIOD_NS = 20 * MS
WINDOW = 2
"""Motion frames that may wait for their answer: a pty or USB buffer otherwise hoards seconds of stale motion."""
NEUTRAL_AFTER_NS = 60 * MS
LOST_AFTER_NS = 200 * MS
REARM_AFTER_NS = 150 * MS
"""A guard that was silent this long must arm again, whether or not the firmware's 195 ms have passed."""
HELLO_EVERY_NS = 100 * MS
BACKOFF_NS = (20 * MS, 1000 * MS)

log = logging.getLogger(__name__)


class _Sent(NamedTuple):
    seq: int
    at_ns: int
    moves: bool


class PicSerialDrive:
    """A `chairward.components.Drive` over one serial port."""

    period_ns: int = PERIOD_NS

    def __init__(self, settings: PicSerialSettings) -> None:
        self.settings = settings
        self._port: Port | None = None
        self._wanted = False
        self._open_at_ns = 0
        self._backoff_ns = BACKOFF_NS[0]
        self._fault = ""
        self._at_ns = 0
        self._seq = 0
        self._sent_frames = 0
        self.last_frame = b""
        self._splitter = wire.Splitter()
        self._forget()

    def _forget(self) -> None:
        """Nothing is known of the controller (any more)."""
        self._nonce: int | None = None
        self._hello_seq, self._hello_ns, self._hello_since_ns = 0, 0, 0
        self._status: Status | None = None
        self._arm_wanted = self._was_armed = False
        self._state = State.BOOT
        self._waiting: deque[_Sent] = deque()
        self._waiting_since_ns: int | None = None
        self._neutral_ns, self._stop_sent = 0, False
        self._command_ns: int | None = None
        self._pending: tuple[int, int, int] | None = None

    # ---- Drive

    def fileno(self) -> int:
        """The port's descriptor, or -1."""
        return -1 if self._port is None else self._port.fd

    def connect(self, now_ns: int) -> None:
        """Open the port when it is due (back-off 20 ms to 1 s), then HELLO until answered. Raises DriveError."""
        self._wanted = True
        if self._port is None and now_ns >= self._open_at_ns:
            self._open(now_ns)

    def arm(self, now_ns: int) -> None:
        """Lift a latch of this boot, then arm with a neutral DRIVE. Raises DriveError where that cannot be."""
        if self._nonce is None:
            raise DriveError(f"{self.settings.port}: cannot arm: {self._fault or 'the controller is not connected'}")
        if self._status is not None and self._status.inputs & Input.STOP:
            raise DriveError(f"{self.settings.port}: cannot arm: the stop input is active: release it")
        if self._status is not None and self._status.inputs & Input.CHARGER:
            raise DriveError(f"{self.settings.port}: cannot arm: the charger is connected: unplug it")
        self._arm_wanted, self._was_armed = True, self._state == State.ARMED
        self._command_ns = now_ns

    def disarm(self, now_ns: int) -> None:
        """Latch a stop in the controller."""
        self._arm_wanted = False
        self._pending = None
        if self._nonce is not None:
            self._send(now_ns, Ask.ESTOP)

    def command(self, now_ns: int, motion: Motion, *, hard_stop: bool = False) -> None:
        """Send what is wanted now. NaN, infinity, more than full: brakes and raises DriveError."""
        try:
            steer, drive = (0, 0) if hard_stop else self.settings.hundredths(motion)
        except DriveError:
            self._say(now_ns, 0, 0, hard_stop=True)
            raise
        self._say(now_ns, steer, drive, hard_stop=hard_stop)

    def poll(self, now_ns: int) -> DriveStatus:
        """Read the answers, watch the clock. Raises DriveError once for each loss of port, link or arming."""
        if self._port is None:
            if self._wanted and now_ns >= self._open_at_ns:
                try:
                    self._open(now_ns)
                except DriveError:
                    log.debug("%s", self._fault)  # told by the status's fault; the next attempt is due later
            return self._told()
        try:
            data = self._port.read()
        except PortError as error:
            raise self._lose(now_ns, str(error)) from error
        for payload in self._splitter.feed(data):
            answer = wire.answer(payload)
            if answer is not None:
                self._at_ns = now_ns
                self._take(now_ns, answer)
        self._watch(now_ns)
        return self._told()

    def close(self) -> None:
        """Brake, leave ARMED, give the port back."""
        self._wanted = False
        if self._port is None:
            return
        try:
            if self._nonce is not None:
                self._port.write(wire.ask(Ask.BRAKE, self._next_seq(), 1))
        except PortError as error:
            log.info("while closing: %s", error)  # the controller's own watchdog stops the chair
        self._port.close()
        self._port = None
        self._forget()
        self._fault = ""

    # ---- sending

    def _say(self, now_ns: int, steer: int, drive: int, *, hard_stop: bool) -> None:
        """Choose the frame for what is wanted, given what is known of the controller."""
        if self._port is None or self._nonce is None:
            return
        silent = self._command_ns is not None and now_ns - self._command_ns > REARM_AFTER_NS
        self._command_ns = now_ns
        if silent:
            self._arm_wanted = False
        self._pending = None
        if not self._arm_wanted:
            self._send(now_ns, Ask.BRAKE, 1)
        elif self._state == State.ESTOP:
            self._send(now_ns, Ask.CLEAR, self._nonce >> 8, self._nonce)
        elif hard_stop:
            self._send(now_ns, Ask.BRAKE, 0)
        elif self._state != State.ARMED:
            self._send(now_ns, Ask.DRIVE, 0, 0)
        elif (steer or drive) and not self._overdue(now_ns) and sum(sent.moves for sent in self._waiting) >= WINDOW:
            self._pending = (now_ns, steer, drive)
        else:
            self._send(now_ns, Ask.DRIVE, steer, drive)
        self._watch(now_ns)

    def _send(self, now_ns: int, kind: Ask, *body: int) -> None:
        """One frame now. While the answers are overdue only a neutral one every 60 ms, and a hard stop at once."""
        if self._port is None:
            return
        since = self._waiting_since_ns
        moves = kind == Ask.DRIVE and any(body)
        stop = kind in (Ask.ESTOP, Ask.BRAKE)
        try:
            if self._overdue(now_ns):
                if now_ns - self._neutral_ns < NEUTRAL_AFTER_NS and (self._stop_sent or not stop):
                    return
                self._neutral_ns, self._stop_sent = now_ns, stop
                self._port.forget_unsent()
                self._waiting.clear()
                if moves:
                    body, moves = (0, 0), False
            seq = self._next_seq()
            frame = wire.ask(kind, seq, *body)
            if not self._port.write(frame):
                self._waiting_since_ns = now_ns if since is None else since
                return
        except PortError as error:
            raise self._lose(now_ns, str(error)) from error
        self._sent_frames += 1
        self.last_frame = frame
        self._waiting.append(_Sent(seq, now_ns, moves))
        if since is None:
            self._waiting_since_ns = now_ns

    def _overdue(self, now_ns: int) -> bool:
        """No answer for 60 ms to something that was sent."""
        return self._waiting_since_ns is not None and now_ns - self._waiting_since_ns >= NEUTRAL_AFTER_NS

    def _next_seq(self) -> int:
        self._seq = self._seq % 255 + 1
        return self._seq

    # ---- hearing

    def _take(self, now_ns: int, answer: wire.Answer) -> None:
        """One sound answer of the controller."""
        if isinstance(answer, Hello):
            self._greeted(now_ns, answer)
            return
        if self._nonce is None:
            return
        self._acknowledge(now_ns, answer.seq)
        if answer.state == State.BOOT:
            raise self._reset(now_ns, "it answers as after a reset")
        self._state = answer.state
        if isinstance(answer, Status):
            self._status = answer
        elif isinstance(answer, Nak) and self._arm_wanted and answer.why in (Why.STATE, Why.CHARGING, Why.NONCE):
            self._arm_wanted = False
        if answer.state == State.ARMED:
            self._was_armed = self._was_armed or self._arm_wanted
        elif self._arm_wanted and self._was_armed:
            self._arm_wanted = False
            if answer.fault & wire.Fault.SILENCE:
                raise DriveError(
                    f"{self.settings.port}: the controller heard no command for 195 ms and stopped by itself: arm again"
                )

    def _greeted(self, now_ns: int, hello: Hello) -> None:
        if hello.protocol != wire.PROTOCOL:
            self._fault = (
                f"{self.settings.port}: the controller speaks protocol {hello.protocol}, this plugin speaks "
                f"{wire.PROTOCOL}: program the firmware that belongs to this version ('chairward pic flash-help')"
            )
            self._nonce = None
            self._hello_ns = now_ns + BACKOFF_NS[1]
            raise DriveError(self._fault)
        if hello.seq == 0:
            if self._nonce is not None:
                raise self._reset(now_ns, f"reason: {hello.reason.name.lower().replace('_', ' ')}")
            return
        if hello.seq != self._hello_seq or self._nonce is not None:
            return
        self._nonce, self._state = hello.nonce, hello.state
        self._fault = ""
        self._backoff_ns = BACKOFF_NS[0]
        self._waiting.clear()
        self._waiting_since_ns = None

    def _acknowledge(self, now_ns: int, seq: int) -> None:
        if not any(sent.seq == seq for sent in self._waiting):
            return
        while self._waiting.popleft().seq != seq:
            pass
        self._waiting_since_ns = self._waiting[0].at_ns if self._waiting else None
        if self._pending is not None:
            at_ns, steer, drive = self._pending
            self._pending = None
            if now_ns - at_ns < PERIOD_NS and self._arm_wanted and self._state == State.ARMED:
                self._send(now_ns, Ask.DRIVE, steer, drive)

    # ---- losing and finding

    def _open(self, now_ns: int) -> None:
        self._open_at_ns = now_ns + self._backoff_ns
        self._backoff_ns = min(self._backoff_ns * 2, BACKOFF_NS[1])
        try:
            self._port = Port(self.settings.port)
        except PortError as error:
            self._fault = str(error)
            raise DriveError(self._fault) from error
        self._forget()
        self._fault = ""
        self._splitter = wire.Splitter()
        self._hello_since_ns = now_ns
        self._hello(now_ns)

    def _hello(self, now_ns: int) -> None:
        if self._port is None:
            return
        self._hello_ns, self._hello_seq = now_ns, self._next_seq()
        try:
            self._port.forget_unsent()
            self._port.write(wire.ask(Ask.HELLO, self._hello_seq, *self.settings.rates_ms()))
        except PortError as error:
            raise self._lose(now_ns, str(error)) from error

    def _watch(self, now_ns: int) -> None:
        """Repeat HELLO; call the link lost when answers are missing."""
        if self._nonce is None:
            if now_ns - self._hello_ns >= HELLO_EVERY_NS:
                self._hello(now_ns)
            if now_ns - self._hello_since_ns >= LOST_AFTER_NS and not self._fault:
                self._fault = (
                    f"{self.settings.port}: the controller does not answer: check its power, the cable and that the "
                    "port is the right one ('chairward pic find')"
                )
            return
        if self._waiting_since_ns is not None and now_ns - self._waiting_since_ns >= LOST_AFTER_NS:
            raise self._lose(
                now_ns, f"{self.settings.port}: the controller has not answered for 200 ms: check cable and power"
            )

    def _reset(self, now_ns: int, why: str) -> DriveError:
        """The controller has restarted: everything from the start, on the same port."""
        self._forget()
        self._fault = f"{self.settings.port}: the controller has restarted by itself ({why}): check its supply"
        self._hello_since_ns = now_ns
        self._hello(now_ns)
        return DriveError(self._fault)

    def _lose(self, now_ns: int, sentence: str) -> DriveError:
        """Port or link is gone: close, and open again after the back-off."""
        if self._port is not None:
            self._port.close()
            self._port = None
        self._forget()
        self._fault = sentence
        self._open_at_ns = now_ns + self._backoff_ns
        return DriveError(sentence)

    def _told(self) -> DriveStatus:
        status, linked = self._status, self._nonce is not None
        applied = STILL if status is None else self.settings.motion(status.steer, status.drive)
        known = linked and status is not None
        return DriveStatus(
            at_ns=self._at_ns,
            linked=linked,
            armed=linked and self._arm_wanted and self._state == State.ARMED,
            fault=self._fault[:200],
            speed_mm_s=applied.drive_mm_s if known else None,
            turn_deg_s=applied.turn_deg_s if known else None,
            stopped_by_user=known and status is not None and bool(status.inputs & Input.STOP),
            battery=self.settings.battery(status.battery) if known and status is not None else None,
            charging=known and status is not None and bool(status.inputs & Input.CHARGER),
            sent_frames=self._sent_frames,
            unanswered=len(self._waiting),
        )

"""A simulated R-Net chair: a power module, and the user's joystick module unless it is left out.

Periods and start-up as observed on real chairs (joystick 10 ms, serial 50 ms, modules 100 ms, power module 100/900 ms,
motor current 200 ms, battery and odometer 1 s). Without a joystick module, `power` wants the whole start-up exchange.
What a real power module does when joystick frames stop is NOT known; this one stops after `silence_ms`.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field

from chairward_drive_can import rnet
from chairward_drive_can.frames import MS, Frame
from chairward_drive_can.partners.body import Body
from chairward_drive_can.partners.rnet_startup import PowerModule

SERIAL = bytes.fromhex("08901C8A00000000")
CHARGING = bytes.fromhex("001E030000")
"""What the display is told with a charger plugged in."""


@dataclass
class RnetChair:
    """hear: a frame of the host. tick: what is due now. All times CLOCK_MONOTONIC ns."""

    joystick_module: bool = True
    silence_ms: int = 100
    startup_ms: int = 0
    device: int = 1
    stick: tuple[int, int] = (0, 0)
    speed_percent: int = 20
    full_percent: int = 100
    battery_percent: int = 80
    charging: bool = False
    heartbeat: tuple[int, int] = (0xC0, 0xC1)
    body: Body = field(default_factory=Body)
    moves_heard: int = 0
    locked_out: bool = False
    network_errors: int = 0
    stopped_by_silence: int = 0
    power: PowerModule | None = None
    _born_ns: int = 0
    _last_ns: int = 0
    _stick_heard_ns: int = 0
    _due: dict[str, int] = field(default_factory=dict)
    _beats: int = 0
    _was_standing: bool = True

    def hear(self, frame: Frame, now_ns: int) -> list[Frame]:
        """What a frame from the host brings about."""
        if self.power is not None and not self.power.running:
            return self.power.hear(frame)
        match rnet.decode(frame):
            case rnet.Joystick(device, x, y) if device == self.device:
                self.moves_heard += (x, y) != (0, 0)
                self._obey(x, y, now_ns)
            case rnet.SpeedSetting(_, percent):
                self.speed_percent = percent
            case rnet.NetworkError():
                self.network_errors += 1
                self.locked_out = self.locked_out or self.network_errors >= 3
            case _:
                pass
        return []

    def tick(self, now_ns: int) -> list[Frame]:
        """Everything that is due; lets the motors turn on."""
        self._born_ns = self._born_ns or now_ns
        self.body.step(max(0, now_ns - (self._last_ns or now_ns)) / 1e9)
        self._last_ns = now_ns
        if not self.body.standing and now_ns - self._stick_heard_ns > self.silence_ms * MS:
            self.stopped_by_silence += (self.body.target_forward, self.body.target_left) != (0.0, 0.0)
            self.body.aim(0.0, 0.0)
        return list(self._speak(now_ns))

    def _speak(self, now_ns: int) -> Iterator[Frame]:
        running = now_ns - self._born_ns >= self.startup_ms * MS and (self.power is None or self.power.running)
        if self.joystick_module and not self.locked_out:
            if self._first("hello", now_ns):
                yield Frame(0x00C)
            if self._every("serial", 50, now_ns):
                yield Frame(0x00E, SERIAL)
            if running and self._every("modules", 100, now_ns):
                yield Frame(0x03C30F0F, b"\x87" * 8, extended=True)
            if running and self._every("joystick", rnet.JOYSTICK_PERIOD_MS, now_ns):
                self._obey(*self.stick, now_ns)
                yield rnet.joystick(self.device, *self.stick)
        if not running:
            return
        if self._first("run", now_ns):
            yield Frame(0x7B0)
            yield Frame(0x0C180000, b"\x01\x01", extended=True)
        if self._every("heartbeat", (100, 900)[self._beats % 2], now_ns):
            yield Frame(0x0C140000, bytes((self.heartbeat[self._beats % 2],)), extended=True)
            self._beats += 1
        if self._every("current", 200, now_ns):
            yield Frame(0x14300000, int(400 * abs(self.body.forward)).to_bytes(2, "little"), extended=True)
        if self._every("battery", 1000, now_ns):
            yield Frame(0x1C0C0100, bytes((self.battery_percent,)), extended=True)
            yield Frame(0x1C300004, bytes(8), extended=True)
        if self.charging and self._every("charging", 100, now_ns):
            yield Frame(0x1C200100, CHARGING, extended=True)
        if self.body.standing != self._was_standing:
            self._was_standing = self.body.standing
            if self.body.standing:
                yield Frame(0x0C000005, extended=True)

    def _obey(self, x: int, y: int, now_ns: int) -> None:
        self._stick_heard_ns = now_ns
        share = 0.0 if self.charging else self.speed_percent / self.full_percent
        self.body.aim(y / rnet.FULL * share, -x / rnet.FULL * share)

    def _every(self, what: str, period_ms: int, now_ns: int) -> bool:
        """True when `what` is due; keeps the phase unless more than a period was missed."""
        due = self._due.get(what, now_ns)
        if now_ns < due:
            return False
        self._due[what] = due + period_ms * MS if now_ns - due < period_ms * MS else now_ns + period_ms * MS
        return True

    def _first(self, what: str, now_ns: int) -> bool:
        if what in self._due:
            return False
        self._due[what] = now_ns
        return True

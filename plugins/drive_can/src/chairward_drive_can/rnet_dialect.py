"""R-Net as a drive: watches the user's joystick and the power module, and sends joystick frames when it may."""

from __future__ import annotations

from collections.abc import Sequence

from chairward.components import STILL, DriveError, Motion
from chairward_drive_can import rnet
from chairward_drive_can.dialect import Report
from chairward_drive_can.frames import MS, Frame
from chairward_drive_can.scale import deflection, signed
from chairward_drive_can.settings import CanSettings
from chairward_drive_can.startup import MODULES, MODULES_PERIOD_NS, Startup
from chairward_drive_can.takeover import refusals

JOYSTICK_SILENT_NS = 50 * MS
POWER_SILENT_NS = 1500 * MS
"""The slowest thing the power module says by itself comes once a second."""
NO_JOYSTICK_NS = 500 * MS
"""`emulate` listens that long for a joystick module before it takes its place."""
POWER_QUIET_NS = 500 * MS
"""Its motor current comes every 200 or 250 ms."""


class RnetDialect:
    """takeover `follow`: one frame behind each centred frame of the user's joystick, so a hand on it always wins.
    `jsm_error`, `emulate`: one frame every tick, and a joystick that speaks up ends the motion."""

    def __init__(self, settings: CanSettings, exchange: Sequence[Frame] = ()) -> None:
        self._settings = settings
        self._mode = settings.rnet.takeover
        self._startup: Startup | None = None
        if self._mode == "emulate" and not refusals(settings):
            self._startup = Startup(list(exchange), bytes.fromhex(settings.rnet.serial))
        self._began_ns = self._modules_ns = 0
        self.period_ns, self.window = rnet.JOYSTICK_PERIOD_MS * MS, 2
        self.quiet_ns = JOYSTICK_SILENT_NS if self._mode == "follow" else POWER_QUIET_NS
        self._heard_ns = self._stick_ns = self._power_ns = self._touched_ns = self._armed_ns = 0
        self._centred_since_ns = 0
        self._touched = self._armed = self._charging = self._standing = False
        self._fault = self._trip = ""
        self._power_value: int | None = None
        self._battery: float | None = None

    def is_command(self, frame: Frame) -> bool:
        return frame.extended and frame.id & 0xFFFFF0FF == rnet.JOYSTICK

    def setup(self, now_ns: int) -> Sequence[Frame]:
        self._began_ns = self._began_ns or now_ns
        startup = self._startup
        if startup is None or now_ns - max(self._began_ns, self._stick_ns) < NO_JOYSTICK_NS:
            return ()
        if startup.done and now_ns - self._power_ns > POWER_SILENT_NS:
            startup.reset()
        return () if startup.done else startup.due(now_ns)

    def hear(self, frame: Frame, now_ns: int, motion: Motion | None) -> Sequence[Frame]:
        if self._startup is not None and not self._startup.done:
            self._startup.hear(frame, now_ns)
            self._power_ns = now_ns if self._startup.done else self._power_ns
        event = rnet.decode(frame)
        if event is None:
            return ()
        self._heard_ns = now_ns
        match event:
            case rnet.Joystick(device, x, y):
                return self._joystick(device, x, y, now_ns, motion)
            case rnet.PowerAlive(_, value):
                self._power_ns, self._power_value = now_ns, value
                if value not in self._settings.rnet.heartbeats_well:
                    self._stop(f"R-Net: the power module reports trouble (heartbeat 0x{value:02X}); see its display")
            case rnet.Battery(_, percent):
                self._power_ns, self._battery = now_ns, percent / 100.0
            case rnet.MotorCurrent() | rnet.Odometer():
                self._power_ns = now_ns
            case rnet.Wheels(state):
                self._power_ns, self._standing = now_ns, state == "standing"
            case rnet.SpeedSetting(_, percent) if percent > self._settings.rnet.speed_percent:
                self._stop(
                    f"R-Net: the chair's speed setting is now {percent} %, but its speeds were measured at "
                    f"{self._settings.rnet.speed_percent} % (drive.can.rnet.speed_percent); lower it and arm again"
                )
            case rnet.Profile(what, number) if self._armed:
                self._stop(f"R-Net: {what} {number} was selected, its speeds may differ; arm again")
            case rnet.Trip():
                self._trip = f"R-Net: {event}; look at the chair's display, switch it off and on"
                self._charging = event.code == 0x1E03
                self._stop(self._trip)
            case rnet.Asleep(what):
                self._stop(f"R-Net: {what}; switch the chair on and arm again")
            case rnet.Startup(step) if self._startup is None and step in ("is anybody there", "run"):
                self._trip, self._charging, self._power_value = "", False, None
                if self._armed:
                    self._stop("R-Net: the chair was switched on again; arm again")
            case _:
                pass
        return ()

    def arm(self, now_ns: int) -> Sequence[Frame]:
        if self._armed:
            return ()
        reasons = refusals(self._settings) + self._unfit(now_ns)
        if reasons:
            raise DriveError(reasons[0])
        self._armed, self._armed_ns, self._fault = True, now_ns, ""
        speed = rnet.speed_setting(self._settings.rnet.device, self._settings.rnet.speed_percent)
        return (speed, *([rnet.network_error()] * 3 if self._mode == "jsm_error" else ()))

    def disarm(self, _now_ns: int) -> Sequence[Frame]:
        was, self._armed = self._armed, False
        return () if not was or self._mode == "follow" else (rnet.joystick(self._settings.rnet.device, 0, 0),)

    def command(self, now_ns: int, motion: Motion, _hard_stop: bool) -> Sequence[Frame]:
        if motion != STILL:
            self._standing = False
        if self._mode == "jsm_error" and self._armed:
            return (self._frame(motion),)
        if self._startup is not None and self._startup.done:
            return (self._frame(motion if self._armed else STILL), *self._alive(now_ns, self._startup))
        if self._armed and now_ns - self._stick_ns > JOYSTICK_SILENT_NS:
            self._stop("R-Net: the user's joystick has fallen silent, there is nothing to follow; is the chair on?")
        return ()

    def report(self, now_ns: int) -> Report:
        return Report(
            heard_ns=self._heard_ns,
            ready=self._startup is None or self._startup.done,
            armed=self._armed and now_ns - self._power_ns <= POWER_SILENT_NS,
            fault=self._fault or (self._startup.fault if self._startup else ""),
            speed_mm_s=0.0 if self._standing else None,
            stopped_by_user=self._touched and now_ns - self._stick_ns <= JOYSTICK_SILENT_NS,
            battery=self._battery,
            charging=self._charging,
        )

    def farewell(self, now_ns: int) -> Sequence[Frame]:
        return self.disarm(now_ns)

    def _joystick(self, device: int, x: int, y: int, now_ns: int, motion: Motion | None) -> Sequence[Frame]:
        if device != self._settings.rnet.device and (x, y) == (0, 0):
            return ()
        regular = now_ns - self._stick_ns <= JOYSTICK_SILENT_NS
        self._stick_ns = now_ns
        self._touched = (x, y) != (0, 0)
        self._standing = self._standing and not self._touched
        if self._touched or not regular:
            self._centred_since_ns = now_ns
        if self._touched and self._armed:
            self._stop("R-Net: the user's own joystick was touched and has the chair; arm again to go on")
        elif self._armed and self._mode != "follow" and now_ns - self._armed_ns > JOYSTICK_SILENT_NS:
            self._stop(f"R-Net: the user's joystick is back on the bus, takeover '{self._mode}' gives way")
        elif self._armed and self._mode == "follow" and motion is not None and motion != STILL:
            return (self._frame(motion),)
        return ()

    def _alive(self, now_ns: int, startup: Startup) -> list[Frame]:
        """What a joystick module says beside its frames, in its periods, as long as the guard lives."""
        frames = startup.alive(now_ns)
        if now_ns - self._modules_ns >= MODULES_PERIOD_NS:
            self._modules_ns = now_ns
            frames.append(MODULES)
        return frames

    def _frame(self, motion: Motion) -> Frame:
        settings = self._settings
        drive, turn = signed(motion, settings)
        ahead = settings.full_forward_mm_s if motion.drive_mm_s >= 0 else settings.full_backward_mm_s
        y = deflection(drive, ahead, settings.deadband, rnet.FULL)
        x = -deflection(turn, settings.full_turn_deg_s, settings.deadband, rnet.FULL)
        return rnet.joystick(settings.rnet.device, x, -y if settings.rnet.invert_y else y)

    def _stop(self, why: str) -> None:
        self._armed, self._fault = False, why

    def _unfit(self, now_ns: int) -> list[str]:
        """What on the bus speaks against a takeover now."""
        reasons = []
        if now_ns - self._power_ns > POWER_SILENT_NS or not self._power_ns:
            reasons.append("R-Net: the power module is silent; switch the chair on and check the bus wires")
        elif self._power_value is not None and self._power_value not in self._settings.rnet.heartbeats_well:
            reasons.append(f"R-Net: the power module reports trouble (heartbeat 0x{self._power_value:02X})")
        if self._trip:
            reasons.append(self._trip)
        heard = self._stick_ns and now_ns - self._stick_ns <= JOYSTICK_SILENT_NS
        if self._mode == "emulate":
            if heard:
                reasons.append("R-Net: a joystick module speaks on the bus; 'emulate' is only for a chair without one")
            return reasons
        if not heard:
            reasons.append(
                f"R-Net: no joystick frame of device {self._settings.rnet.device} is heard; switch the chair on"
            )
        elif self._touched:
            reasons.append("R-Net: the user's joystick is not centred; let go of it")
        elif now_ns - self._centred_since_ns < self._settings.rnet.settle_ms * MS:
            reasons.append(
                f"R-Net: the joystick must rest centred for {self._settings.rnet.settle_ms} ms before arming"
            )
        return reasons

"""Two CiA 402 motor controllers as a chair: set up without waiting, driven by PDO, stopping by themselves on silence.

Three things stop a node when we fall silent, all configured at every connect: its RPDO's event timer (no velocity),
its consumer heartbeat (no host), and the abort connection option (then: quick stop). Objects: CiA 301, CiA 402-2.
"""

from __future__ import annotations

from collections.abc import Sequence
from math import radians, trunc

from chairward.components import STILL, DriveError, Motion
from chairward_drive_can.canopen_frames import (
    PREOPERATIONAL,
    START,
    Entry,
    heartbeat,
    nmt,
    sdo_answer,
    sdo_read,
    sdo_write,
)
from chairward_drive_can.dialect import Report
from chairward_drive_can.frames import MS, Frame
from chairward_drive_can.scale import signed
from chairward_drive_can.settings import CanSettings, Cia402Settings, Node

SHUTDOWN, SWITCH_ON, ENABLE, QUICK_STOP, FAULT_RESET = 0x06, 0x07, 0x0F, 0x02, 0x80
PROFILE_402 = 0x0192
RETRIES = 3
ENABLE_WITHIN_NS = 1000 * MS


def state_of(status_word: int) -> str:
    """The drive state a status word tells (CiA 402-2, table of 0x6041)."""
    if status_word & 0x4F in (0x0F, 0x08):
        return "fault"
    if status_word & 0x4F == 0x40:
        return "switch on disabled"
    return {0x21: "ready to switch on", 0x23: "switched on", 0x27: "operation enabled", 0x07: "quick stop active"}.get(
        status_word & 0x6F, "not ready"
    )


def next_control_word(state: str) -> int:
    """The control word that leads from there towards `operation enabled`."""
    return {"ready to switch on": SWITCH_ON, "switched on": ENABLE, "operation enabled": ENABLE}.get(state, SHUTDOWN)


def entries(settings: Cia402Settings, node: int) -> list[Entry]:
    """What is written to a node at set-up, in order."""
    rpdo, tpdo, disabled = 0x200 + node, 0x180 + node, 1 << 31
    scale = settings.units_per_mm_s
    return [
        Entry(0x1016, 1, 4, settings.host_id << 16 | 3 * settings.heartbeat_ms, "consumer heartbeat"),
        Entry(0x1017, 0, 2, settings.heartbeat_ms, "producer heartbeat"),
        Entry(0x6007, 0, 2, 3, "abort connection: quick stop"),
        Entry(0x605A, 0, 2, 2, "quick stop: ramp, then off"),
        Entry(0x605E, 0, 2, 2, "fault reaction: quick stop ramp"),
        Entry(0x6060, 0, 1, 3, "profile velocity mode"),
        Entry(0x6083, 0, 4, round(settings.accel_mm_s2 * scale), "acceleration"),
        Entry(0x6084, 0, 4, round(settings.decel_mm_s2 * scale), "deceleration"),
        Entry(0x6085, 0, 4, round(settings.quick_stop_mm_s2 * scale), "quick stop deceleration"),
        Entry(0x1400, 1, 4, rpdo | disabled, "RPDO off"),
        Entry(0x1600, 0, 1, 0, "RPDO map off"),
        Entry(0x1600, 1, 4, 0x6040_0010, "RPDO control word"),
        Entry(0x1600, 2, 4, 0x60FF_0020, "RPDO target velocity"),
        Entry(0x1600, 0, 1, 2, "RPDO map on"),
        Entry(0x1400, 2, 1, 255, "RPDO at once"),
        Entry(0x1400, 5, 2, settings.rpdo_timeout_ms, "RPDO time-out"),
        Entry(0x1400, 1, 4, rpdo, "RPDO on"),
        Entry(0x1800, 1, 4, tpdo | disabled, "TPDO off"),
        Entry(0x1A00, 0, 1, 0, "TPDO map off"),
        Entry(0x1A00, 1, 4, 0x6041_0010, "TPDO status word"),
        Entry(0x1A00, 2, 4, 0x606C_0020, "TPDO velocity"),
        Entry(0x1A00, 0, 1, 2, "TPDO map on"),
        Entry(0x1800, 2, 1, 255, "TPDO by event"),
        Entry(0x1800, 5, 2, settings.period_ms, "TPDO event timer"),
        Entry(0x1800, 1, 4, tpdo, "TPDO on"),
    ]


class _Wheel:
    """One node: its set-up, step by step and without waiting, and what it last said."""

    def __init__(self, node: Node, settings: Cia402Settings) -> None:
        self.node, self._settings = node, settings
        self._todo = entries(settings, node.id)
        self._step = -2
        self._asked_ns = 0
        self._tries = 0
        self.heard_ns = self.status_ns = 0
        self.status_word = 0
        self.speed_units = 0
        self.fault = ""
        self.ready = False

    @property
    def state(self) -> str:
        return state_of(self.status_word) if self.status_ns else "silent"

    def setup(self, now_ns: int) -> list[Frame]:
        """The request that is due: again after `answer_ms`, from the start after three times."""
        if self.ready or (self._asked_ns and now_ns - self._asked_ns < self._settings.answer_ms * MS):
            return []
        self._tries += 1
        if self._tries > RETRIES and self._step >= -1:
            silent = f"CANopen node {self.node.id} ({self.node.side} wheel) does not answer; power, wires, node id?"
            self.fault = self.fault or silent
            self._step, self._tries = -2, 1
        self._asked_ns = now_ns
        return self._request()

    def _request(self) -> list[Frame]:
        if self._step == -2:
            self._step = -1
            return [nmt(PREOPERATIONAL, self.node.id), sdo_read(self.node.id, 0x1000, 0)]
        if self._step == -1:
            return [sdo_read(self.node.id, 0x1000, 0)]
        return [sdo_write(self.node.id, self._todo[self._step])]

    def answered(self, data: bytes, now_ns: int) -> list[Frame]:
        """One SDO answer: the next request, or the start of the node."""
        answer = sdo_answer(data)
        if answer is None or self.ready or self._step < -1:
            return []
        if self._step == -1:
            if (answer.index, answer.sub) != (0x1000, 0):
                return []
            if answer.value is None or answer.value & 0xFFFF != PROFILE_402:
                self.fault = (
                    f"CANopen node {self.node.id} does not speak the CiA 402 protocol "
                    f"(device type 0x{answer.value or 0:08X}); give the id of a motor controller"
                )
                return []
        else:
            entry = self._todo[self._step]
            if (answer.index, answer.sub) != (entry.index, entry.sub):
                return []
            if answer.abort:
                self.fault = f"CANopen node {self.node.id} refuses {entry}: {answer.reason}; it cannot be driven safely"
                self._asked_ns = now_ns
                return []
        self._step, self._tries, self._asked_ns, self.fault = self._step + 1, 0, now_ns, ""
        if self._step == len(self._todo):
            self.ready = True
            return [nmt(START, self.node.id)]
        return self._request()

    def restart(self, why: str) -> None:
        """The node has lost its set-up."""
        self._step, self._tries, self._asked_ns, self.ready, self.fault = -2, 0, 0, False, why
        self.status_ns = 0


class Cia402Dialect:
    """Both wheels together: unless both are enabled and fresh, both are told to stand."""

    def __init__(self, settings: CanSettings) -> None:
        self._settings, self._own = settings, settings.cia402
        self.period_ns, self.window = self._own.period_ms * MS, 6
        self.quiet_ns = 2 * self.period_ns
        self._wheels = {node.id: _Wheel(node, self._own) for node in self._own.nodes}
        self._arming = self._armed = self._braked = False
        self._fault = ""
        self._beat_ns = self._arming_ns = 0

    def is_command(self, frame: Frame) -> bool:
        return (not frame.extended and (frame.id - 0x200) in self._wheels) or frame.id == 0x700 + self._own.host_id

    def setup(self, now_ns: int) -> Sequence[Frame]:
        return [frame for wheel in self._wheels.values() for frame in wheel.setup(now_ns)]

    def hear(self, frame: Frame, now_ns: int, _motion: Motion | None) -> Sequence[Frame]:
        kind, wheel = frame.id & 0x780, self._wheels.get(frame.id & 0x7F)
        if frame.extended or frame.remote or wheel is None:
            return ()
        if kind == 0x580:
            return wheel.answered(frame.data, now_ns)
        if kind == 0x180 and len(frame.data) == 6:
            wheel.heard_ns = wheel.status_ns = now_ns
            wheel.status_word = int.from_bytes(frame.data[:2], "little")
            wheel.speed_units = int.from_bytes(frame.data[2:], "little", signed=True)
            self._watch(wheel)
        elif kind == 0x700 and len(frame.data) == 1:
            self._heartbeat(wheel, frame.data[0], now_ns)
        elif kind == 0x080 and len(frame.data) == 8:
            code = int.from_bytes(frame.data[:2], "little")
            if code:
                self._stop(f"CANopen node {wheel.node.id} ({wheel.node.side} wheel): emergency 0x{code:04X}")
        return ()

    def _heartbeat(self, wheel: _Wheel, state: int, now_ns: int) -> None:
        wheel.heard_ns = now_ns
        if wheel.ready and state == 0:
            why = f"CANopen node {wheel.node.id} ({wheel.node.side} wheel) has restarted"
            wheel.restart("")
            self._stop(why)

    def _watch(self, wheel: _Wheel) -> None:
        if self._armed and wheel.state != "operation enabled" and not (self._braked and wheel.state != "fault"):
            self._stop(f"CANopen node {wheel.node.id} ({wheel.node.side} wheel) left operation: {wheel.state}")

    def _stop(self, why: str) -> None:
        self._fault, self._armed, self._arming = why, False, False

    def arm(self, now_ns: int) -> Sequence[Frame]:
        if self._armed or self._arming:
            return ()
        for wheel in self._wheels.values():
            if not wheel.ready:
                raise DriveError(wheel.fault or f"CANopen node {wheel.node.id} is still being set up; arm again")
            if not self._fresh(wheel, now_ns):
                raise DriveError(f"CANopen node {wheel.node.id} ({wheel.node.side} wheel) is silent; check its wires")
        self._arming, self._arming_ns, self._fault = True, now_ns, ""
        resets = [wheel for wheel in self._wheels.values() if wheel.state == "fault"]
        return [self._pdo(wheel, FAULT_RESET, 0) for wheel in resets]

    def disarm(self, now_ns: int) -> Sequence[Frame]:
        self._arming = self._armed = False
        return self.command(now_ns, STILL, False)

    def command(self, now_ns: int, motion: Motion, hard_stop: bool) -> Sequence[Frame]:
        frames = []
        if now_ns - self._beat_ns >= self._own.heartbeat_ms * MS - self.period_ns // 2:
            self._beat_ns = now_ns
            frames.append(heartbeat(self._own.host_id))
        if not all(wheel.ready for wheel in self._wheels.values()):
            return frames
        self._braked = self._braked or hard_stop
        if not hard_stop and all(wheel.state == "operation enabled" for wheel in self._wheels.values()):
            self._armed, self._arming, self._braked = self._armed or self._arming, False, False
        if self._arming and now_ns - self._arming_ns > ENABLE_WITHIN_NS:
            states = ", ".join(f"node {wheel.node.id} is '{wheel.state}'" for wheel in self._wheels.values())
            self._stop(f"CANopen: the wheels' controllers do not enable ({states})")
        if self._armed and not all(self._fresh(wheel, now_ns) for wheel in self._wheels.values()):
            self._stop("CANopen: a wheel's controller has fallen silent; both are told to stop")
        return frames + [self._wheel_frame(wheel, motion, hard_stop) for wheel in self._wheels.values()]

    def _wheel_frame(self, wheel: _Wheel, motion: Motion, hard_stop: bool) -> Frame:
        if hard_stop:
            return self._pdo(wheel, QUICK_STOP, 0)
        if not (self._armed or self._arming):
            enabled = wheel.state == "operation enabled"
            standing = wheel.speed_units == 0
            return self._pdo(wheel, ENABLE if enabled and not standing else SHUTDOWN, 0)
        if not self._armed or self._braked:
            return self._pdo(wheel, FAULT_RESET if wheel.state == "fault" else next_control_word(wheel.state), 0)
        return self._pdo(wheel, ENABLE, self._velocity(wheel.node, motion))

    def _velocity(self, node: Node, motion: Motion) -> int:
        """Velocity units for one wheel: v -+ w * track / 2, cut towards zero."""
        drive, turn = signed(motion, self._settings)
        arc = radians(turn) * self._own.track_mm / 2.0
        mm_s = drive - arc if node.side == "left" else drive + arc
        return trunc(mm_s * self._own.units_per_mm_s) * node.sign

    def _pdo(self, wheel: _Wheel, control_word: int, velocity: int) -> Frame:
        return Frame(
            0x200 + wheel.node.id, control_word.to_bytes(2, "little") + velocity.to_bytes(4, "little", signed=True)
        )

    def _fresh(self, wheel: _Wheel, now_ns: int) -> bool:
        return wheel.status_ns > 0 and now_ns - wheel.status_ns <= self._own.rpdo_timeout_ms * MS

    def report(self, now_ns: int) -> Report:
        wheels = list(self._wheels.values())
        faults = [self._fault, *(wheel.fault for wheel in wheels)]
        faults += [f"CANopen node {w.node.id} ({w.node.side} wheel) is in fault" for w in wheels if w.state == "fault"]
        faults += [
            f"CANopen node {w.node.id} ({w.node.side} wheel) has been silent for over {self._own.rpdo_timeout_ms} ms"
            for w in wheels
            if w.status_ns and not self._fresh(w, now_ns)
        ]
        drive, turn = self._measured()
        return Report(
            heard_ns=min(wheel.heard_ns for wheel in wheels),
            ready=all(wheel.ready for wheel in wheels) and all(self._fresh(wheel, now_ns) for wheel in wheels),
            armed=self._armed,
            fault=next((fault for fault in faults if fault), ""),
            speed_mm_s=drive,
            turn_deg_s=turn,
        )

    def _measured(self) -> tuple[float | None, float | None]:
        if not all(wheel.status_ns for wheel in self._wheels.values()):
            return None, None
        speed = {w.node.side: w.speed_units * w.node.sign / self._own.units_per_mm_s for w in self._wheels.values()}
        drive = (speed["left"] + speed["right"]) / 2.0 * self._settings.drive_sign
        turn = (speed["right"] - speed["left"]) / self._own.track_mm / radians(1.0) * self._settings.turn_sign
        return drive, turn

    def farewell(self, now_ns: int) -> Sequence[Frame]:
        self._arming = self._armed = False
        return self.command(now_ns, STILL, True)

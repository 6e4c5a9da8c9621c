"""Simulated CiA 402 motor controllers: NMT, SDO server, RPDO with time-out, consumer heartbeat, drive states, ramps."""

from __future__ import annotations

from dataclasses import dataclass, field

from chairward_drive_can.cia402 import state_of
from chairward_drive_can.frames import MS, Frame
from chairward_drive_can.partners.body import Axis, Body

READY, ON, ENABLED, QUICK, FAULT, DISABLED = 0x0221, 0x0223, 0x0227, 0x0207, 0x0208, 0x0240
OPERATIONAL, PREOPERATIONAL, STOPPED = 0x05, 0x7F, 0x04
NO_OBJECT, BAD_VALUE = 0x06020000, 0x06090030

DEFAULTS = {
    (0x1000, 0): (0x0002_0192, 4), (0x1016, 1): (0, 4), (0x1017, 0): (0, 2), (0x6007, 0): (1, 2), (0x605A, 0): (2, 2),
    (0x605E, 0): (2, 2), (0x6060, 0): (0, 1), (0x6083, 0): (1000, 4), (0x6084, 0): (1000, 4), (0x6085, 0): (3000, 4),
    (0x1400, 1): (0x8000_0200, 4), (0x1400, 2): (255, 1), (0x1400, 5): (0, 2), (0x1600, 0): (0, 1), (0x1600, 1): (0, 4),
    (0x1600, 2): (0, 4), (0x1800, 1): (0x8000_0180, 4), (0x1800, 2): (255, 1), (0x1800, 5): (0, 2),
    (0x1A00, 0): (0, 1), (0x1A00, 1): (0, 4), (0x1A00, 2): (0, 4),
}  # fmt: skip


@dataclass
class MotorNode:
    """One controller. speed and target in velocity units per second."""

    id: int
    objects: dict[tuple[int, int], tuple[int, int]] = field(default_factory=lambda: dict(DEFAULTS))
    nmt: int = PREOPERATIONAL
    status: int = DISABLED
    target: int = 0
    axis: Axis = field(default_factory=Axis)
    timeouts: int = 0
    _rpdo_ns: int = 0
    _host_ns: int = 0
    _tpdo_due_ns: int = 0
    _beat_due_ns: int = 0
    _booted: bool = False

    @property
    def speed(self) -> float:
        """Velocity units per second."""
        return self.axis.value

    def value(self, index: int, sub: int = 0) -> int:
        """What is in the object dictionary; 0 where this node has no such object."""
        return self.objects.get((index, sub), (0, 0))[0]

    def hear(self, frame: Frame, now_ns: int) -> list[Frame]:
        """What a frame on the bus brings about here."""
        if frame.extended or frame.remote:
            return []
        if frame.id == 0 and len(frame.data) == 2 and frame.data[1] in (0, self.id):
            return self._network(frame.data[0])
        if frame.id == 0x600 + self.id and len(frame.data) == 8:
            return [Frame(0x580 + self.id, self._dictionary(frame.data))]
        if frame.id == 0x700 + (self.value(0x1016, 1) >> 16 & 0x7F) and self.value(0x1016, 1):
            self._host_ns = now_ns
        if frame.id == self.value(0x1400, 1) and len(frame.data) == 6 and self.nmt == OPERATIONAL:
            self._rpdo_ns = now_ns
            self._control(int.from_bytes(frame.data[:2], "little"))
            self.target = int.from_bytes(frame.data[2:], "little", signed=True)
        return []

    def tick(self, now_ns: int, dt_s: float) -> list[Frame]:
        """What is due; lets the motor turn."""
        frames = [] if self._booted else [Frame(0x700 + self.id, b"\0")]
        self._booted = True
        enabled = state_of(self.status) == "operation enabled"
        wanted = float(self.target) if enabled else 0.0
        fall = self.value(0x6084) if enabled else self.value(0x6085)
        self.axis.step(wanted, float(self.value(0x6083)), float(fall), dt_s)
        if self.status == QUICK and self.speed == 0.0:
            self.status = DISABLED
        frames += self._silence(now_ns, enabled)
        if (beat_ms := self.value(0x1017)) and now_ns >= self._beat_due_ns:
            self._beat_due_ns = now_ns + beat_ms * MS
            frames.append(Frame(0x700 + self.id, bytes((self.nmt,))))
        tpdo, event_ms = self.value(0x1800, 1), self.value(0x1800, 5)
        if self.nmt == OPERATIONAL and not tpdo >> 31 and event_ms and now_ns >= self._tpdo_due_ns:
            self._tpdo_due_ns = now_ns + event_ms * MS
            speed = int(self.speed).to_bytes(4, "little", signed=True)
            frames.append(Frame(tpdo, self.status.to_bytes(2, "little") + speed))
        return frames

    def fail(self, code: int) -> Frame:
        """Go into fault with an emergency frame."""
        self.status, self.target = FAULT, 0
        return Frame(0x080 + self.id, code.to_bytes(2, "little") + bytes(6))

    def _silence(self, now_ns: int, enabled: bool) -> list[Frame]:
        """RPDO event timer and consumer heartbeat: silence means fault, with the quick stop ramp."""
        limit_ms, watch_ms = self.value(0x1400, 5), self.value(0x1016, 1) & 0xFFFF
        late = limit_ms and self._rpdo_ns and now_ns - self._rpdo_ns > limit_ms * MS
        gone = watch_ms and self._host_ns and now_ns - self._host_ns > watch_ms * MS
        if not (enabled and (late or gone)):
            return []
        self.timeouts += 1
        return [self.fail(0x8250 if late else 0x8130)]

    def _network(self, command: int) -> list[Frame]:
        if command in (0x81, 0x82):
            self.objects, self.nmt, self.status, self.target = dict(DEFAULTS), PREOPERATIONAL, DISABLED, 0
            self._rpdo_ns = self._host_ns = 0
            return [Frame(0x700 + self.id, b"\0")]
        self.nmt = {0x01: OPERATIONAL, 0x02: STOPPED, 0x80: PREOPERATIONAL}.get(command, self.nmt)
        if self.nmt != OPERATIONAL:
            self._rpdo_ns = 0
            self.status = DISABLED if self.status == ENABLED else self.status
        return []

    def _dictionary(self, data: bytes) -> bytes:
        """The answer to one SDO request."""
        index, sub = data[1] | data[2] << 8, data[3]
        head = bytes((data[1], data[2], sub))
        if (index, sub) not in self.objects:
            return b"\x80" + head + NO_OBJECT.to_bytes(4, "little")
        value, size = self.objects[index, sub]
        if data[0] == 0x40:
            return bytes((0x43 | (4 - size) << 2,)) + head + value.to_bytes(4, "little")
        if data[0] & 0xE3 != 0x23 or 4 - (data[0] >> 2 & 3) != size:
            return b"\x80" + head + BAD_VALUE.to_bytes(4, "little")
        self.objects[index, sub] = (int.from_bytes(data[4 : 4 + size], "little"), size)
        return b"\x60" + head + bytes(4)

    def _control(self, word: int) -> None:
        """The state machine of CiA 402-2, as far as a control word moves it."""
        state = state_of(self.status)
        if state == "fault":
            self.status = DISABLED if word & 0x80 else FAULT
        elif word & 0x02 == 0:
            self.status = DISABLED
        elif word & 0x04 == 0:
            self.status = QUICK if state == "operation enabled" else DISABLED if state != "quick stop active" else QUICK
        elif word & 0x0F == 0x06:
            self.status = READY if state != "quick stop active" else QUICK
        elif word & 0x0F == 0x07 and state in ("ready to switch on", "switched on", "operation enabled"):
            self.status = ON
        elif word & 0x0F == 0x0F and state in ("switched on", "operation enabled"):
            self.status = ENABLED


@dataclass
class Cia402Chair:
    """Both wheels on one bus. body: for the simulated world, as fractions of `full` velocity units."""

    left: MotorNode = field(default_factory=lambda: MotorNode(1))
    right: MotorNode = field(default_factory=lambda: MotorNode(2))
    right_sign: int = -1
    full: float = 1000.0
    body: Body = field(default_factory=Body)
    moves_heard: int = 0
    _last_ns: int = 0

    def hear(self, frame: Frame, now_ns: int) -> list[Frame]:
        """Both nodes hear everything."""
        if not frame.extended and frame.id in (0x201, 0x202) and frame.data[2:] != bytes(4):
            self.moves_heard += 1
        return self.left.hear(frame, now_ns) + self.right.hear(frame, now_ns)

    def tick(self, now_ns: int) -> list[Frame]:
        """Both nodes, then the body."""
        dt_s = max(0, now_ns - (self._last_ns or now_ns)) / 1e9
        self._last_ns = now_ns
        frames = self.left.tick(now_ns, dt_s) + self.right.tick(now_ns, dt_s)
        left, right = self.left.speed, self.right.speed * self.right_sign
        self.body.drive.value = (left + right) / 2.0 / self.full
        self.body.steer.value = (right - left) / 2.0 / self.full
        return frames

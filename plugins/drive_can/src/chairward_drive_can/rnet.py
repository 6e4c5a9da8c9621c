"""R-Net frames: what is known of them, decoded and encoded; nothing here does I/O or keeps state.

Facts observed on real chairs and published by the can2RNET and open-rnet projects (their words and code are not used).
125 kbit/s. Where the sources disagree, the chair's file decides (`invert_y`, `heartbeats_well`).
"""

from __future__ import annotations

from dataclasses import dataclass

from chairward_drive_can.frames import Frame

JOYSTICK = 0x02000000
JOYSTICK_PERIOD_MS = 10
FULL = 100
"""Largest deflection in a joystick frame."""


@dataclass(frozen=True, slots=True)
class Joystick:
    """Deflection, -100..100: right is positive x, forward positive y. Every 10 ms from each joystick module.

    What is beyond 100 is a deflection all the same: a hand, or a fault, is on the stick.
    """

    device: int
    x: int
    y: int

    def __str__(self) -> str:
        return f"joystick {self.device}: {_lean(self.y, 'forward', 'backward')}, {_lean(self.x, 'right', 'left')}"


@dataclass(frozen=True, slots=True)
class ModuleAlive:
    """Heartbeat of a module (03C30F0F, 100 ms) or of the joystick with its serial (00E, 50 ms)."""

    serial: str = ""

    def __str__(self) -> str:
        return f"joystick module alive, serial {self.serial}" if self.serial else "modules alive"


@dataclass(frozen=True, slots=True)
class PowerAlive:
    """Heartbeat of the power module; its value says how it is."""

    device: int
    value: int

    def __str__(self) -> str:
        return f"power module {self.device} alive (0x{self.value:02X})"


@dataclass(frozen=True, slots=True)
class SpeedSetting:
    """The user's speed setting, 0..100 percent."""

    device: int
    percent: int

    def __str__(self) -> str:
        return f"speed setting {self.percent} %"


@dataclass(frozen=True, slots=True)
class Horn:
    """The horn starts or stops; it sounds until the stop comes."""

    device: int
    on: bool

    def __str__(self) -> str:
        return "horn on" if self.on else "horn off"


@dataclass(frozen=True, slots=True)
class LightKey:
    """A light was asked for: left, right, hazard, flood."""

    which: str

    def __str__(self) -> str:
        return f"light key: {self.which}"


@dataclass(frozen=True, slots=True)
class Lights:
    """Which lights are lit."""

    lit: tuple[str, ...]

    def __str__(self) -> str:
        return f"lights: {', '.join(self.lit) or 'none'}"


@dataclass(frozen=True, slots=True)
class Battery:
    """Charge, 0..100 percent."""

    device: int
    percent: int

    def __str__(self) -> str:
        return f"battery {self.percent} %"


@dataclass(frozen=True, slots=True)
class MotorCurrent:
    """Drive motor current in the power module's own units (not known in amperes)."""

    device: int
    raw: int

    def __str__(self) -> str:
        return f"motor current {self.raw} (raw)"


@dataclass(frozen=True, slots=True)
class Odometer:
    """Distance counters of both wheels, raw."""

    device: int
    left: int
    right: int

    def __str__(self) -> str:
        return f"odometer left {self.left}, right {self.right} (raw)"


@dataclass(frozen=True, slots=True)
class Wheels:
    """The power module says that the motors slow down, stand, or have been given their output."""

    state: str

    def __str__(self) -> str:
        return f"motors: {self.state}"


@dataclass(frozen=True, slots=True)
class Profile:
    """A drive profile or mode was selected or suspended: speeds may differ from now on."""

    what: str
    number: int

    def __str__(self) -> str:
        return f"{self.what} {self.number}"


@dataclass(frozen=True, slots=True)
class Trip:
    """A module shows an error. code: where it is one we know, else 0."""

    device: int
    code: int
    raw: str

    def __str__(self) -> str:
        meaning = TRIPS.get(self.code) or TRIPS.get(self.code & 0xFF00)
        return f"error 0x{self.code:04X}: {meaning}" if meaning else f"error shown by module {self.device}: {self.raw}"


@dataclass(frozen=True, slots=True)
class Asleep:
    """Power goes down: the whole bus, or one module."""

    what: str

    def __str__(self) -> str:
        return self.what


@dataclass(frozen=True, slots=True)
class NetworkError:
    """The frame that makes joystick modules fail: three of them lock the user's joystick out."""

    device: int

    def __str__(self) -> str:
        return "network error: joystick modules stop"


@dataclass(frozen=True, slots=True)
class Startup:
    """One step of the power-up exchange."""

    step: str

    def __str__(self) -> str:
        return f"start-up: {self.step}"


Event = (
    Joystick | ModuleAlive | PowerAlive | SpeedSetting | Horn | LightKey | Lights | Battery | MotorCurrent | Odometer
    | Wheels | Profile | Trip | Asleep | NetworkError | Startup
)  # fmt: skip

TRIPS = {
    0x1505: "motor 1 brake",
    0x1506: "motor 2 brake",
    0x1E00: "drive inhibited",
    0x1E03: "charging: the chair will not drive",
    0x2C00: "battery low",
    0x2C01: "battery low",
    0x2C02: "battery low",
    0x2F01: "centre the joystick",
}
_LIGHT_KEYS = {1: "left", 2: "right", 3: "hazard", 4: "flood"}
_LIGHT_BITS = {0x01: "left", 0x04: "right", 0x10: "hazard", 0x80: "flood"}
_STARTUP = {
    0x00C: "is anybody there", 0x7B0: "run", 0x7B1: "configuration", 0x7B3: "serial numbers",
    0x060: "mode attribute", 0x050: "profile attribute",
}  # fmt: skip


def _lean(value: int, positive: str, negative: str) -> str:
    return f"{positive if value >= 0 else negative} {abs(value)}"


def joystick(device: int, x: int, y: int) -> Frame:
    """The frame that moves the chair. Raises ValueError outside -100..100."""
    if not (-FULL <= x <= FULL and -FULL <= y <= FULL):
        raise ValueError(f"joystick frame: x = {x}, y = {y}, but -100..100 is what R-Net knows")
    return Frame(JOYSTICK | device << 8, bytes((x & 0xFF, y & 0xFF)), extended=True)


def speed_setting(device: int, percent: int) -> Frame:
    """Set the user's speed setting, 0..100 percent."""
    return Frame(0x0A040000 | device << 8, bytes((percent,)), extended=True)


def network_error() -> Frame:
    """One of the three frames that lock the user's joystick out (takeover `jsm_error`)."""
    return Frame(0x0C000000, extended=True)


def decode(frame: Frame) -> Event | None:
    """What a frame says; None for what nobody knows. Never raises, whatever the bytes."""
    return _decode_extended(frame) if frame.extended else _decode_standard(frame)


def _decode_standard(frame: Frame) -> Event | None:
    number, data = frame.id, frame.data
    if number in (0x000, 0x002):
        return Asleep("sleep for all modules" if frame.remote else "joystick module sleeps")
    if number == 0x004:
        return Asleep("joystick module goes to sleep")
    if number == 0x00E and len(data) == 8:
        return ModuleAlive(data.hex())
    if number == 0x051 and len(data) == 4:
        return Profile("profile", data[1] & 0xF)
    if number == 0x061 and len(data) == 4:
        return Profile("mode suspended" if data[0] & 0x40 else "mode", data[1] & 0xF)
    if number in _STARTUP:
        return Startup(_STARTUP[number])
    if 0x780 <= number <= 0x79F or 0x040 <= number <= 0x04F:
        return Startup("parameters")
    return None


def _decode_extended(frame: Frame) -> Event | None:
    number, data, device = frame.id, frame.data, frame.id >> 8 & 0xF
    family = number & 0xFFFFF0FF
    if family == JOYSTICK and len(data) == 2:
        x, y = (byte - 256 if byte > 127 else byte for byte in data)
        return Joystick(device, x, y)
    if number == 0x03C30F0F:
        return ModuleAlive()
    if family == 0x0C140000 and len(data) == 1:
        return PowerAlive(device, data[0])
    if family == 0x0A040000 and len(data) == 1 and data[0] <= 100:
        return SpeedSetting(device, data[0])
    if family in (0x0C040000, 0x0C040001):
        return Horn(device, family == 0x0C040000)
    if number & 0xFFFFFFF0 == 0x0C000400 and (key := _LIGHT_KEYS.get(number & 0xF)):
        return LightKey(key)
    if number == 0x0C000E00 and len(data) == 2:
        return Lights(tuple(name for bit, name in _LIGHT_BITS.items() if data[1] & bit))
    if family == 0x1C0C0000 and len(data) == 1 and data[0] <= 100:
        return Battery(device, data[0])
    if family == 0x14300000 and len(data) == 2:
        return MotorCurrent(device, int.from_bytes(data, "little"))
    if family == 0x1C300004 and len(data) == 8:
        return Odometer(device, int.from_bytes(data[:4], "little"), int.from_bytes(data[4:], "little"))
    if number in (0x0C000005, 0x0C000006):
        return Wheels("standing" if number == 0x0C000005 else "slowing down")
    if number == 0x0C180000 and data[:1] == b"\x01":
        return Wheels("output enabled")
    if family == 0x1C200000 and data:
        pairs = [int.from_bytes(data[i : i + 2], "big") for i in range(len(data) - 1)]
        return Trip(device, next((pair for pair in pairs if pair in TRIPS), 0), data.hex())
    if family == 0x1C240000:
        return Asleep(f"module {device} powers down")
    if family == 0x0C000000 and not data:
        return NetworkError(device)
    if number >> 24 == 0x1F:
        return Startup("serial number asked" if frame.remote else "serial number")
    return None

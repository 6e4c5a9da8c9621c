"""Rigs: the drive on one end of a bus and a simulated controller on the other, with a clock that the tests own."""

from __future__ import annotations

import fcntl
import os
import sys
import termios
import time
from collections.abc import Iterator, Sequence
from datetime import date
from math import degrees
from pathlib import Path
from typing import Any

import pytest

from chairward.components import DriveError, Motion
from chairward.testing.drive_rig import DriveRig, Heard
from chairward_drive_can import rnet, slcan
from chairward_drive_can.bus import Bus, LibraryBus, open_bus
from chairward_drive_can.dbc import load
from chairward_drive_can.drive import CanDrive
from chairward_drive_can.example import EXAMPLE_TABLE
from chairward_drive_can.frames import Frame
from chairward_drive_can.make import make
from chairward_drive_can.partners.body import Body
from chairward_drive_can.partners.cia402 import Cia402Chair, MotorNode
from chairward_drive_can.partners.dbc import DbcChair
from chairward_drive_can.partners.rnet import RnetChair
from chairward_drive_can.partners.run import AdapterPty, Partner, turn_round
from chairward_drive_can.settings import CanSettings

STEP_NS = 1_000_000
PROVED: dict[str, Any] = {"silence_stop_ms": 200, "silence_stop_measured": date(2026, 11, 22), "link_ms": 200}
FOLLOW = {"takeover": "follow", "hazard_accepted": "two senders, the chair may jerk", "settle_ms": 300}


def settle(descriptor: int, size: int) -> None:
    """The kernel hands a pty's bytes over in its own time; the tests' clock waits until `size` of them are there."""
    end = time.monotonic() + 20.0
    while int.from_bytes(fcntl.ioctl(descriptor, termios.FIONREAD, b"\0" * 4), sys.byteorder) < size:
        assert time.monotonic() < end, "the pty has lost bytes"
        os.sched_yield()


class CountingPty(AdapterPty):
    """An adapter whose bytes arrive before time goes on."""

    taken = 0

    def _read(self) -> bytes:
        data = super()._read()
        self.taken += len(data)
        return data

    def _write(self, data: bytes) -> None:
        before = int.from_bytes(fcntl.ioctl(self._slave, termios.FIONREAD, b"\0" * 4), sys.byteorder)
        super()._write(data)
        settle(self._slave, min(before + len(data), 2048))


class CountingPort:
    """The drive's end, counting what it has written."""

    def __init__(self, bus: Bus) -> None:
        self._bus = bus
        self.written = len(b"\r\rC\rS4\rO\r")
        self.fileno, self.receive, self.close = bus.fileno, bus.receive, bus.close

    @property
    def unanswered(self) -> int:
        return self._bus.unanswered

    def send(self, frame: Frame) -> None:
        self._bus.send(frame)
        self.written += len(slcan.encode(frame))


class CanRig(DriveRig):
    """Common to all dialects: time in steps of a millisecond, the partner's end of the bus, what it heard."""

    full = Motion(500.0, 45.0)
    step_ns = STEP_NS

    def __init__(self, settings: CanSettings) -> None:
        super().__init__()
        self.settings = settings
        self.port = settings.channel
        self.clock_ns = 10_000_000_000
        self.frozen = False
        self.log: list[Heard] = []
        self.sent: list[tuple[int, Frame]] = []
        self.end: Bus | None = self.open_end()
        self.partner: Partner = self.new_partner()
        self.drive: CanDrive = self.new_drive()

    # what a dialect gives

    def new_partner(self) -> Partner:
        raise NotImplementedError

    def motion_in(self, frame: Frame) -> Motion | None:
        """The motion a frame asks for, None when it is no motion frame."""
        raise NotImplementedError

    def open_end(self) -> Bus:
        """The partner's end."""
        return CountingPty(Path(self.settings.channel))

    def new_drive(self) -> CanDrive:
        return self._with_clock(lambda settings: CountingPort(open_bus(settings)))

    def _with_clock(self, opener: Any) -> CanDrive:
        drive = make(self.settings)
        return CanDrive(self.settings, drive._make, opener=opener, clock=self.now_ns)

    # DriveRig

    def now_ns(self) -> int:
        return self.clock_ns

    def run(self, seconds: float) -> None:
        left_ns = round(seconds * 1e9)
        port = self.drive._bus
        if isinstance(port, CountingPort) and isinstance(self.end, CountingPty):
            settle(self.end.fileno(), min(port.written - self.end.taken, 2048))
        while left_ns > 0:
            step = min(self.step_ns, left_ns)
            left_ns -= step
            self.clock_ns += step
            if self.end is None or self.frozen:
                self.partner.tick(self.clock_ns)
            else:
                turn_round(_Listening(self), self.end, self.clock_ns)

    def note(self, frame: Frame, now_ns: int) -> None:
        self.sent.append((now_ns, frame))
        if (motion := self.motion_in(frame)) is not None:
            self.log.append(Heard(now_ns, motion))

    def wheels(self) -> Motion:
        body: Body = self.partner.body
        return Motion(body.forward * self.full.drive_mm_s, body.left * self.full.turn_deg_s)

    def braked(self) -> bool:
        return self.partner.body.standing

    def heard(self) -> Sequence[Heard]:
        return self.log

    def unplug(self) -> None:
        assert self.end is not None
        self.end.close()
        self.end = None

    def plug(self) -> None:
        self.end = self.open_end()

    def freeze(self) -> None:
        self.frozen = True

    def thaw(self) -> None:
        self.frozen = False

    def restart(self) -> None:
        self.partner = self.new_partner()

    def rival(self) -> CanDrive:
        return self.new_drive()

    def close(self) -> None:
        self.drive.close()
        if self.end is not None:
            self.end.close()


class _Listening:
    """The partner, with every frame it hears written down."""

    def __init__(self, rig: CanRig) -> None:
        self._rig = rig
        self.body = rig.partner.body

    def hear(self, frame: Frame, now_ns: int) -> list[Frame]:
        self._rig.note(frame, now_ns)
        return self._rig.partner.hear(frame, now_ns)

    def tick(self, now_ns: int) -> list[Frame]:
        return self._rig.partner.tick(now_ns)


class RnetRig(CanRig):
    """R-Net: the user's joystick goes on speaking whatever happens to our adapter."""

    hard_s = 0.25

    def new_partner(self) -> RnetChair:
        share = self.settings.rnet.speed_percent / 100.0
        late = 300 if hasattr(self, "partner") else 0
        return RnetChair(body=Body(rise_per_s=4.0 * share, fall_per_s=4.5 * share), startup_ms=late)

    def wheels(self) -> Motion:
        share = self.settings.rnet.speed_percent / 100.0
        body = self.partner.body
        return Motion(body.forward / share * self.full.drive_mm_s, body.left / share * self.full.turn_deg_s)

    def motion_in(self, frame: Frame) -> Motion | None:
        event = rnet.decode(frame)
        return Motion(event.y * 5.0, -event.x * 0.45) if isinstance(event, rnet.Joystick) else None

    def battery(self, fraction: float) -> None:
        self.partner.battery_percent = round(fraction * 100)  # type: ignore[attr-defined]

    def charger(self, connected: bool) -> None:
        self.partner.charging = connected  # type: ignore[attr-defined]

    def arm(self, seconds: float = 1.0) -> Any:
        self.ticks(0.4)  # the joystick must have rested centred
        return super().arm(seconds)


class DbcRig(CanRig):
    """The example DBC file on python-can's virtual bus or on an slcan adapter."""

    silence_s = 0.32
    hard_s = 0.045

    def new_partner(self) -> DbcChair:
        table = self.settings.dbc
        boot = 300 if hasattr(self, "partner") else 0
        return DbcChair(
            table, load(table, Path()), full_forward=0.5, full_turn=0.7854, boot_ms=boot, body=Body(4.0, 5.0)
        )

    def motion_in(self, frame: Frame) -> Motion | None:
        if frame.id != 512:
            return None
        values = self.partner.database.decode_message(frame.id, frame.data)  # type: ignore[attr-defined]
        return Motion(values["Forward"] * 1000.0, degrees(values["Turn"]))

    def battery(self, fraction: float) -> None:
        self.partner.battery = fraction * 100.0  # type: ignore[attr-defined]

    def charger(self, connected: bool) -> None:
        self.partner.charging = int(connected)  # type: ignore[attr-defined]

    def press_stop(self, pressed: bool) -> None:
        self.partner.user = int(pressed)  # type: ignore[attr-defined]


class VirtualDbcRig(DbcRig):
    """Over python-can's virtual bus: a cable that can be pulled out of the drive's hands."""

    def open_end(self) -> Bus:
        return LibraryBus(self.settings)

    def new_drive(self) -> CanDrive:
        def opener(settings: CanSettings) -> Bus:
            if self.end is None:
                raise DriveError(f"virtual {settings.channel} cannot be opened: unplugged")
            self.held = LibraryBus(settings)
            return self.held

        return self._with_clock(opener)

    def unplug(self) -> None:
        super().unplug()
        self.held._bus.shutdown()


class Cia402Rig(CanRig):
    """Two motor nodes; their quick stop is a ramp."""

    silence_s = 0.46
    hard_s = 0.40
    lost_s = 0.25

    def new_partner(self) -> Cia402Chair:
        return Cia402Chair(full=self.full.drive_mm_s)

    def wheels(self) -> Motion:
        chair = self.partner
        assert isinstance(chair, Cia402Chair)
        left, right = chair.left.speed, chair.right.speed * chair.right_sign
        return Motion((left + right) / 2.0, degrees((right - left) / self.settings.cia402.track_mm))

    def motion_in(self, frame: Frame) -> Motion | None:
        velocity = int.from_bytes(frame.data[2:], "little", signed=True)
        return Motion(float(velocity), 0.0) if frame.id == 0x201 else None

    def other_version(self) -> None:
        node: MotorNode = self.partner.left  # type: ignore[attr-defined]
        node.objects[0x1000, 0] = (0x0003_0191, 4)


@pytest.fixture
def rnet_settings(tmp_path: Path) -> CanSettings:
    return CanSettings.model_validate(
        {
            "dialect": "rnet",
            "interface": "slcan",
            "channel": str(tmp_path / "can"),
            "acknowledged": True,
            "full_backward_mm_s": 500.0,
            "accel_mm_s2": 1000.0,
            "rnet": FOLLOW,
            **PROVED,
        }
    )


@pytest.fixture
def rnet_rig_type() -> type[RnetRig]:
    return RnetRig


@pytest.fixture
def rnet_rig(rnet_settings: CanSettings) -> Iterator[RnetRig]:
    rig = RnetRig(rnet_settings)
    yield rig
    rig.close()


@pytest.fixture
def dbc_settings(tmp_path: Path) -> CanSettings:
    return CanSettings.model_validate(
        {
            "dialect": "dbc",
            "interface": "virtual",
            "channel": f"bus-{tmp_path.name}",
            "full_backward_mm_s": 500.0,
            "dbc": EXAMPLE_TABLE,
            **PROVED,
        }
    )


@pytest.fixture
def dbc_rig(dbc_settings: CanSettings) -> Iterator[VirtualDbcRig]:
    rig = VirtualDbcRig(dbc_settings)
    yield rig
    rig.close()


@pytest.fixture
def dbc_slcan_rig(dbc_settings: CanSettings, tmp_path: Path) -> Iterator[DbcRig]:
    port = {"interface": "slcan", "channel": str(tmp_path / "can"), "acknowledged": True}
    rig = DbcRig(dbc_settings.model_copy(update=port))
    yield rig
    rig.close()


@pytest.fixture
def cia402_settings(tmp_path: Path) -> CanSettings:
    return CanSettings.model_validate(
        {
            "dialect": "cia402",
            "interface": "slcan",
            "channel": str(tmp_path / "can"),
            "acknowledged": True,
            "full_backward_mm_s": 500.0,
            **PROVED,
        }
    )


@pytest.fixture
def cia402_rig(cia402_settings: CanSettings) -> Iterator[Cia402Rig]:
    rig = Cia402Rig(cia402_settings)
    yield rig
    rig.close()

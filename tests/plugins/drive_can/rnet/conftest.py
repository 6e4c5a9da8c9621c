"""An R-Net chair spoken by hand: the drive, its wire as two lists, and a clock that the tests own."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import Any, Self

import pytest

from chairward.components import STILL, DriveError, Motion
from chairward_drive_can import rnet
from chairward_drive_can.drive import CanDrive
from chairward_drive_can.frames import MS, Frame
from chairward_drive_can.rnet_dialect import RnetDialect
from chairward_drive_can.settings import CanSettings
from chairward_drive_can.takeover import MODES


class WireBus:
    """Both directions as lists: what the drive sent with the true time it did, what it is to hear."""

    def __init__(self, clock: Callable[[], int]) -> None:
        self.clock = clock
        self.sent: list[tuple[int, Frame]] = []
        self.to_hear: list[Frame] = []
        self.unanswered = 0

    def fileno(self) -> int:
        return -1

    def send(self, frame: Frame) -> None:
        self.sent.append((self.clock(), frame))

    def receive(self) -> list[Frame]:
        heard, self.to_hear = self.to_hear, []
        return heard

    def close(self) -> None:
        pass


class Bench:
    """A drive, the wire, and the chair's own modules spoken by hand."""

    def __init__(self, rnet_settings: CanSettings, **changes: Any) -> None:
        mine = rnet_settings.rnet.model_copy(update=changes.pop("rnet", {}))
        self.settings = rnet_settings.model_copy(update={"interface": "virtual", "rnet": mine, **changes})
        self.now_ns = 5_000_000_000
        self.bus = WireBus(lambda: self.now_ns)
        self.drive = CanDrive(
            self.settings, lambda: RnetDialect(self.settings), opener=lambda _: self.bus, clock=lambda: self.now_ns
        )
        self.drive.connect(self.now_ns)

    def hear(self, *frames: Frame) -> Any:
        self.bus.to_hear += frames
        return self.drive.poll(self.now_ns)

    def rest(self, seconds: float, stick: tuple[int, int] | None = (0, 0), motion: Motion = STILL) -> None:
        """The chair lives for a while: joystick every 10 ms, motor current every 200, the guard's ticks."""
        for step in range(round(seconds * 100)):
            self.now_ns += 10 * MS
            if stick is not None:
                self.hear(rnet.joystick(1, *stick))
            if step % 20 == 0:
                self.hear(Frame(0x14300000, b"\0\0", True), Frame(0x0C140000, b"\xc0", True))
            self.drive.command(self.now_ns, motion)

    def joystick_frames(self) -> list[tuple[int, rnet.Joystick]]:
        events = [(at, rnet.decode(frame)) for at, frame in self.bus.sent]
        return [(at, event) for at, event in events if isinstance(event, rnet.Joystick)]

    def close(self) -> None:
        self.drive.close()

    def armed(self) -> Self:
        """At rest for a while, then armed."""
        self.rest(0.5)
        self.drive.arm(self.now_ns)
        self.rest(0.05)
        assert self.drive.poll(self.now_ns).armed
        return self

    def refusal(self) -> str:
        """The sentence that refuses to arm."""
        with pytest.raises(DriveError) as caught:
            self.drive.arm(self.now_ns)
        assert not self.drive.poll(self.now_ns).armed
        return str(caught.value)


@pytest.fixture
def new_bench(rnet_settings: CanSettings) -> Iterator[Callable[..., Bench]]:
    """Benches with changes to the settings (or other settings), closed with the test."""
    made: list[Bench] = []

    def make(settings: CanSettings = rnet_settings, **changes: Any) -> Bench:
        made.append(Bench(settings, **changes))
        return made[-1]

    yield make
    for each in made:
        each.close()


@pytest.fixture
def bench(new_bench: Callable[..., Bench]) -> Bench:
    """Takeover `follow`."""
    return new_bench()


@pytest.fixture
def locked(new_bench: Callable[..., Bench]) -> Bench:
    """Takeover `jsm_error`."""
    accepted = {"takeover": "jsm_error", "hazard_accepted": MODES["jsm_error"].accept}
    return new_bench(rnet=accepted, watchdog_relay="K1")

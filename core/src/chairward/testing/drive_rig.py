"""What a drive backend gives to the contract: a drive, and a controller at the other end of its wire.

The rig owns the clock that the drive is told. A rig around a simulated controller may let time jump (fast,
deterministic); one around a real process returns the monotonic clock and waits.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Sequence
from typing import NamedTuple

from chairward.components import STILL, Drive, DriveError, Motion
from chairward.messages import DriveStatus

S = 1_000_000_000


class Heard(NamedTuple):
    """One frame that asks for motion (or for none), as it arrived at the controller's end of the wire."""

    at_ns: int
    motion: Motion


class DriveRig(ABC):
    """A drive and its controller under test. Figures are upper bounds that the contract holds the backend to.

    silence_s: the controller stops by itself that long after the last motion command.
    lost_s: the drive says linked False (or raises) that long after the controller's last answer.
    stop_s: a controlled stop from `full` has ended. hard_s: a hard stop brakes within it.
    full: the largest motion each way that the drive accepts. coarse: a motion surely above the controller's resolution.
    scale_error: allowed relative error of applied against commanded motion.
    port: the name that every sentence about a lost port must hold.
    """

    drive: Drive
    full: Motion = Motion(500.0, 45.0)
    coarse: Motion = Motion(50.0, 5.0)
    silence_s: float = 0.200
    lost_s: float = 0.250
    stop_s: float = 1.5
    hard_s: float = 0.045
    scale_error: float = 0.05
    port: str = ""

    @abstractmethod
    def now_ns(self) -> int:
        """The clock that the drive is told."""

    @abstractmethod
    def run(self, seconds: float) -> None:
        """Let time pass for wire and controller; the host calls nothing meanwhile."""

    @abstractmethod
    def wheels(self) -> Motion:
        """What the controller makes the motors do now, in the core's units and signs; zeros when it stops them."""

    @abstractmethod
    def braked(self) -> bool:
        """The controller holds the wheels (brake, short-brake, or its own stop state); coasting is not braked."""

    @abstractmethod
    def heard(self) -> Sequence[Heard]:
        """All motion frames that have reached the controller's end of the wire, oldest first."""

    @abstractmethod
    def unplug(self) -> None:
        """Take the port away, as pulling the cable out does."""

    @abstractmethod
    def plug(self) -> None:
        """Bring the same port back (the controller may have been restarted by it)."""

    @abstractmethod
    def freeze(self) -> None:
        """The controller's side of the wire hangs: it neither reads nor answers (its own watchdog still stops it)."""

    @abstractmethod
    def thaw(self) -> None:
        """The wire goes on; what was hoarded in it arrives now."""

    @abstractmethod
    def restart(self) -> None:
        """The controller resets (brown-out, watchdog) and starts again; nobody tells the host."""

    @abstractmethod
    def close(self) -> None:
        """Close the drive, end the controller."""

    # Optional, for the contracts of drive_extras.

    def press_stop(self, pressed: bool) -> None:
        """The stop input at the controller (or the user's own joystick)."""
        raise NotImplementedError

    def charger(self, connected: bool) -> None:
        """Plug a charger in or out."""
        raise NotImplementedError

    def battery(self, fraction: float) -> None:
        """Set the battery's level, 0..1."""
        raise NotImplementedError

    def rival(self) -> Drive:
        """A second drive on the same port."""
        raise NotImplementedError

    def other_version(self) -> None:
        """Put a controller with another protocol version at the end of the wire."""
        raise NotImplementedError

    # What a guard does, for all contracts.

    def __init__(self) -> None:
        self.errors: list[str] = []

    def attempt(self, call: Callable[[], object]) -> bool:
        """Call; a DriveError is kept in `errors`. True when there was none."""
        try:
            call()
        except DriveError as error:
            self.errors.append(str(error))
            return False
        return True

    def tick(self, motion: Motion = STILL, *, hard_stop: bool = False) -> DriveStatus:
        """One period of the guard: command, let half of it pass, poll, let the rest pass, poll again."""
        drive, half_s = self.drive, self.drive.period_ns / 2 / S
        self.attempt(lambda: drive.command(self.now_ns(), motion, hard_stop=hard_stop))
        status = self.poll()
        for _ in range(2):
            self.run(half_s)
            status = self.poll()
        return status

    def poll(self) -> DriveStatus:
        """Poll; a DriveError counts as "not linked", with its sentence as the fault."""
        try:
            return self.drive.poll(self.now_ns())
        except DriveError as error:
            self.errors.append(str(error))
            return DriveStatus(at_ns=0, linked=False, armed=False, fault=str(error)[:200])

    def ticks(
        self,
        seconds: float,
        motion: Motion = STILL,
        *,
        hard_stop: bool = False,
        until: Callable[[DriveStatus], bool] | None = None,
    ) -> DriveStatus:
        """Tick for that long, or until the status fits."""
        end = self.now_ns() + int(seconds * S)
        status = self.tick(motion, hard_stop=hard_stop)
        while self.now_ns() < end and not (until and until(status)):
            status = self.tick(motion, hard_stop=hard_stop)
        return status

    def connect(self, seconds: float = 3.0) -> DriveStatus:
        """Connect as the guard does, standing, until linked (asserted)."""
        end = self.now_ns() + int(seconds * S)
        status = self.poll()
        while not status.linked and self.now_ns() < end:
            self.attempt(lambda: self.drive.connect(self.now_ns()))
            status = self.ticks(0.1, until=lambda s: s.linked)
        assert status.linked, f"not linked within {seconds} s: {status.fault!r} {self.errors[-1:]}"
        return status

    def arm(self, seconds: float = 1.0) -> DriveStatus:
        """Ask to arm, standing, until armed (asserted)."""
        self.ticks(0.06)
        self.attempt(lambda: self.drive.arm(self.now_ns()))
        status = self.ticks(seconds, until=lambda s: s.armed)
        assert status.armed, f"not armed within {seconds} s: {status.fault!r} {self.errors[-1:]}"
        return status

    def go(self, motion: Motion | None = None, seconds: float | None = None) -> Motion:
        """Connect, arm and drive at half of full ahead (or `motion`) until steady; what the wheels do then."""
        if not self.poll().linked:
            self.connect()
        self.arm()
        wanted = motion if motion is not None else self.half
        if seconds is not None:
            self.ticks(seconds, wanted)
            return self.wheels()
        end, before, same = self.now_ns() + int(self.stop_s * S), STILL, 0
        while self.now_ns() < end and same < 5:
            self.tick(wanted)
            same = same + 1 if self.wheels() == before != STILL else 0
            before = self.wheels()
        return before

    @property
    def half(self) -> Motion:
        """Half of full ahead."""
        return Motion(self.full.drive_mm_s / 2, 0.0)

"""What the three dialects have in common: a state machine with frames in and frames out, no I/O, no own clock."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Protocol

from chairward.components import Motion
from chairward_drive_can.frames import Frame


@dataclass(frozen=True, slots=True, kw_only=True)
class Report:
    """What a dialect knows of its controller; heard_ns: when it last said something valid, 0 never."""

    heard_ns: int = 0
    ready: bool = False
    armed: bool = False
    fault: str = ""
    speed_mm_s: float | None = None
    turn_deg_s: float | None = None
    stopped_by_user: bool = False
    battery: float | None = None
    charging: bool = False


class Dialect(Protocol):
    """One controller's language. Every method returns the frames to send now, and none ever waits."""

    period_ns: int
    """How often the controller wants a command."""
    quiet_ns: int
    """A controller unheard for so long gets no motion, only neutral: what nobody reads must not pile up."""
    window: int
    """Frames of motion that may be unanswered at most, where the interface tells: those of two ticks."""

    def hear(self, frame: Frame, now_ns: int, motion: Motion | None, /) -> Sequence[Frame]:
        """Take in one frame. motion: the guard's last command, None before the first. Never raises."""

    def setup(self, now_ns: int, /) -> Sequence[Frame]:
        """The next step of the set-up that is due, if any; called often, told apart by time."""

    def arm(self, now_ns: int, /) -> Sequence[Frame]:
        """Begin to accept motion. Raises DriveError with the reason why not."""

    def disarm(self, now_ns: int, /) -> Sequence[Frame]:
        """Accept no motion any more."""

    def command(self, now_ns: int, motion: Motion, hard_stop: bool, /) -> Sequence[Frame]:
        """The guard's command of this tick. Raises DriveError for what the controller cannot express."""

    def report(self, now_ns: int, /) -> Report:
        """How the controller is, as last heard."""

    def farewell(self, now_ns: int, /) -> Sequence[Frame]:
        """A stop, on the way out."""

    def is_command(self, frame: Frame, /) -> bool:
        """Whether this frame tells the motors what to do: such frames are sent fresh or not at all."""

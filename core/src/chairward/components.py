"""The small interfaces behind the hooks, and what a component is told about the chair it serves.

A plugin offers components; the chair file names those it uses. `make` is called in the process that runs the
component (lane, guard, observer), never at discovery, so a plugin may import its libraries late.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from datetime import date
from pathlib import Path
from typing import Any, NamedTuple, Protocol, Self, TypeVar

from pydantic import BaseModel, ConfigDict, Field, model_validator

from chairward.messages import DriveStatus, Message
from chairward.stages import Pane
from chairward.stages import Pose as Pose

T = TypeVar("T")


class Settings(BaseModel):
    """Base of every component's settings: strict, frozen, no NaN; each field with a description and a range."""

    model_config = ConfigDict(extra="forbid", frozen=True, allow_inf_nan=False)

    def unfit_to_ride(self) -> tuple[str, str] | None:
        """The key, and why a chair that somebody sits in is refused with its value; None: fit."""
        return None


class NoSettings(Settings):
    """For a component with nothing to set."""


SILENCE_LIMIT_MS = 250
"""A controller must stop by itself when commands stop for this long."""


class DriveSettings(Settings):
    """Base of every drive's settings: what `chairward check drive` has measured of its controller.

    Without the silence (or a relay) a chair file is refused, unless nothing real is behind its drive.
    """

    silence_stop_ms: int | None = Field(
        default=None, ge=1, description="measured: from the last command until it stops by itself"
    )
    silence_stop_measured: date | None = Field(
        default=None, description="when that was measured, wheels off the ground"
    )
    silence_stop_method: str = Field(default="", description="how that was measured")
    stop_decel_mm_s2: float | None = Field(
        default=None, gt=0, description="measured: deceleration of a controlled stop, without load"
    )
    hard_stop_ms: int | None = Field(default=None, ge=1, description="measured: a hard stop until nothing moves")
    watchdog_relay: str = Field(default="", description="or: the relay in the motor supply that a missing host opens")

    @model_validator(mode="after")
    def _dated(self) -> Self:
        if (self.silence_stop_ms is None) != (self.silence_stop_measured is None):
            raise ValueError("silence_stop_ms and silence_stop_measured belong together: the figure and its date")
        return self

    def silence_unproved(self) -> str:
        """ "" when the controller is known to stop by itself on silence, else why not: the end of a sentence."""
        if self.watchdog_relay:
            return ""
        if self.silence_stop_ms is None:
            return (
                "nobody has measured that this controller stops when commands stop; run 'chairward check drive' with "
                "the wheels off the ground, or name a watchdog_relay"
            )
        if self.silence_stop_ms > SILENCE_LIMIT_MS:
            return (
                f"the controller stops only {self.silence_stop_ms} ms after the last command, at most "
                f"{SILENCE_LIMIT_MS} ms are allowed; name a watchdog_relay in its motor supply"
            )
        return ""


class Motion(NamedTuple):
    """A chair's motion: forward (+) or backward (-) in mm/s, left (+, anticlockwise) or right (-) in deg/s."""

    drive_mm_s: float
    turn_deg_s: float


STILL = Motion(0.0, 0.0)


@dataclass(frozen=True, slots=True, kw_only=True)
class Footprint:
    """The chair's outline on the floor, feet included: a rectangle about the axle's middle, mm."""

    front_mm: float
    rear_mm: float
    half_width_mm: float


@dataclass(frozen=True, slots=True, kw_only=True)
class Context:
    """What a component may know beside its own settings.

    lane: the lane's name ("front"). pose: of the lane's source. words: word -> command, as the person has chosen.
    run_dir: a private folder of this run (sockets, ptys, reports). chair_dir: where the chair file is.
    person, person_dir: who drives, and where that person's recordings are kept.
    stop_mm, avoid_mm: the thresholds in force (for display and for choosing what to look at; the guard decides).
    records_fd, frames: for a source whose lane observes: where records arrive (SEQPACKET), and each lane's frame ring.
    """

    lane: str
    run_dir: Path
    chair_dir: Path
    pose: Pose = field(default_factory=Pose)
    footprint: Footprint = field(default_factory=lambda: Footprint(front_mm=500.0, rear_mm=500.0, half_width_mm=320.0))
    person: str = ""
    person_dir: Path = Path()
    words: Mapping[str, str] = field(default_factory=dict)
    language: str = "en"
    stop_mm: int = 600
    avoid_mm: int = 750
    records_fd: int = -1
    frames: Mapping[str, int] = field(default_factory=dict)


class DeviceLost(Exception):
    """A device is gone or cannot be opened: one sentence with its name and what to do. The lane tries again later."""


class EndOfInput(Exception):
    """A finite source (files) has given everything."""


class Bench:
    """What the stages of a lane share for one item of the source: put and get by type."""

    def __init__(self) -> None:
        self._items: dict[type[object], object] = {}
        self.panes: dict[str, Pane] = {}

    def put(self, item: object) -> None:
        """Lay an item down under its type, in place of an older one; panes are kept one for each name."""
        if isinstance(item, Pane):
            self.panes[item.name] = item
        else:
            self._items[type(item)] = item

    def get(self, kind: type[T]) -> T | None:
        """The newest item of exactly that type, or None."""
        item = self._items.get(kind)
        return item if isinstance(item, kind) else None

    def clear(self) -> None:
        """Forget everything: called by the lane before each new item of the source."""
        self._items.clear()
        self.panes.clear()


class Source(Protocol):
    """Gives items (StereoFrame, AudioBlock, ...) or messages of its own (a sonar: RangeReading), or a list of them.

    The sequence of its own messages goes on rising over close and open.
    """

    def open(self) -> None:
        """Open the device. Raises DeviceLost."""

    def read(self, timeout_s: float) -> object | None:
        """The newest item, or None after timeout_s. Raises DeviceLost, EndOfInput."""

    def close(self) -> None:
        """Give the device back; may be called twice, and after a failed open."""


class Processor(Protocol):
    """A stage of a lane: sensors and recognizers alike."""

    def process(self, bench: Bench) -> Iterable[Message]:
        """Take what it needs from the bench, put what it gives, return the facts it found (often none)."""

    def close(self) -> None:
        """Release what it holds; may be called twice."""


class Drive(Protocol):
    """The way to the wheels; lives in the guard. No call may ever block: the guard's tick waits for none of them.

    Every method but close may raise DriveError (one sentence); the guard then stops, latches and reconnects.
    A drive may have an attribute `last_frame` (bytes): what it last put on the wire, which goes into the record.
    """

    period_ns: int
    """How often `command` must be called: the guard's tick."""

    def fileno(self) -> int:
        """Descriptor that becomes readable when the controller answers, or -1 when there is none (not connected)."""

    def connect(self, now_ns: int) -> None:
        """Begin (or go on) connecting; progress is told by `poll`."""

    def arm(self, now_ns: int) -> None:
        """Ask the controller to accept motion; only called standing, with neutral commanded."""

    def disarm(self, now_ns: int) -> None:
        """Ask the controller to accept no motion any more (a latched stop)."""

    def command(self, now_ns: int, motion: Motion, *, hard_stop: bool = False) -> None:
        """One non-blocking write of the motion wanted now. hard_stop: brake at once, motion is STILL."""

    def poll(self, now_ns: int) -> DriveStatus:
        """Read what has come in without waiting, and say how the controller is."""

    def close(self) -> None:
        """Command a stop and give the port back; may be called twice."""


class DriveError(Exception):
    """The drive cannot do what was asked: one sentence with its port and what to do."""


class Observer(Protocol):
    """Gets a copy of every record; runs in a process of its own and can never hold the guard up.

    If it dies it is started again in the same run, without the records of meanwhile: it must write over nothing.
    """

    def observe(self, record: bytes) -> None:
        """One encoded `chairward.records.Record`."""

    def close(self) -> None:
        """The run has ended."""


class Companion(Protocol):
    """A program that stands in for something outside the chair (a simulated controller, a simulated world)."""

    def run(self, ready: Callable[[], None], stopping: Callable[[], bool]) -> None:
        """Work until stopping() is true; call ready() once its devices are there. Runs in a process of its own."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Component:
    """One thing a plugin offers; which kind it is follows from the hook that returned it.

    name: as chair files say it. settings: a `Settings` class. make: settings, context -> the object.
    needs, gives: types a stage takes from and lays on the bench, in that order; for a source, what it yields.
    Messages in `gives` say what the guard may expect: RangeReading or Veto make it a required, vetoing sensor.
    plugin: who offers it; filled in when the plugin is registered.
    """

    name: str
    settings: type[Settings]
    make: Callable[[Any, Context], Any]
    needs: Sequence[type[object]] = ()
    gives: Sequence[type[object]] = ()
    summary: str = ""
    plugin: str = ""

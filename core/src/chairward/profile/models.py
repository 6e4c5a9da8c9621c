"""What may stand in a chair file (integrator) and in a person file (person).

Marks (`Safer`) say who may move a limit which way; without one it is the integrator's alone. Distances are mm from the
footprint, speeds mm/s and deg/s. Defaults are the shipped, careful ones (0.5 m/s, 0.6 m/s^2).
"""

from __future__ import annotations

from datetime import date
from typing import Annotated, Any, Literal

from pydantic import BaseModel, ConfigDict, Field, model_validator

from chairward.messages import Button, Command, Way
from chairward.plan import ChairKind
from chairward.profile.errors import LANGUAGE, NAME, WORD
from chairward.profile.merge import Safer

PROTECTED_MM = 450
"""Nearer than this the chair's own motion never brings its footprint to what it drives at."""

Name = Annotated[str, Field(pattern=NAME, max_length=40)]
Text = Annotated[str, Field(max_length=400)]
Word = Annotated[str, Field(min_length=1, max_length=40, pattern=WORD)]
Table = dict[str, Any]


class Strict(BaseModel):
    """Unknown keys are mistakes; no infinity, no NaN."""

    model_config = ConfigDict(extra="forbid", frozen=True, allow_inf_nan=False, populate_by_name=True)


class FootprintTable(Strict):
    """The chair's outline, feet included: a rectangle about the middle of the drive axle."""

    front_mm: float = Field(gt=0, le=2000, description="from the axle to the tips of the feet")
    rear_mm: float = Field(gt=0, le=2000, description="from the axle to the rearmost part")
    half_width_mm: float = Field(gt=0, le=1000, description="from the middle to the outermost part, turning parts too")


class PoseTable(Strict):
    """Where a sensor sits: x forward, y left, z up from the floor below the axle's middle; pitch down is positive."""

    x_mm: float = Field(default=0.0, ge=-3000, le=3000, description="forward of the axle")
    y_mm: float = Field(default=0.0, ge=-3000, le=3000, description="left of the middle")
    z_mm: float = Field(default=0.0, ge=0, le=3000, description="above the floor")
    yaw_deg: float = Field(default=0.0, ge=-180, le=180, description="turned left is positive")
    pitch_deg: float = Field(default=0.0, ge=-90, le=90, description="looking down is positive")
    roll_deg: float = Field(default=0.0, ge=-180, le=180, description="right side down is positive")


class LimitsTable(Strict):
    """The chair's bounds; a person may move the marked ones towards the safer side."""

    stop_mm: Annotated[int, Safer.HIGHER] = Field(
        default=600, ge=600, le=3000, description="an obstacle this near stops the chair"
    )
    avoid_mm: Annotated[int, Safer.HIGHER] = Field(
        default=750, ge=600, le=4000, description="an obstacle this near makes the chair slow down and steer"
    )
    turn_clear_mm: Annotated[int, Safer.HIGHER] = Field(
        default=250, ge=0, le=2000, description="room beside the outline to turn; never less than the toes swing out"
    )
    near_loss_mm: Annotated[int, Safer.HIGHER] = Field(
        default=800, ge=600, le=4000, description="an obstacle last seen nearer than this is still there"
    )
    forward_mm_s: Annotated[int, Safer.LOWER] = Field(default=500, gt=0, le=1500, description="forward speed")
    backward_mm_s: Annotated[int, Safer.LOWER] = Field(default=150, gt=0, le=500, description="backward speed")
    turn_deg_s: Annotated[int, Safer.LOWER] = Field(default=20, gt=0, le=60, description="turning speed")
    arc_mm_s: Annotated[int, Safer.LOWER] = Field(default=300, gt=0, le=1500, description="speed in a curve")
    avoid_mm_s: Annotated[int, Safer.LOWER] = Field(
        default=200, ge=0, le=300, description="speed between stop_mm and avoid_mm"
    )
    steer_deg_s: Annotated[float, Safer.LOWER] = Field(
        default=0.0, ge=0, le=10, description="slight steering to the freer side by itself; 0 = off"
    )
    crawl_mm_s: Annotated[int, Safer.LOWER] = Field(
        default=0, ge=0, le=100, description="speed where one sensor is blind and another, independent one watches"
    )
    unseen_backward_mm_s: Annotated[int, Safer.LOWER] = Field(
        default=150, ge=0, le=150, description="backward speed without a sensor that looks behind"
    )
    unseen_toe_mm_s: Annotated[int, Safer.LOWER] = Field(
        default=150, ge=0, le=150, description="speed of the toes in a turn without sensors at the sides"
    )
    accel_mm_s2: Annotated[int, Safer.LOWER] = Field(default=500, gt=0, le=2000, description="gathering speed")
    turn_accel_deg_s2: Annotated[int, Safer.LOWER] = Field(default=60, gt=0, le=360, description="starting to turn")
    lease_s: Annotated[float, Safer.LOWER] = Field(
        default=8.0, gt=0, le=20, description="how long one word drives forward"
    )
    lease_warn_s: Annotated[float, Safer.FREE] = Field(
        default=2.5, ge=0, le=10, description="warning before that time ends"
    )
    turn_step_deg: Annotated[float, Safer.LOWER] = Field(default=15.0, gt=0, le=90, description="one word turns so far")
    arc_step_deg: Annotated[float, Safer.LOWER] = Field(
        default=15.0, gt=0, le=90, description="one word while driving turns so far"
    )
    back_step_mm: Annotated[float, Safer.LOWER] = Field(
        default=300.0, gt=0, le=1000, description="one 'back' goes so far"
    )
    reverse_step_mm: Annotated[float, Safer.LOWER] = Field(
        default=300.0, gt=0, le=1000, description="one 'reverse' goes so far"
    )
    held_ms: Annotated[int, Safer.LOWER] = Field(
        default=250, ge=100, le=500, description="a held switch must repeat within this"
    )
    latch_after_ms: Annotated[int, Safer.LOWER] = Field(
        default=500, ge=100, le=500, description="silence longer than this needs reset and arm"
    )
    commands: Annotated[frozenset[Command], Safer.SUBSET] = Field(
        default=frozenset(Command), description="what may be asked for; stop and help always may"
    )
    drive_freshness_ms: int = Field(default=200, ge=20, le=500, description="the controller must have answered within")
    supervisor_freshness_ms: int = Field(default=200, ge=100, le=1000, description="the supervisor, too")
    gap_limit_ms: int = Field(default=100, ge=20, le=500, description="a longer jump of the guard's own clock latches")

    @model_validator(mode="after")
    def _together(self) -> LimitsTable:
        if self.avoid_mm <= self.stop_mm:
            raise ValueError(f"avoid_mm = {self.avoid_mm} must be above stop_mm = {self.stop_mm}: raise avoid_mm too")
        if self.near_loss_mm < self.stop_mm:
            raise ValueError(
                f"near_loss_mm = {self.near_loss_mm} must not be below stop_mm = {self.stop_mm}: raise near_loss_mm too"
            )
        for always in (Command.STOP, Command.HELP):
            if always not in self.commands:
                raise ValueError(f"commands must keep '{always}': stop and help can always be asked for")
        return self


class StoppingTable(Strict):
    """Measured facts that the proof of distances rests on: the integrator's alone."""

    decel_mm_s2: int = Field(default=600, gt=0, le=5000, description="of the controlled stop, measured on the level")
    slope_percent: float = Field(default=0.0, ge=0, le=30, description="steepest slope the chair may go down")
    tick_ms: int = Field(default=20, ge=5, le=100, description="the guard's tick: the drive's period")
    wire_ms: int = Field(default=4, ge=0, le=100, description="from the guard's write to the controller's pins")
    watchdog_ms: int = Field(default=200, ge=0, le=1000, description="the controller stops this long after silence")
    sensing_ms: int = Field(default=26, ge=0, le=1000, description="from light on the sensor to its time stamp")
    closing_mm_s: int = Field(default=800, ge=0, le=3000, description="speed of somebody coming towards the chair")
    sensor_range_mm: int = Field(
        default=2500, ge=600, le=20_000, description="an obstacle is seen from here at the latest"
    )
    sensor_error_mm: int = Field(
        default=50, ge=0, le=150, description="a reading near stop_mm is wrong by at most this"
    )
    reaction_ms: int = Field(
        default=0, ge=0, le=5000, description="longest time from glass to wire, by check timing; 0: not measured"
    )
    reaction_measured: date | None = Field(default=None, description="when that was; check timing writes it")
    reaction_method: Text = Field(default="", description="and how")


class LaneTable(Strict):
    """One lane: a source and its stages in order, in a process of its own."""

    source: str = Field(description="component that gives pictures, sound or messages")
    stages: list[str] = Field(default=[], description="sensors and recognizers, in the order they work")
    freshness_ms: int = Field(default=200, ge=20, le=1000, description="its newest report may be this old")
    covers: frozenset[Way] = Field(default=frozenset(), description="the ways its sensors watch")
    pose: PoseTable = Field(default=PoseTable(), description="where its source sits on the chair")
    may: frozenset[Button] = Field(default=frozenset(), description="the buttons it is entitled to press")
    stop_device: bool = Field(default=False, description="a person's means of stopping; must be alive to drive")
    ends_run: bool = Field(default=False, description="the run ends when its source has given everything")
    observes: bool = Field(default=False, description="its source is a screen: it sees all records and pictures")
    settings: dict[str, Table] = Field(default={}, description="of its components, over the chair's settings")


class PartTable(Strict):
    """A companion or observer."""

    component: str
    settings: Table = Field(default={}, description="of the component, over the chair's settings")
    with_drive: str | None = Field(default=None, description="only when the person drives with this drive")


class Interval(Strict):
    """A range of numbers that a person may choose from."""

    min: float
    max: float


Choice = list[str | int | float | bool] | Interval | Literal["any"]


class Chair(Strict):
    """A chair file: everything an integrator decides."""

    name: Name
    about: Text = ""
    kind: ChairKind = Field(description="what stands behind the drive: simulator, files, robot or chair")
    person: Name | None = Field(default=None, description="who drives when nobody is named")
    hardware_stop: Text = Field(default="", description="the stop that needs no software; a chair must have one")
    stop_words: list[Word] = Field(default=["stop", "halt"], description="words that never may mean motion")
    footprint: FootprintTable
    limits: LimitsTable = LimitsTable()
    stopping: StoppingTable = StoppingTable()
    lane: dict[Name, LaneTable] = Field(min_length=1)
    drive: dict[str, Table] = Field(min_length=1, description="the drives offered, with their settings")
    settings: dict[str, Table] = Field(default={}, description="of components by name")
    choices: dict[str, dict[str, Choice]] = Field(
        default={},
        description='settings of components that a person may choose: a list of values, min and max, or "any"',
    )
    companion: dict[Name, PartTable] = Field(default={})
    observer: dict[Name, PartTable] = Field(default={})


class Person(Strict):
    """A person file: what one person decides, inside what the chair allows."""

    name: Name
    about: Text = ""
    chair: Name | list[Name] = Field(description="the chair or chairs this was set up for")
    drive: str | None = Field(default=None, description="one of the drives the chair offers")
    language: Annotated[str, Field(pattern=LANGUAGE)] = "en"
    words: dict[Word, Command] = Field(default={}, description="word -> what it means")
    limits: Table = Field(default={}, description="only towards the safer side")
    settings: dict[str, Table] = Field(default={}, description="of components, as far as the chair offers the choice")

    @property
    def chairs(self) -> list[str]:
        """The chairs this person is set up for."""
        return [self.chair] if isinstance(self.chair, str) else list(self.chair)

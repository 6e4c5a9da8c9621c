"""What the rules look at: the newest facts, and the limits that chair and person have set. Frozen, nothing derived."""

from __future__ import annotations

from collections.abc import Mapping

import msgspec

from chairward.components import STILL, Motion
from chairward.envelope import Caps
from chairward.messages import Alive, Button, Command, DriveStatus, RangeReading, Veto, Way

MS = 1_000_000
S = 1_000_000_000
NOT_ARMED = "not armed yet"
"""The latch that needs no RESET: ARM alone lifts it."""


class Wish(msgspec.Struct, frozen=True, kw_only=True):
    """What somebody wants, stamped by the guard.

    source: "lane/stage". seq: the guard's own running number of wishes, so that each is new. at_ns: arrival.
    stick: (forward, left) fractions of a proportional control, None for a command.
    """

    source: str
    seq: int
    at_ns: int
    command: Command
    word: str = ""
    confidence: float = 1.0
    held: bool = False
    stick: tuple[float, float] | None = None


class Pressed(msgspec.Struct, frozen=True, kw_only=True):
    """A button; the guard has already checked that this source may press it.

    at_ns: when it was seen to be down, arrival at the latest.
    """

    source: str
    button: Button
    at_ns: int


class Facts(msgspec.Struct, frozen=True, kw_only=True):
    """Everything that is known at `now_ns` (CLOCK_MONOTONIC); sources are named "lane/stage".

    ranges: the last three readings of each sensor, oldest first; captured_ns is the older of claim and arrival.
    vetoes, alive: the newest of each source. lost: source -> sentence, for what is known to be dead.
    heard, pressed: all that arrived since the last decision, in order of arrival.
    supervisor_ns: last heartbeat of the supervisor. gap_ns: 0, or by how much the guard's own clock jumped.
    refused: source -> sentence, for messages since the last decision that failed at the border (of several, the last);
    refusals: how many they were.
    """

    now_ns: int
    ranges: Mapping[str, tuple[RangeReading, ...]] = {}
    vetoes: Mapping[str, Veto] = {}
    alive: Mapping[str, Alive] = {}
    lost: Mapping[str, str] = {}
    heard: tuple[Wish, ...] = ()
    pressed: tuple[Pressed, ...] = ()
    drive: DriveStatus = DriveStatus(at_ns=0, linked=False, armed=False)
    supervisor_ns: int = 0
    gap_ns: int = 0
    refused: Mapping[str, str] = {}
    refusals: Mapping[str, int] = {}


class SourceLimits(msgspec.Struct, frozen=True, kw_only=True):
    """One required vote: how old its newest fact may be, and (sensors) the ways its declared coverage opens."""

    freshness_ns: int
    covers: frozenset[Way] = frozenset()


class Limits(msgspec.Struct, frozen=True, kw_only=True):
    """Chair and person merged: all that the rules may assume. Speeds mm/s and deg/s, distances mm from the footprint.

    sensors, recognizers, stop_devices, vetoers: every required vote by name; each must be fresh and well for motion.
    caps: never exceeded. wish_*: the person's own speeds. unseen: what a way without coverage may do at most (rule 10).
    reaction_s: from light on the sensor to torque at the wheel, silence and watchdog included (rule 3).
    decel_mm_s2: of the controlled stop, on the steepest slope allowed. accel_*: rising ramp.
    turn_clear_mm: what the swinging corners and toes need beside and ahead of the outline to turn (rule 2).
    near_loss_mm: rule 6. crawl_mm_s: rule 5, only where an independent sensor covers. steer_deg_s: rule 4, 0 = off.
    lease_s, lease_warn_s, turn_step_deg, arc_step_deg, back_step_mm, reverse_step_mm: rule 7.
    held_ns: a held switch or stick must repeat within this. latch_after_ns: silence longer than this latches.
    gap_limit_ns: a jump of the guard's clock longer than this latches.
    """

    sensors: Mapping[str, SourceLimits] = {}
    recognizers: Mapping[str, SourceLimits] = {}
    stop_devices: Mapping[str, SourceLimits] = {}
    vetoers: Mapping[str, SourceLimits] = {}
    commands: frozenset[Command] = frozenset(Command)
    caps: Caps = Caps(500.0, 150.0, 30.0, 30.0)
    unseen: Caps = Caps(0.0, 150.0, 20.0, 20.0)
    forward_mm_s: float = 500.0
    backward_mm_s: float = 150.0
    turn_deg_s: float = 20.0
    arc_mm_s: float = 300.0
    stop_mm: int = 600
    turn_clear_mm: int = 250
    avoid_mm: int = 750
    avoid_mm_s: float = 200.0
    steer_deg_s: float = 0.0
    near_loss_mm: int = 800
    crawl_mm_s: float = 0.0
    reaction_s: float = 0.45
    decel_mm_s2: float = 600.0
    accel_mm_s2: float = 500.0
    turn_accel_deg_s2: float = 60.0
    lease_s: float = 8.0
    lease_warn_s: float = 2.5
    turn_step_deg: float = 15.0
    arc_step_deg: float = 15.0
    back_step_mm: float = 300.0
    reverse_step_mm: float = 300.0
    held_ns: int = 250 * MS
    drive_freshness_ns: int = 200 * MS
    supervisor_freshness_ns: int = 200 * MS
    latch_after_ns: int = 500 * MS
    gap_limit_ns: int = 100 * MS


class Near(msgspec.Struct, frozen=True, kw_only=True):
    """An obstacle remembered by rule 6: last seen ahead at distance_mm; backed off and turned by so much since then.

    gone: it vanished without having receded, so it is held to be still there.
    """

    distance_mm: int
    seen_ns: int
    backed_mm: float = 0.0
    turned_deg: float = 0.0
    gone: bool = False


class State(msgspec.Struct, frozen=True, kw_only=True):
    """All that one decision leaves to the next; small on purpose.

    latch: "" or why the chair may not move until ARM; needs_reset: a fault, so RESET must come before ARM.
    armed: the controller has accepted motion since ARM; that it stops doing so is a fault.
    wish: the live wish, None when spent. base: the forward wish that an arc step returns to.
    step_left: degrees or millimetres still to go of a step.
    output, output_ns: what the last decision commanded. near: rule 6's memory by sensor.
    """

    latch: str = NOT_ARMED
    needs_reset: bool = False
    armed: bool = False
    wish: Wish | None = None
    base: Wish | None = None
    step_left: float = 0.0
    output: Motion = STILL
    output_ns: int = 0
    near: Mapping[str, Near] = {}


class Instruction:
    """What people read and hear (thesis section 5), colour and shape in the dashboard."""

    WAY_CLEAR = "Way clear"
    GO_STRAIGHT = "Go straight"
    TURN_LEFT = "Turn slightly left"
    TURN_RIGHT = "Turn slightly right"
    STOP = "Stop now"


class Why(msgspec.Struct, frozen=True, kw_only=True):
    """One reason, for people and records: the rule, who raised it, and a clause ("540 mm ahead")."""

    rule: str
    source: str = ""
    detail: str = ""


class Decision(msgspec.Struct, frozen=True, kw_only=True):
    """What the guard does now, and why.

    motion: to the drive. hard_stop: brake at once (faults, stop pressed). arm: ask the controller to arm.
    disarm: ask it to accept no motion. instruction: one of Instruction. nearest_mm: least trusted distance ahead.
    reasons: the binding votes, worst first. open_ways: ways in which a new word could move the chair.
    lease_left_s: 0 when no lease runs. protective_stop: True on the one decision that spent a live wish by a stop.
    help: a call for help was heard in this drain. notes: sentences to log (who died, what was refused).
    """

    motion: Motion = STILL
    hard_stop: bool = False
    arm: bool = False
    disarm: bool = False
    instruction: str = Instruction.STOP
    nearest_mm: int | None = None
    caps: Caps = Caps(0.0, 0.0, 0.0, 0.0)
    reasons: tuple[Why, ...] = ()
    open_ways: tuple[Way, ...] = ()
    command: Command | None = None
    lease_left_s: float = 0.0
    protective_stop: bool = False
    help: bool = False
    latch: str = ""
    notes: tuple[str, ...] = ()

"""What crosses a process border, and only that.

Every message is a fact, never a command to the wheels: a plugin says what it measured or heard, the guard decides.
Ranges are part of the types, so a decoder refuses what is impossible (NaN, negative distances, unknown fields).
Distances are millimetres *from the chair's footprint*, times are CLOCK_MONOTONIC nanoseconds.
"""

from __future__ import annotations

from enum import StrEnum
from typing import Annotated

import msgspec

Distance_mm = Annotated[int, msgspec.Meta(ge=0, le=20_000)]
Count = Annotated[int, msgspec.Meta(ge=0, le=2**62)]
Fraction = Annotated[float, msgspec.Meta(ge=0.0, le=1.0)]
Signed = Annotated[float, msgspec.Meta(ge=-1.0, le=1.0)]
Text = Annotated[str, msgspec.Meta(max_length=200)]
Name = Annotated[str, msgspec.Meta(min_length=1, max_length=80)]

NOTHING_NEAR_MM = 5000
"""What a sensor reports where it sees no obstacle at all (thesis section 4: "none: 5000 mm")."""


class Way(StrEnum):
    """A direction of motion; also the direction in which a sensor looks."""

    AHEAD = "ahead"
    BEHIND = "behind"
    LEFT = "left"
    RIGHT = "right"


class Command(StrEnum):
    """What a person can ask for: the six of the thesis, and a call for help that always works.

    RESET and CONFIRM are the buttons RESET and ARM for somebody who cannot press any: two words, one after the other,
    from a lane that the chair file entitles to them (`may`).
    """

    FRONT = "front"
    BACK = "back"
    LEFT = "left"
    RIGHT = "right"
    REVERSE = "reverse"
    STOP = "stop"
    HELP = "help"
    RESET = "reset"
    CONFIRM = "confirm"


class Button(StrEnum):
    """What a stop device, switch or panel can say. Who may say which is in the chair file (`may`)."""

    STOP = "stop"
    ARM = "arm"
    RESET = "reset"
    HOLD = "hold"


class Report(msgspec.Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """Common to all facts.

    seq: rises by at least 1 with every report of one stage.
    captured_ns: when the *oldest raw data* that the report rests on was captured, CLOCK_MONOTONIC.
    """

    seq: Count
    captured_ns: Count


class RangeReading(Report, frozen=True, kw_only=True, tag="range"):
    """Nearest obstacle each way, mm from the footprint; None says nothing about that way.

    can_see is False when the sensor cannot tell (dark, covered, too little texture): never "clear".
    closing_mm_s: speed at which the nearest thing ahead comes closer beyond the chair's own motion, 0 if unknown.
    coverage, confidence: 0..1. reason: one short sentence, shown to people, e.g. "plain wall".
    """

    can_see: bool
    ahead_mm: Distance_mm | None = None
    behind_mm: Distance_mm | None = None
    left_mm: Distance_mm | None = None
    right_mm: Distance_mm | None = None
    closing_mm_s: Annotated[int, msgspec.Meta(ge=0, le=5_000)] = 0
    coverage: Fraction = 1.0
    confidence: Fraction = 1.0
    reason: Text = ""


class Intent(Report, frozen=True, kw_only=True, tag="intent"):
    """A command that was heard or pressed.

    word: what was heard, as the person wrote it. confidence: 0..1.
    held: True for a switch that must be held (repeated at least every 100 ms), False for a word, which is a lease.
    """

    command: Command
    word: Text = ""
    confidence: Fraction = 1.0
    held: bool = False


class Stick(Report, frozen=True, kw_only=True, tag="stick"):
    """A proportional hand control, always held: forward and left as fractions of the person's own speeds, -1..1."""

    forward: Signed
    left: Signed


class Alive(Report, frozen=True, kw_only=True, tag="alive"):
    """Heartbeat of a recognizer or stop device, every 100 ms; well is False when it cannot work (muted, dead)."""

    well: bool = True
    level_dbfs: Annotated[float, msgspec.Meta(ge=-200.0, le=20.0)] | None = None
    noise_dbfs: Annotated[float, msgspec.Meta(ge=-200.0, le=20.0)] | None = None
    clipping: bool = False
    reason: Text = ""


class Press(Report, frozen=True, kw_only=True, tag="press"):
    """A button went down (HOLD: is still down; repeated at least every 100 ms)."""

    button: Button


class Veto(Report, frozen=True, kw_only=True, tag="veto"):
    """A plugin whose matter is neither range nor intent (tilt, battery, seat, charger) asks for a stop; False lifts it.

    Sent at least as often as the lane's freshness limit, standing or not: its silence stops the chair too.
    """

    stop: bool
    reason: Text = ""


class Lost(Report, frozen=True, kw_only=True, tag="lost"):
    """A lane has lost its device ("camera 0 was unplugged"). Counts as silence, with a name."""

    reason: Text


class Ended(Report, frozen=True, kw_only=True, tag="ended"):
    """A finite input (files) has come to its end. Counts as silence."""


Message = RangeReading | Intent | Stick | Alive | Press | Veto | Lost | Ended
"""Everything a lane may send to the guard."""


class Parcel(msgspec.Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """One message on the wire, with the component of the lane that made it (the guard knows the lane by its socket).

    sent_ns: when the lane sent it; for figures only, no rule looks at it.
    """

    stage: Name
    body: Message
    sent_ns: Count = 0


class DriveStatus(msgspec.Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """What a drive last knew, made by the drive inside the guard.

    at_ns: when the controller itself last said something valid (0: never).
    linked: the controller answers. armed: it accepts motion. fault: "" or one sentence.
    speed_mm_s, turn_deg_s: measured or applied motion, None where the controller does not tell.
    stopped_by_user: a stop input at the controller, or the user's own joystick, is active.
    battery: 0..1, None unknown. charging: a charger is connected (ISO 7176-14 8.9: then no drive).
    """

    at_ns: Count
    linked: bool
    armed: bool
    fault: Text = ""
    speed_mm_s: float | None = None
    turn_deg_s: float | None = None
    stopped_by_user: bool = False
    battery: Fraction | None = None
    charging: bool = False
    sent_frames: Count = 0
    unanswered: Count = 0

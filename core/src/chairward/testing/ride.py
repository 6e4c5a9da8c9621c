"""A healthy chair to decide for: facts that are all fresh, and a ride of decisions in which tests break one thing."""

from __future__ import annotations

import dataclasses
from collections.abc import Iterable
from dataclasses import dataclass, field
from typing import Any

from msgspec.structs import replace

from chairward.arbiter import decide
from chairward.components import Footprint
from chairward.facts import MS, Decision, Facts, Limits, Pressed, S, SourceLimits, State, Wish
from chairward.messages import Alive, Button, Command, DriveStatus, RangeReading, Veto, Way
from chairward.plan import ChairKind, LanePlan, Part, Plan
from chairward.records import Record

FRONT, VOICE, PANEL = "front/range", "voice/words", "panel/switch"
AHEAD_AND_SIDES = frozenset({Way.AHEAD, Way.LEFT, Way.RIGHT})
START_NS = 1_000 * S
TICK_NS = 20 * MS


def chair_limits(**changes: Any) -> Limits:
    """The limits of a plain chair: one sensor ahead, one recognizer, one stop device; changed as told."""
    plain = Limits(
        sensors={FRONT: SourceLimits(freshness_ns=200 * MS, covers=AHEAD_AND_SIDES)},
        recognizers={VOICE: SourceLimits(freshness_ns=400 * MS)},
        stop_devices={PANEL: SourceLimits(freshness_ns=400 * MS)},
    )
    return replace(plain, **changes)


def chair_plan(**changes: Any) -> Plan:
    """The plan of that chair, with a drive and one lane that name no real component; changed as told."""
    plain = Plan(
        chair="t",
        chair_file="/t.toml",
        kind=ChairKind.SIMULATOR,
        person="p",
        person_file="/p.toml",
        person_dir="/p",
        language="en",
        words={},
        footprint=Footprint(front_mm=1, rear_mm=1, half_width_mm=1),
        limits=chair_limits(),
        drive=Part(component="none"),
        lanes=(LanePlan(name="front", source=Part(component="nobody")),),
    )
    return dataclasses.replace(plain, **changes)


def readings(
    now_ns: int, *, age_ns: int = 60 * MS, period_ns: int = 33 * MS, **fields: Any
) -> tuple[RangeReading, ...]:
    """Three equal readings, the newest age_ns old; fields as of `RangeReading` (far ahead and seeing, unless told)."""
    far = dict.fromkeys(("ahead_mm", "behind_mm", "left_mm", "right_mm"), 4_000)
    said: dict[str, Any] = {"can_see": True, **far, **fields}
    return tuple(RangeReading(seq=i, captured_ns=now_ns - age_ns - (3 - i) * period_ns, **said) for i in (1, 2, 3))


def healthy(limits: Limits, now_ns: int = START_NS, **changes: Any) -> Facts:
    """Facts in which every required vote is there and nothing is near; changed as told."""
    heard_ns = now_ns - 50 * MS
    facts = Facts(
        now_ns=now_ns,
        ranges={name: readings(now_ns) for name in limits.sensors},
        vetoes={name: Veto(seq=1, captured_ns=heard_ns, stop=False) for name in limits.vetoers},
        alive={name: Alive(seq=1, captured_ns=heard_ns) for name in {**limits.recognizers, **limits.stop_devices}},
        drive=DriveStatus(at_ns=now_ns - 10 * MS, linked=True, armed=True),
        supervisor_ns=now_ns - 100 * MS,
    )
    return replace(facts, **changes)


def recorded(tick: int, before: State, facts: Facts, limits: Limits, **changes: Any) -> Record:
    """The decision on these facts as the guard publishes it, told to the drive in the same instant; changed as told."""
    after, decision = decide(before, facts, limits)
    plain = Record(
        tick=tick,
        due_ns=facts.now_ns,
        woke_ns=facts.now_ns,
        wrote_ns=facts.now_ns,
        periodic=True,
        before=before,
        facts=facts,
        after=after,
        decision=decision,
        told=decision.motion,
    )
    return replace(plain, **changes)


def driving(command: Command = Command.FRONT, now_ns: int = START_NS, **changes: Any) -> State:
    """An armed chair that has been told to move; changed as told."""
    wish = Wish(source=VOICE, seq=1, at_ns=now_ns - 500 * MS, command=command)
    return replace(State(latch="", armed=True, wish=wish, output_ns=now_ns - TICK_NS), **changes)


@dataclass(slots=True, kw_only=True)
class Ride:
    """Decision after decision with an obedient controller; what the world says is changed between ticks.

    world: fields of the readings of each sensor. silent: sources that have stopped talking. reports_speed: whether
    the controller tells its speed. The controller arms and disarms as it is told.
    """

    limits: Limits = field(default_factory=chair_limits)
    state: State = field(default_factory=State)
    now_ns: int = START_NS
    world: dict[str, dict[str, Any]] = field(default_factory=dict)
    silent: set[str] = field(default_factory=set)
    drive: DriveStatus = DriveStatus(at_ns=0, linked=True, armed=False)
    reports_speed: bool = False
    decisions: list[Decision] = field(default_factory=list)
    _facts: Facts | None = None
    _wishes: int = 0

    def facts(self, **changes: Any) -> Facts:
        """The facts now: what is silent stays as it was, everything else is as fresh as can be."""
        fresh = healthy(self.limits, self.now_ns)
        ranges: dict[str, tuple[RangeReading, ...]] = {
            name: readings(self.now_ns, **self.world.get(name, {})) for name in self.limits.sensors
        }
        vetoes, alive = dict(fresh.vetoes), dict(fresh.alive)
        drive = replace(self.drive, at_ns=self.now_ns - 10 * MS)
        if self.reports_speed:
            output = self.state.output
            drive = replace(drive, speed_mm_s=output.drive_mm_s, turn_deg_s=output.turn_deg_s)
        supervisor_ns = fresh.supervisor_ns
        if self._facts:
            ranges |= {name: said for name, said in self._facts.ranges.items() if name in self.silent}
            vetoes |= {name: said for name, said in self._facts.vetoes.items() if name in self.silent}
            alive |= {name: said for name, said in self._facts.alive.items() if name in self.silent}
            if "drive" in self.silent:
                drive = replace(drive, at_ns=self._facts.drive.at_ns)
            if "supervisor" in self.silent:
                supervisor_ns = self._facts.supervisor_ns
        facts = replace(fresh, ranges=ranges, vetoes=vetoes, alive=alive, drive=drive, supervisor_ns=supervisor_ns)
        return replace(facts, **changes)

    @property
    def newest_facts(self) -> Facts:
        """What the last decision was made from."""
        assert self._facts is not None, "no decision yet"
        return self._facts

    def wish(self, command: Command, *, held: bool = False, source: str = VOICE, **fields: Any) -> Wish:
        """A new wish, stamped now."""
        self._wishes += 1
        return Wish(source=source, seq=self._wishes, at_ns=self.now_ns, command=command, held=held, **fields)

    def tick(
        self,
        *heard: Command | Wish,
        press: Iterable[Button] = (),
        times: int = 1,
        dt_ns: int = TICK_NS,
        **changes: Any,
    ) -> Decision:
        """`times` decisions dt_ns apart; what is heard and pressed arrives with the first. Returns the last."""
        for nth in range(times):
            self.now_ns += dt_ns
            if nth == 0:
                wishes = tuple(self.wish(word) if isinstance(word, Command) else word for word in heard)
                pressed = tuple(Pressed(source=PANEL, button=button, at_ns=self.now_ns) for button in press)
                changes = {"heard": wishes, "pressed": pressed, **changes}
            elif nth == 1:
                changes = {key: value for key, value in changes.items() if key not in ("heard", "pressed")}
            self._facts = self.facts(**changes)
            self.state, decision = decide(self.state, self._facts, self.limits)
            self.decisions.append(decision)
            armed = (self.drive.armed or decision.arm) and not decision.disarm
            self.drive = replace(self.drive, armed=armed)
        return self.decisions[-1]

    def arm(self) -> Decision:
        """RESET, ARM, and a moment for the controller."""
        self.tick(press=[Button.RESET])
        self.tick(press=[Button.ARM])
        return self.tick(times=2)

    def drive_off(self, *words: Command, times: int = 60) -> Decision:
        """Arm, say the words (FRONT if none), and go on for a while."""
        self.arm()
        return self.tick(*(words or (Command.FRONT,)), times=times)


def integrated(ride: Ride, since: int = 0) -> tuple[float, float]:
    """mm and degrees that the decisions since then commanded."""
    motions = [decision.motion for decision in ride.decisions[since:]]
    dt = TICK_NS / S
    return sum(m.drive_mm_s for m in motions) * dt, sum(m.turn_deg_s for m in motions) * dt


def armed(limits: Limits | None = None) -> Ride:
    """A ride whose chair is armed and stands."""
    ride = Ride(limits=limits or chair_limits())
    ride.arm()
    return ride

"""Both promises as a state machine: whatever people and the world do in whatever order, the laws hold each time."""

from __future__ import annotations

from typing import Any

from hypothesis import HealthCheck, settings
from hypothesis import strategies as st
from hypothesis.stateful import RuleBasedStateMachine, initialize, invariant, rule
from msgspec.structs import replace

from chairward.components import STILL
from chairward.facts import MS, Decision, Facts, Pressed, SourceLimits, State, Wish
from chairward.messages import Button, Command, Way
from chairward.reflex import reflex
from chairward.testing import laws
from chairward.testing.ride import AHEAD_AND_SIDES, FRONT, PANEL, START_NS, VOICE, chair_limits, healthy, readings

SONAR, TILT = "rear/sonar", "body/tilt"
LIMITS = chair_limits(
    sensors={
        FRONT: SourceLimits(freshness_ns=200 * MS, covers=AHEAD_AND_SIDES),
        SONAR: SourceLimits(freshness_ns=100 * MS, covers=frozenset({Way.BEHIND})),
    },
    vetoers={TILT: SourceLimits(freshness_ns=300 * MS)},
    steer_deg_s=8.0,
    crawl_mm_s=80.0,
)
WAYS = st.sampled_from(["ahead_mm", "behind_mm", "left_mm", "right_mm"])
DISTANCE = st.sampled_from([None, 0, 250, 251, 600, 601, 750, 751, 800, 1_200, 4_000])
MOTION_WORDS = st.sampled_from([Command.FRONT, Command.BACK, Command.LEFT, Command.RIGHT, Command.REVERSE])


class AnyDrive(RuleBasedStateMachine):
    """A chair whose world changes step by step; after each change it decides a few times, under the eye of all laws."""

    @initialize()
    def switch_on(self) -> None:
        self.now_ns = START_NS
        self.state = State()
        self.world: dict[str, dict[str, Any]] = {FRONT: {}, SONAR: {}}
        self.silent_since: dict[str, int] = {}
        self.tilted = False
        self.controller: dict[str, Any] = {}
        self.armed = False
        self.asked = False
        self.decisions: list[Decision] = []

    def facts(self, **now: Any) -> Facts:
        facts = healthy(LIMITS, self.now_ns, **now)
        ranges = {name: readings(self.silent_since.get(name, self.now_ns), **said) for name, said in self.world.items()}
        alive = {
            name: replace(beat, captured_ns=self.silent_since.get(name, self.now_ns) - 50 * MS)
            for name, beat in facts.alive.items()
        }
        vetoes = {name: replace(said, stop=self.tilted) for name, said in facts.vetoes.items()}
        drive = replace(facts.drive, armed=self.armed, **self.controller)
        return replace(facts, ranges=ranges, alive=alive, vetoes=vetoes, drive=drive)

    def decide(self, times: int = 3, dt_ms: int = 20, **now: Any) -> None:
        for nth in range(times):
            self.now_ns += dt_ms * MS
            facts = self.facts(**(now if nth == 0 else {}))
            heard = any(wish.command is not Command.STOP for wish in facts.heard)
            self.asked = self.asked or (heard and not self.state.latch)
            stopped = reflex(self.state, facts, LIMITS)
            self.state, decision = laws.judge(self.state, facts, LIMITS)
            assert decision.motion == STILL or not stopped, "what the reflex stops the decision moves"
            assert decision.motion == STILL or self.asked, "it moves though nobody has asked since the last stop"
            self.asked = self.asked and self.state.wish is not None
            self.armed = (self.armed or decision.arm) and not decision.disarm
            self.decisions.append(decision)

    @rule(times=st.integers(1, 30), dt_ms=st.sampled_from([1, 20, 20, 99]))
    def time_passes(self, times: int, dt_ms: int) -> None:
        self.decide(times, dt_ms)

    @rule(command=MOTION_WORDS | st.sampled_from(Command), held=st.booleans())
    def somebody_says(self, command: Command, held: bool) -> None:
        wish = Wish(source=PANEL if held else VOICE, seq=1, at_ns=self.now_ns, command=command, held=held)
        self.decide(heard=(wish,))

    @rule(forward=st.sampled_from([-1.0, 0.0, 0.5, 1.0]), left=st.sampled_from([-1.0, 0.0, 0.3]))
    def somebody_pushes_the_stick(self, forward: float, left: float) -> None:
        wish = Wish(source=PANEL, seq=1, at_ns=self.now_ns, command=Command.FRONT, held=True, stick=(forward, left))
        self.decide(heard=(wish,))

    @rule(button=st.sampled_from(Button))
    def somebody_presses(self, button: Button) -> None:
        self.decide(pressed=(Pressed(source=PANEL, button=button, at_ns=self.now_ns),))

    @rule()
    def somebody_makes_it_ready(self) -> None:
        for button in (Button.RESET, Button.ARM):
            self.somebody_presses(button)

    @rule(source=st.sampled_from([FRONT, SONAR]), way=WAYS, distance=DISTANCE)
    def something_is_there(self, source: str, way: str, distance: int | None) -> None:
        self.world[source][way] = distance
        self.decide()

    @rule(source=st.sampled_from([FRONT, SONAR]), can_see=st.booleans(), closing=st.sampled_from([0, 300]))
    def a_sensor_doubts(self, source: str, can_see: bool, closing: int) -> None:
        self.world[source] |= {"can_see": can_see, "closing_mm_s": closing}
        self.decide()

    @rule()
    def all_is_well_again(self) -> None:
        self.world = {FRONT: {}, SONAR: {}}
        self.silent_since, self.tilted, self.controller = {}, False, {}
        self.decide()

    @rule(source=st.sampled_from([FRONT, SONAR, VOICE, PANEL]))
    def a_source_falls_silent(self, source: str) -> None:
        self.silent_since.setdefault(source, self.now_ns)
        self.decide(4)

    @rule(change=st.sampled_from([{"linked": False}, {"fault": "hot"}, {"charging": True}, {"stopped_by_user": True}]))
    def the_controller_has_trouble(self, change: dict[str, Any]) -> None:
        self.controller = change
        self.decide()

    @rule(tilted=st.booleans())
    def it_tilts(self, tilted: bool) -> None:
        self.tilted = tilted
        self.decide()

    @rule(gap_ms=st.sampled_from([100, 101, 5_000]))
    def the_guard_sleeps(self, gap_ms: int) -> None:
        self.now_ns += gap_ms * MS
        self.decide(gap_ns=gap_ms * MS)

    @invariant()
    def a_latched_chair_stands_and_says_why(self) -> None:
        if self.state.latch:
            assert self.state.output == STILL
            assert self.decisions == [] or self.decisions[-1].latch == self.state.latch


AnyDrive.TestCase.settings = settings(
    max_examples=100, stateful_step_count=30, deadline=None, suppress_health_check=list(HealthCheck)
)
TestAnyDrive = AnyDrive.TestCase


def test_the_machine_is_not_one_that_never_moves() -> None:
    drive = AnyDrive()
    drive.switch_on()
    drive.somebody_makes_it_ready()
    drive.somebody_says(Command.FRONT, held=False)
    drive.time_passes(30, 20)
    assert drive.state.output.drive_mm_s > 100.0
    drive.something_is_there(FRONT, "ahead_mm", 600)
    assert drive.state.output == STILL
    drive.all_is_well_again()
    drive.time_passes(30, 20)
    assert drive.state.output == STILL, "only a new word moves it again"

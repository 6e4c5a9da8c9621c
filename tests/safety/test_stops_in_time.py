"""The chair, its brakes and its delays, without pictures: how near does it come? (rules 2 and 3, closed loop)"""

from __future__ import annotations

from collections import deque
from collections.abc import Callable
from dataclasses import dataclass, field

import pytest
from msgspec.structs import replace

from chairward.arbiter import decide
from chairward.envelope import Caps
from chairward.facts import MS, Decision, Limits, S, SourceLimits, State, Wish
from chairward.messages import Command, RangeReading, Way
from chairward.testing.ride import FRONT, PANEL, START_NS, TICK_NS, VOICE, chair_limits, healthy

STEP_NS = 5 * MS
FLOOR_MM = 450.0
"""The footprint may never come nearer than this to what the chair drives at (issue "The chair drives")."""

REST_MM = 550.0
"""What is left of stop_mm = 600 after the last creep (60 mm/s) and the last picture."""


@dataclass(kw_only=True)
class Track:
    """A chair on a straight line towards something, in steps of 5 ms.

    limits: what the arbiter knows. sensing_ns: light to reading. acting_ns: decision to torque. fps: of the camera.
    gap_at: distance to the thing, mm, as a function of the chair's way and the time in s.
    """

    limits: Limits
    sensing_ns: int
    acting_ns: int
    fps: float
    gap_at: Callable[[float, float], float]
    closing_mm_s: int = 0
    reports_speed: bool = True
    speed: float = 0.0
    way: float = 0.0
    now_ns: int = START_NS
    gaps: list[float] = field(default_factory=list)
    decisions: list[Decision] = field(default_factory=list)

    def run(self, seconds: float) -> None:
        """Say "front" and let it go; ends when the chair has stopped for good."""
        state = State(latch="", armed=True)
        window: deque[RangeReading] = deque(maxlen=3)
        in_flight: deque[tuple[int, RangeReading]] = deque()
        commands: deque[tuple[int, float]] = deque()
        command, photo_ns, tick_ns, said = 0.0, self.now_ns, self.now_ns, False
        end_ns = self.now_ns + int(seconds * S)
        while self.now_ns < end_ns:
            self.now_ns += STEP_NS
            gap = self.gap_at(self.way, (self.now_ns - START_NS) / S)
            self.gaps.append(gap)
            if self.now_ns >= photo_ns:
                photo_ns += int(S / self.fps)
                mm = max(0, min(5_000, int(gap)))
                reading = RangeReading(
                    seq=self.now_ns, captured_ns=self.now_ns, can_see=True, ahead_mm=mm, closing_mm_s=self.closing_mm_s
                )
                in_flight.append((self.now_ns + self.sensing_ns, reading))
            while in_flight and in_flight[0][0] <= self.now_ns:
                window.append(in_flight.popleft()[1])
            if self.now_ns >= tick_ns and len(window) == 3:
                tick_ns += TICK_NS
                facts = healthy(self.limits, self.now_ns, ranges={FRONT: tuple(window)})
                if self.reports_speed:
                    facts = replace(facts, drive=replace(facts.drive, speed_mm_s=self.speed))
                if not said:
                    wish = Wish(source=VOICE, seq=1, at_ns=self.now_ns, command=Command.FRONT)
                    facts, said = replace(facts, heard=(wish,)), True
                state, decision = decide(state, facts, self.limits)
                self.decisions.append(decision)
                commands.append((self.now_ns + self.acting_ns, decision.motion.drive_mm_s))
            while commands and commands[0][0] <= self.now_ns:
                command = commands.popleft()[1]
            slowest = max(command, self.speed - self.limits.decel_mm_s2 * STEP_NS / S)
            self.speed = command if command >= self.speed else slowest
            self.way += self.speed * STEP_NS / S
            if said and state.wish is None and self.speed == 0.0:
                return

    @property
    def stopped(self) -> bool:
        return self.speed == 0.0 and any(decision.protective_stop for decision in self.decisions)


def limits_for(speed: float, fps: float) -> Limits:
    """A chair of that top speed, whose freshness limit fits its camera, and its proven reaction."""
    freshness_ns = int(3 * S / fps)
    need = SourceLimits(freshness_ns=freshness_ns, covers=frozenset({Way.AHEAD, Way.LEFT, Way.RIGHT}))
    return chair_limits(
        sensors={FRONT: need},
        caps=Caps(speed, 150.0, 30.0, 30.0),
        forward_mm_s=speed,
        lease_s=60.0,
        reaction_s=0.45 if fps > 20 else 0.55,
        near_loss_mm=800,
    )


def delays(limits: Limits, fps: float) -> tuple[int, int]:
    """Sensing and acting so that, with a frame's and a tick's waiting, all of the proven reaction is used up."""
    left = int(limits.reaction_s * S) - int(S / fps) - TICK_NS
    sensing = min(left // 2, limits.sensors[FRONT].freshness_ns - int(S / fps) - TICK_NS)
    return sensing, left - sensing


@pytest.mark.parametrize("fps", [15.0, 30.0])
@pytest.mark.parametrize("speed", [100.0, 250.0, 400.0, 500.0, 700.0, 1_000.0, 1_250.0])
@pytest.mark.parametrize("reports_speed", [True, False])
def test_towards_a_wall_it_comes_to_rest_just_before_stop_mm_in_bounded_time(
    fps: float, speed: float, reports_speed: bool
) -> None:
    limits = limits_for(speed, fps)
    sensing, acting = delays(limits, fps)
    track = Track(
        limits=limits,
        sensing_ns=sensing,
        acting_ns=acting,
        fps=fps,
        gap_at=lambda way, _: 4_000.0 - way,
        reports_speed=reports_speed,
    )
    track.run(60.0)
    assert track.stopped, "the stop is declared"
    assert max(decision.motion.drive_mm_s for decision in track.decisions) > 0.9 * min(speed, 900.0)
    assert REST_MM <= track.gaps[-1] <= 605.0
    drive_s = 3_400.0 / min(speed, limits.avoid_mm_s)
    assert (track.now_ns - START_NS) / S < drive_s + 10.0, "it does not creep for ever"


@pytest.mark.parametrize("fps", [15.0, 30.0])
@pytest.mark.parametrize("speed", [250.0, 500.0, 1_000.0])
@pytest.mark.parametrize("walking", [300, 800, 1_400])
def test_somebody_walking_at_the_chair_meets_it_at_rest(fps: float, speed: float, walking: int) -> None:
    limits = limits_for(speed, fps)
    sensing, acting = delays(limits, fps)
    track = Track(
        limits=limits,
        sensing_ns=sensing,
        acting_ns=acting,
        fps=fps,
        gap_at=lambda way, t: 9_000.0 - way - walking * t,
        closing_mm_s=walking,
    )
    track.run(60.0)
    assert track.speed == 0.0
    assert track.gaps[-1] >= FLOOR_MM


@pytest.mark.parametrize("fps", [15.0, 30.0])
@pytest.mark.parametrize("speed", [250.0, 500.0, 1_000.0])
def test_something_that_steps_in_at_its_stopping_distance_is_not_reached(fps: float, speed: float) -> None:
    limits = limits_for(speed, fps)
    sensing, acting = delays(limits, fps)
    room = speed * limits.reaction_s + speed**2 / (2 * limits.decel_mm_s2)
    steps_in_at = 3_000.0

    def gap(way: float, _: float) -> float:
        return 9_000.0 if way < steps_in_at else steps_in_at + room + 600.0 - way

    track = Track(limits=limits, sensing_ns=sensing, acting_ns=acting, fps=fps, gap_at=gap)
    track.run(60.0)
    assert track.stopped
    assert min(track.gaps) >= REST_MM


@pytest.mark.parametrize("died_after_s", [0.5, 1.0, 1.7, 2.3, 3.1, 4.4])
def test_a_camera_that_dies_on_the_way_to_the_wall_does_not_let_the_chair_come_nearer(died_after_s: float) -> None:
    """The worst of rule 3's proof: the last reading is as old as it may be when silence stops the chair."""
    limits = limits_for(700.0, 30.0)
    track = Track(
        limits=limits,
        sensing_ns=50 * MS,
        acting_ns=limits_acting_ns(limits),
        fps=30.0,
        gap_at=lambda way, _: 3_000.0 - way,
    )
    seconds = died_after_s

    def until_it_died(way: float, t: float) -> float:
        if t >= seconds:
            track.fps = 1e-3
        return 3_000.0 - way

    track.gap_at = until_it_died
    track.run(30.0)
    assert track.speed == 0.0
    assert min(track.gaps) >= REST_MM


def limits_acting_ns(limits: Limits) -> int:
    """What the proven reaction leaves for acting after a reading as old as its limit, and a tick."""
    return int(limits.reaction_s * S) - limits.sensors[FRONT].freshness_ns - 2 * TICK_NS


def test_the_stop_device_and_the_recognizer_of_this_track_are_alive() -> None:
    """The track would prove nothing on a chair that stands for another reason."""
    limits = limits_for(500.0, 30.0)
    assert set(healthy(limits).alive) == {VOICE, PANEL}

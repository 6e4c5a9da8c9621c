"""The world process: pins in, pose out. Moves the chair's body, the person who crosses and the person who speaks."""

from __future__ import annotations

import json
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

from chairward.components import Context, Footprint
from chairward.shared_state import SharedState
from chairward_simulator import speech
from chairward_simulator.body import NO_PINS, Body, BodyLaw, Pins, pins_from
from chairward_simulator.camera import CAMERAS_ON
from chairward_simulator.home import HOME_FILE, Home, Obstacle, load, person_obstacle
from chairward_simulator.nearness import FAR_MM
from chairward_simulator.people import Walker
from chairward_simulator.rider import Rider
from chairward_simulator.settings import HomeSettings
from chairward_simulator.speaker import View
from chairward_simulator.truth import Truth, of_home

WORLD_NAMES = (
    "time_ns", "x_mm", "y_mm", "heading_deg", "speed_mm_s", "turn_deg_s",
    "utterance_id", "utterance_ns", "utterance_word", "arm", "reset",
    "person_here", "person_x_mm", "person_y_mm", "person_facing_deg", "person_walked_mm", "done",
)  # fmt: skip
"""Values in run_dir/world. utterance_word: index into speech.WORDS. Times are CLOCK_MONOTONIC ns."""

STEP_S = 0.005
LOOK_EVERY = 8
BUMP_EVERY = 4
"""Steps between two looks of the truth (25 a second), and between two tests for contact and ticks of the rider (50)."""
LOST_POWER_NS = 500_000_000
"""Pins older than this: their controller is gone, and with it the power that holds the spring-applied brake open."""


@dataclass(slots=True)
class World:
    """Everything that moves in the home; `step` by real or simulated seconds. No I/O."""

    home: Home
    footprint: Footprint
    law: BodyLaw = field(default_factory=BodyLaw)
    speaks: bool = True
    duration_s: Callable[[str, int], float] = speech.duration_s
    wheels_off: bool = False
    now_s: float = 0.0
    body: Body = field(init=False)
    walker: Walker | None = field(init=False)
    rider: Rider = field(init=False)
    truth: Truth = field(init=False)
    said: str = ""
    _free: Body = field(init=False)
    _count: int = 0

    def __post_init__(self) -> None:
        start = self.home.start
        self.body = Body(x_mm=start.x_mm, y_mm=start.y_mm, heading_deg=start.heading_deg)
        self._free = self.body
        self.walker = Walker.at_start(self.home.person) if self.home.person else None
        self.truth = of_home(self.home, self.footprint)
        self.rider = Rider(
            self.duration_s, home=self.home, rear_mm=self.footprint.rear_mm, front_mm=self.footprint.front_mm
        )

    def people(self) -> Sequence[Obstacle]:
        """Those who walk about, as obstacles."""
        if self.walker is None:
            return ()
        return (person_obstacle(self.walker.x_mm, self.walker.y_mm, moving=self.walker.moving),)

    def step(self, pins: Pins, dt_s: float = STEP_S) -> str | None:
        """One step; the word the person begins to say now, if any."""
        self.now_s += dt_s
        people = self.people()
        moved = self.body.step(pins, dt_s, self.law)
        if self.wheels_off:
            moved = replace(moved, x_mm=self.body.x_mm, y_mm=self.body.y_mm, heading_deg=self.body.heading_deg)
        if self._count % BUMP_EVERY == 0:
            bump = self.truth.touches(moved, people)
            self.truth.bumped(bump, moved)
            if bump:
                moved = self._free.halted()
            else:
                self._free = moved
        self.body = moved
        if self.walker is not None:
            room = self.truth.ahead_mm if self.truth.ahead_of == "person" else FAR_MM
            self.walker.step(dt_s, self.body.x_mm, self.body.speed_mm_s, room)
        if self._count % LOOK_EVERY == 0:
            self.truth.look(self.now_s, self.body, people)
        self._count += 1
        if not self.speaks or self._count % BUMP_EVERY:
            return None
        word = self.rider.tick(self._view())
        if word is not None:
            self.truth.heard(word)
            self.said = word
        return word

    def _view(self) -> View:
        b, t = self.body, self.truth
        return View(
            now_s=self.now_s,
            x_mm=b.x_mm,
            y_mm=b.y_mm,
            heading_deg=b.heading_deg,
            speed_mm_s=b.speed_mm_s,
            turn_deg_s=b.turn_deg_s,
            ahead_mm=t.ahead_mm,
            ahead_name=t.ahead_of,
        )

    def report(self) -> dict[str, Any]:
        """The run as it really was."""
        r = self.rider
        return {
            "home": self.home.name,
            "seconds": round(self.now_s, 2),
            **self.truth.report(),
            "words_said": dict(r.said),
            "tour_legs_done": r.legs_done,
            "tour_legs": len(self.home.tour),
            "tour_done": r.finished,
            "events": list(r.events),
        }


class SimHome:
    """Companion `sim_home`: runs a World in real time between run_dir/pins and run_dir/world."""

    def __init__(self, settings: HomeSettings, context: Context) -> None:
        self._settings, self._context = settings, context

    def run(self, ready: Callable[[], None], stopping: Callable[[], bool]) -> None:
        """Until stopping(); writes run_dir/report-world.json at the end. Raises HomeError for a bad home file."""
        s = self._settings
        path = (self._context.chair_dir / s.home) if s.home else HOME_FILE
        usual = BodyLaw()
        law = BodyLaw(
            drive=replace(usual.drive, full=s.full_speed_mm_s),
            steer=replace(usual.steer, full=s.full_turn_deg_s),
            slope_percent=s.slope_percent,
        )
        world = World(load(path), self._context.footprint, law, s.speaks, wheels_off=s.wheels_off)
        for word in speech.WORDS:  # read all recordings before time starts
            for n in range(8):
                speech.duration_s(word, n)
        shared = SharedState.create(self._context.run_dir / "world", WORLD_NAMES)
        pins_file = self._context.run_dir / "pins"
        _publish(shared, world, time.monotonic_ns(), "")
        ready()
        try:
            cameras_on = self._context.run_dir / CAMERAS_ON
            _real_time(world, shared, pins_file, stopping, lambda: world.now_s > s.waits_s or cameras_on.exists())
        finally:
            report = self._context.run_dir / "report-world.json"
            report.write_text(json.dumps(world.report(), indent=1))
            shared.close()


def _real_time(
    world: World,
    shared: SharedState,
    pins_file: Path,
    stopping: Callable[[], bool],
    begins: Callable[[], bool],
) -> None:
    """Step the world along the clock; a late wake-up is caught up in steps, half a second at most.

    begins: asked four times a second until it is true; then the person begins the tour.
    """
    speaks, world.speaks = world.speaks, False
    pins_state: SharedState | None = None
    done_ns = asked_ns = time.monotonic_ns()
    try:
        while not stopping():
            due_ns = done_ns + int(STEP_S * 1e9)
            if (wait_ns := due_ns - time.monotonic_ns()) > 0:
                time.sleep(wait_ns / 1e9)
            now_ns = time.monotonic_ns()
            if pins_state is None and pins_file.exists():
                pins_state = SharedState.attach(pins_file)
            if speaks and not world.speaks and now_ns - asked_ns > 250_000_000:
                world.speaks, asked_ns = begins(), now_ns
            pins = _pins(pins_state, now_ns)
            steps = max(1, min(100, round((now_ns - done_ns) / (STEP_S * 1e9))))
            word = ""
            for _ in range(steps):
                word = world.step(pins) or word
            done_ns = max(done_ns + int(steps * STEP_S * 1e9), now_ns - 500_000_000)
            _publish(shared, world, now_ns, word)
    finally:
        if pins_state is not None:
            pins_state.close()


def _pins(state: SharedState | None, now_ns: int) -> Pins:
    """The controller's pins; without a living controller no power: bridges off, spring-applied brake on."""
    if state is None:
        return NO_PINS
    values = state.read()
    if now_ns - values["time_ns"] > LOST_POWER_NS:
        return Pins(brake=True)
    return pins_from(values)


def _publish(shared: SharedState, world: World, now_ns: int, word: str) -> None:
    values = {
        "time_ns": now_ns,
        "x_mm": world.body.x_mm,
        "y_mm": world.body.y_mm,
        "heading_deg": world.body.heading_deg,
        "speed_mm_s": world.body.speed_mm_s,
        "turn_deg_s": world.body.turn_deg_s,
        "arm": world.rider.arm_presses,
        "reset": world.rider.reset_presses,
        "done": world.rider.finished,
    }
    if word:
        values |= {
            "utterance_id": world.rider.utterances,
            "utterance_ns": now_ns,
            "utterance_word": speech.WORDS.index(word),
        }
    if (walker := world.walker) is not None:
        values |= {
            "person_here": 1,
            "person_x_mm": walker.x_mm,
            "person_y_mm": walker.y_mm,
            "person_facing_deg": walker.facing_deg,
            "person_walked_mm": walker.walked_mm,
        }
    shared.write(**values)

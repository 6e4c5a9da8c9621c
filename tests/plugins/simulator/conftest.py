"""A tiny chair for closed loops without the real guard: words become pins after a delay, and it stops at 600 mm."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from random import Random

import pytest

from chairward.components import Footprint
from chairward_simulator.body import Bridge, Pins
from chairward_simulator.home import Home, load
from chairward_simulator.world import STEP_S, World

FOOTPRINT = Footprint(front_mm=450.0, rear_mm=450.0, half_width_mm=320.0)
CONFUSIONS = ("front", "back", "left", "right", "reverse", "stop", "")


@dataclass
class TinyChair:
    """Ideal ears and eyes; misheard: share of words taken for another one (or not heard at all)."""

    world: World
    answer_s: float = 0.35
    misheard: float = 0.0
    rng: Random = field(default_factory=lambda: Random(1))
    step_gain: float = 1.0
    waiting: list[tuple[float, str]] = field(default_factory=list)
    doing: str = ""
    left: float = 0.0
    until_s: float = 0.0
    drive_mm_s: float = 0.0
    turn_deg_s: float = 0.0
    armed: bool = False

    def hear(self, word: str) -> None:
        """The word is understood some time after it has been said."""
        if self.rng.random() < self.misheard:
            word = self.rng.choice(CONFUSIONS)
        said_s = self.world.duration_s(word or "stop", self.world.rider.utterances)
        self.waiting.append((self.world.now_s + said_s + self.answer_s, word))

    def pins(self) -> Pins:
        """One step of the tiny guard: ramps 500/600 mm/s^2, slows so that it stops 600 mm ahead."""
        world, body = self.world, self.world.body
        self.armed = self.armed or world.rider.arm_presses > 0
        while self.waiting and self.waiting[0][0] <= world.now_s:
            self._begin(self.waiting.pop(0)[1])
        drive, turn = 0.0, 0.0
        if self.doing == "front":
            room = world.truth.ahead_mm - 600.0
            drive = min(500.0, 600.0 * ((0.2025 + 2.0 * max(room, 0.0) / 600.0) ** 0.5 - 0.45))
            if room <= 0.0 or world.now_s > self.until_s:
                self.doing, drive = "", 0.0
        elif self.doing in ("back", "reverse"):
            drive, self.left = -150.0, self.left - abs(body.speed_mm_s) * STEP_S
        elif self.doing in ("left", "right"):
            turn = 20.0 if self.doing == "left" else -20.0
            self.left -= abs(body.turn_deg_s) * STEP_S
        if self.doing not in ("front", "") and self.left <= 0.0:
            self.doing, drive, turn = "", 0.0, 0.0
        rise, fall = 500.0 * STEP_S, 600.0 * STEP_S
        limit = rise if abs(drive) > abs(self.drive_mm_s) else fall
        self.drive_mm_s += max(-limit, min(limit, drive - self.drive_mm_s))
        self.turn_deg_s = turn if not turn else self.turn_deg_s + max(-0.3, min(0.3, turn - self.turn_deg_s))
        return Pins(drive=_bridge(self.drive_mm_s / 700.0), steer=_bridge(self.turn_deg_s / 60.0))

    def _begin(self, word: str) -> None:
        if not word or not self.armed:
            return
        self.doing = "" if word == "stop" else word
        self.left = (300.0 if word in ("back", "reverse") else 15.0) * self.step_gain
        self.until_s = self.world.now_s + 8.0

    def run(self, seconds: float) -> World:
        """Until the tour is over or so many simulated seconds have passed."""
        while self.world.now_s < seconds and not self.world.rider.finished:
            word = self.world.step(self.pins())
            if word is not None:
                self.hear(word)
        return self.world


def _bridge(share: float) -> Bridge:
    if abs(share) < 1e-6:
        return Bridge(duty=1.0)
    return Bridge(duty=abs(share), in1=share > 0, in2=share < 0)


@pytest.fixture(scope="session")
def home() -> Home:
    return load()


@pytest.fixture
def make_chair(home: Home) -> Callable[..., TinyChair]:
    def make(**keys: object) -> TinyChair:
        return TinyChair(World(home, FOOTPRINT), **keys)  # type: ignore[arg-type]

    return make


@pytest.fixture(scope="session")
def footprint() -> Footprint:
    return FOOTPRINT

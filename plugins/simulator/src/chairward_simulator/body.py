"""The chair's body behind the controller's pins: two motors with inertia, friction, brakes and a slope."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from math import cos, exp, radians, sin

from chairward.stopping import G_MM_S2


@dataclass(frozen=True, slots=True, kw_only=True)
class Bridge:
    """One half-H bridge's inputs: duty 0..1 of its enable pin, and its two direction inputs."""

    duty: float = 0.0
    in1: bool = False
    in2: bool = False


@dataclass(frozen=True, slots=True, kw_only=True)
class Pins:
    """All pins that act on the body; `brake` is the parking brake (applied when set)."""

    drive: Bridge = Bridge()
    steer: Bridge = Bridge()
    brake: bool = False


NO_PINS = Pins()


def pins_from(values: Mapping[str, float]) -> Pins:
    """Pins from the values of `run_dir/pins`. Raises KeyError when one is missing."""

    def bridge(name: str) -> Bridge:
        duty = min(1.0, max(0.0, values[f"{name}_duty"]))
        return Bridge(duty=duty, in1=values[f"{name}_in1"] > 0.5, in2=values[f"{name}_in2"] > 0.5)

    return Pins(drive=bridge("drive"), steer=bridge("steer"), brake=values["brake"] > 0.5)


@dataclass(frozen=True, slots=True)
class Motor:
    """One motor with what it moves, in units u (mm or degrees). full: u/s at duty 1.

    coast: u/s^2 that friction takes from what rolls with its bridge off. brake: u/s^2 of the parking brake.
    tau_s: time constant under power; short_tau_s: in short-brake.
    """

    full: float
    coast: float
    brake: float
    tau_s: float = 0.10
    short_tau_s: float = 0.12

    def step(self, v: float, bridge: Bridge, *, braked: bool, outer: float, dt_s: float) -> float:
        """Speed after dt_s; outer: acceleration from the slope."""
        if braked:
            return _towards_zero(v, self.brake * dt_s)
        if bridge.duty <= 0.0:  # off: rolls on; a slope steeper than friction takes it along
            return 0.0 if v == 0.0 and abs(outer) <= self.coast else _towards_zero(v + outer * dt_s, self.coast * dt_s)
        if bridge.in1 == bridge.in2:  # shorted: decays fast, creeps down a slope
            return (v + outer * dt_s) * exp(-dt_s * bridge.duty / self.short_tau_s)
        target = self.full * bridge.duty * (1.0 if bridge.in1 else -1.0) + outer * self.tau_s
        return target + (v - target) * exp(-dt_s / self.tau_s)


@dataclass(frozen=True, slots=True, kw_only=True)
class BodyLaw:
    """What the body is like. slope_percent: rises towards heading 0; the parking brake holds on it."""

    drive: Motor = Motor(full=700.0, coast=200.0, brake=3000.0)
    steer: Motor = Motor(full=60.0, coast=60.0, brake=600.0)
    slope_percent: float = 0.0


@dataclass(frozen=True, slots=True, kw_only=True)
class Body:
    """Pose of the middle of the axle in the home, and motion. Every step gives a new one."""

    x_mm: float
    y_mm: float
    heading_deg: float
    speed_mm_s: float = 0.0
    turn_deg_s: float = 0.0

    def step(self, pins: Pins, dt_s: float, law: BodyLaw) -> Body:
        """The body dt_s later (0 < dt_s <= 0.1 s)."""
        downhill = -G_MM_S2 * law.slope_percent / 100.0 * cos(radians(self.heading_deg))
        speed = law.drive.step(self.speed_mm_s, pins.drive, braked=pins.brake, outer=downhill, dt_s=dt_s)
        turn = law.steer.step(self.turn_deg_s, pins.steer, braked=pins.brake, outer=0.0, dt_s=dt_s)
        middle = radians(self.heading_deg + 0.5 * turn * dt_s)
        way = 0.5 * (self.speed_mm_s + speed) * dt_s
        return replace(
            self,
            x_mm=self.x_mm + way * cos(middle),
            y_mm=self.y_mm + way * sin(middle),
            heading_deg=(self.heading_deg + 0.5 * (self.turn_deg_s + turn) * dt_s + 180.0) % 360.0 - 180.0,
            speed_mm_s=speed,
            turn_deg_s=turn,
        )

    def halted(self) -> Body:
        """Bumped into something: same place, no motion."""
        return replace(self, speed_mm_s=0.0, turn_deg_s=0.0)


def _towards_zero(v: float, by: float) -> float:
    return max(0.0, v - by) if v > 0.0 else min(0.0, v + by)

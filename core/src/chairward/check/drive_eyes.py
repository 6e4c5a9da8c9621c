"""Motion seen by instruments: a simulated controller's pins, or the speed that a controller with encoders reports."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Protocol

from chairward.check.drive_bench import BenchError, DriveBench
from chairward.components import STILL, Motion

STEADY_S, SETTLE_S = 0.3, 4.0
"""A speed is steady when it has not changed for so long; it must be within so long."""
NOTHING = 0.05
"""Less than this share of full speed, or of what was commanded, is no motion."""
FALLEN = 0.9
"""A speed has begun to fall below this share of what it was."""
STOP_S = 4.0
TRIES = 3


class Eyes(Protocol):
    """Somebody or something that sees the wheels. Each method drives the bench itself and leaves it standing."""

    method: str
    """How it is seen, as the chair file tells it."""
    silences: int
    """How often the silence is measured; the longest counts."""

    def ways(self, bench: DriveBench, motion: Motion) -> tuple[int, int]:
        """Signs of what the wheels do when `motion` is commanded: forward (+), left (+). Raises BenchError."""

    def speed(self, bench: DriveBench, motion: Motion) -> Motion | None:
        """How fast they really go then; None where this cannot be seen. Raises BenchError."""

    def stop_s(self, bench: DriveBench, motion: Motion, *, hard_stop: bool) -> float | None:
        """From the call until they stand; None where it cannot be timed. Raises BenchError when they do not stop."""

    def silence_ms(self, bench: DriveBench, motion: Motion, longest_s: float) -> float:
        """From the last command until the speed begins to fall by itself. Raises BenchError when it does not stop."""


class Instruments:
    """Eyes that look every 2 ms.

    look: the motion now, in the chair file's own scale; full: the largest.
    scale: how fast the wheels really go, None when that is not known.
    """

    silences = 3

    def __init__(
        self, method: str, full: Motion, look: Callable[[], Motion], scale: Callable[[], Motion] | None
    ) -> None:
        self.method, self._full, self._look, self._scale = method, full, look, scale

    def ways(self, bench: DriveBench, motion: Motion) -> tuple[int, int]:
        """From the steady speed."""
        self._steady(bench, motion)
        seen = self._look()
        self._stand(bench)
        return _sign(seen.drive_mm_s, self._full.drive_mm_s), _sign(seen.turn_deg_s, self._full.turn_deg_s)

    def speed(self, bench: DriveBench, motion: Motion) -> Motion | None:
        """The steady speed; that of the ground where it is known."""
        if self._scale is None:
            return None
        self._steady(bench, motion)
        bench.hold(motion, STEADY_S)  # wheels follow their motor
        seen = self._scale()
        self._stand(bench)
        return seen

    def stop_s(self, bench: DriveBench, motion: Motion, *, hard_stop: bool) -> float | None:
        """From the call until nothing moves."""
        self._steady(bench, motion)
        start = bench.clock.now_ns()
        if not bench.hold(STILL, STOP_S, lambda: self._stands(motion), hard_stop=hard_stop):
            raise BenchError(f"told to stop, the wheels still turn after {STOP_S:g} s")
        return (bench.clock.now_ns() - start) / 1e9

    def silence_ms(self, bench: DriveBench, motion: Motion, longest_s: float) -> float:
        """From the last command until the speed falls; it must then come to rest."""
        self._steady(bench, motion)
        was, last_ns = self._look(), bench.commanded_ns
        if not bench.silent(longest_s, lambda: self._part(self._look()) < FALLEN * self._part(was)):
            raise BenchError(f"nobody has spoken to the controller for {longest_s:g} s, and the wheels still turn")
        fell_ns = bench.clock.now_ns()
        if not bench.silent(STOP_S, lambda: self._stands(motion)):
            raise BenchError(f"left alone, the controller slows down, but has not stopped within {STOP_S:g} s")
        return (fell_ns - last_ns) / 1e6

    def _steady(self, bench: DriveBench, motion: Motion) -> None:
        """Drive until the speed has not changed for a while; a link that is lost meanwhile is made again."""
        for _ in range(TRIES):
            bench.arm()
            if self._reach(bench, motion) or not self._stands(motion):
                return
        why = bench.trouble or bench.status.fault or "the motors' supply, the brakes, the wiring?"
        raise BenchError(f"told to move, the wheels do not turn within {SETTLE_S:g} s: {why}")

    def _reach(self, bench: DriveBench, motion: Motion) -> bool:
        """Command it until the speed is steady, the drive disarms or the time is over."""
        before, since = STILL, bench.clock.now_ns()

        def steady() -> bool:
            nonlocal before, since
            now = self._look()
            if max(abs(now.drive_mm_s - before.drive_mm_s), abs(now.turn_deg_s - before.turn_deg_s)) > 1e-3:
                before, since = now, bench.clock.now_ns()
            long = bench.clock.now_ns() - since > STEADY_S * 1e9
            return long and (not self._stands(motion) or not bench.status.armed)

        return bench.hold(motion, SETTLE_S, steady) and bench.status.armed

    def _stand(self, bench: DriveBench) -> None:
        bench.hold(STILL, STOP_S, lambda: self._look() == STILL)

    def _stands(self, motion: Motion) -> bool:
        """Neither part is more than a little of what was commanded."""
        return self._part(self._look()) < NOTHING * self._part(motion)

    def _part(self, motion: Motion) -> float:
        """Of full speed, the larger of both parts."""
        return max(abs(motion.drive_mm_s / self._full.drive_mm_s), abs(motion.turn_deg_s / self._full.turn_deg_s))


def from_pins(read: Callable[[], Mapping[str, float]], full: Motion) -> Callable[[], Motion]:
    """`look` for run_dir/pins: share of the controller's full output, in the scale of the chair file. A brake stops."""

    def look() -> Motion:
        pins = read()
        if pins["brake"] > 0.5:
            return STILL
        drive = (pins["drive_in1"] - pins["drive_in2"]) * pins["drive_duty"]
        steer = (pins["steer_in1"] - pins["steer_in2"]) * pins["steer_duty"]
        return Motion(drive * full.drive_mm_s, steer * full.turn_deg_s)

    return look


def from_world(read: Callable[[], Mapping[str, float]]) -> Callable[[], Motion]:
    """`scale` for run_dir/world: how fast the simulated chair goes over the simulated floor."""

    def look() -> Motion:
        world = read()
        return Motion(world["speed_mm_s"], world["turn_deg_s"])

    return look


def from_reports(bench: DriveBench) -> Callable[[], Motion]:
    """`look` for a controller with encoders: the speed in its newest status. Reading asks for nothing."""

    def look() -> Motion:
        bench.read()
        if bench.status.linked and bench.status.speed_mm_s is None and bench.status.turn_deg_s is None:
            raise BenchError("this controller reports no speed: run it with --observe person")
        return Motion(bench.status.speed_mm_s or 0.0, bench.status.turn_deg_s or 0.0)

    return look


def _sign(value: float, full: float) -> int:
    """-1, 0 or 1; less than 5 % of full is nothing."""
    return (value > NOTHING * full) - (value < -NOTHING * full)

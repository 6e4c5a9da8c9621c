"""`chairward check drive`: signs, scale, stopping and stop on silence of a drive, measured wheels off the ground.

Each step is a finding; the first that fails ends the check, so that nothing is driven that could not be stopped.
"""

from __future__ import annotations

import math
from collections.abc import Generator, Mapping
from dataclasses import dataclass, field
from typing import Any

from chairward.check.drive_bench import BenchError, DriveBench
from chairward.check.drive_eyes import Eyes
from chairward.components import SILENCE_LIMIT_MS, STILL, Motion

SHARE = 0.5
"""Of full speed, at which everything is measured."""
LONGEST_SILENCE_S = 3.0
SAME_SCALE = 0.02
"""A measured full speed that differs by less is the one in the file."""
UNARMED_S, RESUME_S, SILENCE_S = 0.5, 0.5, 1.0


@dataclass(frozen=True, slots=True)
class Finding:
    """One step: what was found, in a sentence; values: keys of the drive's settings that it gives."""

    step: str
    ok: bool
    found: str
    values: Mapping[str, Any] = field(default_factory=dict)


class DriveCheck:
    """The steps in their order. settings: of the drive, as loaded; the keys decide what can be written."""

    def __init__(self, bench: DriveBench, eyes: Eyes, settings: Mapping[str, Any], decel_mm_s2: float) -> None:
        self._bench, self._eyes, self._settings, self._decel_mm_s2 = bench, eyes, settings, decel_mm_s2
        full = full_motion(settings)
        back = min(full.drive_mm_s, float(settings.get("full_backward_mm_s") or full.drive_mm_s))
        self._forward = Motion(full.drive_mm_s * SHARE, 0.0)
        self._backward = Motion(-back * SHARE, 0.0)
        self._left = Motion(0.0, full.turn_deg_s * SHARE)
        self._right = Motion(0.0, -full.turn_deg_s * SHARE)

    def run(self) -> Generator[Finding]:
        """One finding a step; the last is the first that failed. The bench is left standing."""
        steps = {
            "connect": self._connect,
            "signs": self._signs,
            "scale": self._scale,
            "controlled stop": self._controlled_stop,
            "hard stop": self._hard_stop,
            "stop on silence": self._silence,
            "after silence": self._after_silence,
        }
        try:
            for name, step in steps.items():
                try:
                    finding = step(name)
                except BenchError as error:
                    finding = Finding(name, False, str(error))
                yield finding
                if not finding.ok:
                    return
        finally:
            self._bench.leave()

    def _connect(self, step: str) -> Finding:
        """A link; and nothing moves that was not armed."""
        self._bench.connect()
        self._bench.hold(self._forward, UNARMED_S)
        if self._bench.status.armed:
            return Finding(step, False, "the controller is armed although nobody has asked for it")
        self._bench.arm()
        return Finding(step, True, "linked; armed when asked, not before")

    def _signs(self, step: str) -> Finding:
        """Each way is that way; what is mirrored is turned round, what is crossed is refused."""
        values: dict[str, Any] = {}
        for key, there, back in (("drive_sign", self._forward, self._backward), ("turn_sign", self._left, self._right)):
            seen = [self._eyes.ways(self._bench, motion) for motion in (there, back)]
            wanted = [(_sign(motion.drive_mm_s), _sign(motion.turn_deg_s)) for motion in (there, back)]
            if seen == wanted:
                sign = 1
            elif seen == [(-a, -b) for a, b in wanted]:
                sign = -1
            else:
                why = "the motors are crossed, or one of them does not turn both ways"
                return Finding(step, False, f"asked for {_told(wanted)}, seen {_told(seen)}: {why}")
            if key in self._settings:
                values[key] = sign * int(self._settings[key])
            elif sign < 0:
                return Finding(step, False, f"{_told(wanted[:1])} is {_told(seen[:1])}: exchange the motor's wires")
        changed = [key for key, value in values.items() if value != self._settings[key]]
        return Finding(step, True, f"{', '.join(changed)} turned round" if changed else "each way is that way", values)

    def _scale(self, step: str) -> Finding:
        """What full deflection really is; more than the file says would be faster than asked."""
        values: dict[str, Any] = {}
        for key, motion in self._scaled():
            seen = self._eyes.speed(self._bench, motion)
            if seen is None:
                continue
            asked, got = max(map(abs, motion)), max(map(abs, seen))
            full = float(self._settings[key]) * got / asked
            if abs(got / asked - 1.0) > SAME_SCALE:
                values[key] = round(full, 1)
            else:
                values[key] = self._settings[key]
        if not values:
            return Finding(step, True, f"not seen ({self._eyes.method}): the file's figures stand")
        return Finding(step, True, ", ".join(f"{key} = {value:g}" for key, value in values.items()), values)

    def _scaled(self) -> list[tuple[str, Motion]]:
        """The settings that are a scale, each with the motion that shows it."""
        known = {
            "full_speed_mm_s": self._forward,
            "full_forward_mm_s": self._forward,
            "full_backward_mm_s": self._backward,
            "full_turn_deg_s": self._left,
        }
        return [(key, motion) for key, motion in known.items() if key in self._settings]

    def _controlled_stop(self, step: str) -> Finding:
        """Not more gently than the proof of distances assumes, where it can be timed."""
        took_s = self._eyes.stop_s(self._bench, self._forward, hard_stop=False)
        if took_s is None:
            return Finding(step, True, "the wheels stop")
        decel = self._forward.drive_mm_s / took_s
        found = f"{took_s * 1000:.0f} ms from {self._forward.drive_mm_s:g} mm/s, {decel:.0f} mm/s² without load"
        if decel < self._decel_mm_s2:
            return Finding(step, False, f"{found}: less than stopping.decel_mm_s2 = {self._decel_mm_s2:g}")
        return Finding(step, True, found, {"stop_decel_mm_s2": math.floor(decel)})

    def _hard_stop(self, step: str) -> Finding:
        took_s = self._eyes.stop_s(self._bench, self._forward, hard_stop=True)
        if took_s is None:
            return Finding(step, True, "the wheels stop")
        return Finding(step, True, f"{took_s * 1000:.0f} ms", {"hard_stop_ms": math.ceil(took_s * 1000.0)})

    def _silence(self, step: str) -> Finding:
        """The longest of some; a controller that does not stop in 250 ms needs a relay."""
        took = [
            self._eyes.silence_ms(self._bench, self._forward, LONGEST_SILENCE_S) for _ in range(self._eyes.silences)
        ]
        longest_ms = math.ceil(max(took))
        found = f"{longest_ms} ms after the last command ({self._eyes.method})"
        if longest_ms > SILENCE_LIMIT_MS:
            wanted = f"at most {SILENCE_LIMIT_MS} ms are allowed: name a watchdog_relay in the motor supply"
            return Finding(step, False, f"{found}; {wanted}")
        return Finding(step, True, found, {"silence_stop_ms": longest_ms})

    def _after_silence(self, step: str) -> Finding:
        """Commands alone do not move it again."""
        self._bench.arm()
        self._bench.hold(self._forward, RESUME_S)
        self._bench.silent(SILENCE_S)
        self._bench.hold(self._forward, RESUME_S)
        if self._bench.status.armed:
            return Finding(step, False, "it moves again without having been armed")
        self._bench.hold(STILL, RESUME_S)
        return Finding(step, True, "moves again only when armed")


def full_motion(settings: Mapping[str, Any]) -> Motion:
    """The largest motion that the drive takes, from the settings that every drive with a scale has."""
    drive = settings.get("full_speed_mm_s") or settings.get("full_forward_mm_s")
    turn = settings.get("full_turn_deg_s")
    if not drive or not turn:
        raise BenchError("this drive has no scale (full_speed_mm_s or full_forward_mm_s, full_turn_deg_s) to measure")
    return Motion(float(drive), float(turn))


def _sign(value: float) -> int:
    return (value > 0) - (value < 0)


def _told(ways: list[tuple[int, int]]) -> str:
    """Ways in words."""
    drive, turn = {1: "forward", -1: "backward"}, {1: "left", -1: "right"}
    return ", ".join(" and ".join(filter(None, (drive.get(d), turn.get(t)))) or "nothing" for d, t in ways)

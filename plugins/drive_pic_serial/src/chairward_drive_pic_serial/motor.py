"""What the firmware does to its two motors, and what the pins then say; one step a millisecond, as in drive.asm."""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

DEAD_MS = 20
"""The bridge is off so long after a motion."""
SWITCH_MS = 2
"""... and so long before and after a short-brake."""
SOFT = 10
"""Below so many hundredths a start rises at half the rate."""
PWM_STEPS = 250


class Pins(NamedTuple):
    """What the pins do. duty 0..1; in1, in2: bridge inputs (1, 0 is forward or left, equal with duty short-brakes)."""

    steer_in1: int
    steer_in2: int
    steer_duty: float
    drive_in1: int
    drive_in2: int
    drive_duty: float
    brake: int
    armed: int
    fault: int


@dataclass(slots=True)
class Motor:
    """One motor: target and applied value in hundredths, ms with the bridge off, held by the short-brake."""

    target: int = 0
    applied: int = 0
    dead: int = 0
    held: bool = True

    def step(self, *, rise: bool, fall: bool, soft: bool) -> None:
        """One tick, as `motor` in drive.asm."""
        target, applied = self.target, self.applied
        if self.dead:
            self.dead -= 1
        elif applied == 0:
            if target == 0:
                self.held = True
            elif self.held:
                self.held, self.dead = False, SWITCH_MS
            elif rise:
                self.applied = 1 if target > 0 else -1
        elif applied != target:
            sign = 1 if applied > 0 else -1
            if target * sign > applied * sign:
                if rise and (soft or abs(applied) >= SOFT):
                    self.applied += sign
            elif fall:
                self.applied -= sign
                if self.applied == 0:
                    self.dead = DEAD_MS

    def brake(self) -> None:
        """Hard stop: bridge off for a moment, then short-brake."""
        self.target = 0
        if self.applied:
            self.applied, self.held, self.dead = 0, False, SWITCH_MS

    def pins(self) -> tuple[int, int, float]:
        """in1, in2, duty."""
        if self.applied:
            steps = abs(self.applied) * 5 // 2
            return int(self.applied > 0), int(self.applied < 0), steps / PWM_STEPS
        return 0, 0, 1.0 if self.held else 0.0

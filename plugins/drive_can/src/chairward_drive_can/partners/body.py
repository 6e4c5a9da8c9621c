"""How fast a simulated chair really goes: two axes that follow their targets at a controller's rates."""

from __future__ import annotations

from dataclasses import dataclass

from chairward_drive_can.scale import ramp


@dataclass(slots=True)
class Body:
    """forward and left as fractions of full speed, -1..1; rates in fractions per second."""

    rise_per_s: float = 1.5
    fall_per_s: float = 2.5
    forward: float = 0.0
    left: float = 0.0
    target_forward: float = 0.0
    target_left: float = 0.0

    def step(self, dt_s: float) -> None:
        """Let dt_s pass."""
        self.forward = ramp(self.forward, self.target_forward, self.rise_per_s, self.fall_per_s, dt_s)
        self.left = ramp(self.left, self.target_left, self.rise_per_s, self.fall_per_s, dt_s)

    def aim(self, forward: float, left: float) -> None:
        """New targets."""
        self.target_forward, self.target_left = forward, left

    @property
    def standing(self) -> bool:
        """Nothing turns."""
        return self.forward == 0.0 and self.left == 0.0

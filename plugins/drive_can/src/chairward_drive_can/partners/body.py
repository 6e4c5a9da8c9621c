"""How fast a simulated chair really goes: two axes that follow their targets at a controller's rates."""

from __future__ import annotations

from dataclasses import dataclass, field

from chairward_drive_can.scale import ramp


@dataclass(slots=True)
class Axis:
    """One motor axis. It rests for `rest_s` before it turns round, as bridges do."""

    rest_s: float = 0.02
    value: float = 0.0
    _rested_s: float = 0.0
    _came_from: float = 0.0

    def step(self, target: float, rise_per_s: float, fall_per_s: float, dt_s: float) -> None:
        """Let dt_s pass."""
        if self.value == 0.0:
            self._rested_s += dt_s
            if self._came_from * target < 0.0 and self._rested_s < self.rest_s:
                return
        else:
            self._rested_s, self._came_from = 0.0, self.value
        self.value = ramp(self.value, target, rise_per_s, fall_per_s, dt_s)


@dataclass(slots=True)
class Body:
    """forward and left as fractions of full speed, -1..1; rates in fractions per second."""

    rise_per_s: float = 1.5
    fall_per_s: float = 2.5
    drive: Axis = field(default_factory=Axis)
    steer: Axis = field(default_factory=Axis)
    target_forward: float = 0.0
    target_left: float = 0.0

    @property
    def forward(self) -> float:
        """Forward (+) or backward (-)."""
        return self.drive.value

    @property
    def left(self) -> float:
        """Left (+) or right (-)."""
        return self.steer.value

    def step(self, dt_s: float) -> None:
        """Let dt_s pass."""
        self.drive.step(self.target_forward, self.rise_per_s, self.fall_per_s, dt_s)
        self.steer.step(self.target_left, self.rise_per_s, self.fall_per_s, dt_s)

    def aim(self, forward: float, left: float) -> None:
        """New targets."""
        self.target_forward, self.target_left = forward, left

    def halt(self) -> None:
        """Brakes on, at once."""
        self.aim(0.0, 0.0)
        self.drive.value = self.steer.value = 0.0

    @property
    def standing(self) -> bool:
        """Nothing turns."""
        return self.forward == 0.0 and self.left == 0.0

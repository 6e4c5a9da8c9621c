"""Source `sim_operator`: the stop device in the simulated person's hand. Alive, and the arm and reset buttons."""

from __future__ import annotations

import time
from collections.abc import Sequence

from chairward.components import Context
from chairward.messages import Alive, Button, Press
from chairward.shared_state import SharedState
from chairward_simulator.camera import attach, read
from chairward_simulator.settings import OperatorSettings

ALIVE_EVERY_S = 0.1
ARM_EVERY_S = 2.0


class SimOperator:
    """Alive every 100 ms; RESET and ARM when the simulated person presses them.

    Without a world nobody is there to press: it presses ARM `arm_after_s` after opening and then every 2 s (harmless
    when armed, and needed when the drive was not yet linked at the first press). It never presses RESET: a latch stays.
    """

    def __init__(self, settings: OperatorSettings, context: Context) -> None:
        self._settings, self._context = settings, context
        self._world: SharedState | None = None
        self._arms = self._resets = 0
        self._seq = 0
        self._due_s = 0.0
        self._arm_at_s = 0.0

    def open(self) -> None:
        """Attach to the world, when there is to be one."""
        now = time.monotonic()
        self._due_s, self._arm_at_s = now, now + self._settings.arm_after_s
        if self._settings.world:
            self._world = attach(self._context, "sim_operator")

    def read(self, timeout_s: float) -> Sequence[Alive | Press] | None:
        """What has happened since the last call, at least every 100 ms."""
        end = time.monotonic() + timeout_s
        while True:
            now = time.monotonic()
            buttons = self._buttons(now)
            if buttons or now >= self._due_s:
                self._due_s = max(self._due_s + ALIVE_EVERY_S, now)
                return [*(self._press(button) for button in buttons), self._alive()]
            if now >= end:
                return None
            time.sleep(max(0.0, min(0.02, self._due_s - now, end - now)))

    def _buttons(self, now: float) -> list[Button]:
        if self._world is None:
            if self._settings.world or now < self._arm_at_s:
                return []
            self._arm_at_s = now + ARM_EVERY_S
            return [Button.ARM]
        state = read(self._world, "sim_operator")
        arms, resets = int(state["arm"]), int(state["reset"])
        pressed = [Button.RESET] * (resets > self._resets) + [Button.ARM] * (arms > self._arms)
        self._arms, self._resets = arms, resets
        return pressed

    def _next(self) -> tuple[int, int]:
        self._seq += 1
        return self._seq, time.monotonic_ns()

    def _press(self, button: Button) -> Press:
        seq, now_ns = self._next()
        return Press(seq=seq, captured_ns=now_ns, button=button)

    def _alive(self) -> Alive:
        seq, now_ns = self._next()
        return Alive(seq=seq, captured_ns=now_ns)

    def close(self) -> None:
        """Let go of the world."""
        if self._world is not None:
            self._world.close()
            self._world = None

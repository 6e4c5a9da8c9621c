"""Who judges an acceptance run: the pins of a simulated controller, or a person beside the chair."""

from __future__ import annotations

import os
import signal
from collections.abc import Callable
from typing import Protocol

from chairward.check.stimulus import SimulatedObstacle, Stimulus
from chairward.check.trial import HAND_SOURCE, Trial
from chairward.messages import Button, Command

TURNING = 0.02


class Judge(Protocol):
    """Who says what cannot be seen from here: a person beside the chair, or the pins of a simulated controller.

    timed: it answers at once, so that what it sees can be timed.
    """

    timed: bool

    def turns(self, chair: Trial, way: Command) -> str:
        """Which way the wheels turn now ("" for nothing), while `way` is held."""

    def place(self, distance_mm: float, *, driving: bool = False) -> None:
        """Put an obstacle so far ahead of the footprint, while the wheels turn or while they stand."""

    def stop_devices(self, chair: Trial) -> list[str]:
        """The stop devices that are tried, by name."""

    def press_stop(self, chair: Trial, name: str) -> None:
        """Press that one."""

    def clear(self) -> None:
        """Take it away."""

    def unplug(self, chair: Trial, lane: str) -> None:
        """Unplug that lane's device."""

    def plug(self, chair: Trial, lane: str) -> None:
        """And plug it in again."""


class Simulated:
    """Looks at the pins, places obstacles in the simulated home; a device that is gone is a process that hangs."""

    timed = True

    def __init__(self, obstacle: SimulatedObstacle) -> None:
        self._obstacle = obstacle

    def turns(self, chair: Trial, way: Command) -> str:
        """Which motor is driven, and which way."""
        pins = chair.pins()
        if pins is None or pins["brake"] > 0.5:
            return ""
        drive = (pins["drive_in1"] - pins["drive_in2"]) * pins["drive_duty"]
        steer = (pins["steer_in1"] - pins["steer_in2"]) * pins["steer_duty"]
        del way
        if max(abs(drive), abs(steer)) < TURNING:
            return ""
        if abs(drive) >= abs(steer):
            return Command.FRONT if drive > 0.0 else Command.BACK
        return Command.LEFT if steer > 0.0 else Command.RIGHT

    def place(self, distance_mm: float, *, driving: bool = False) -> None:
        """Somebody stands there."""
        del driving
        self._obstacle.show(distance_mm)

    def stop_devices(self, chair: Trial) -> list[str]:
        """The hand of the check; nobody presses the others."""
        del chair
        return [HAND_SOURCE]

    def press_stop(self, chair: Trial, name: str) -> None:
        """By that hand."""
        del name
        chair.hand.press(Button.STOP)

    def clear(self) -> None:
        """Nobody does."""
        self._obstacle.hide()

    def unplug(self, chair: Trial, lane: str) -> None:
        """Its process stands still, as with a device that hangs."""
        os.kill(chair.supervisor.lanes[lane].process.pid, signal.SIGSTOP)

    def plug(self, chair: Trial, lane: str) -> None:
        """It goes on."""
        os.kill(chair.supervisor.lanes[lane].process.pid, signal.SIGCONT)


class Asked:
    """A person beside the chair, wheels off the ground. ask: a question and its answers -> the answer."""

    timed = False

    def __init__(self, ask: Callable[[str, tuple[str, ...]], str]) -> None:
        self._ask = ask

    def turns(self, chair: Trial, way: Command) -> str:
        """Which way the chair would go."""
        del chair, way
        answer = self._ask("Which way would the chair go now?", ("front", "back", "left", "right", "nothing"))
        return "" if answer == "nothing" else answer

    def place(self, distance_mm: float, *, driving: bool = False) -> None:
        """A box on the floor."""
        now = "NOW, while the wheels turn, push" if driving else "Put"
        self._ask(f"{now} a box to {distance_mm:g} mm ahead of the feet, in the middle.", ("done",))

    def stop_devices(self, chair: Trial) -> list[str]:
        """Every one of the chair's own."""
        return [name for name in chair.plan.limits.stop_devices if name != HAND_SOURCE]

    def press_stop(self, chair: Trial, name: str) -> None:
        """By hand."""
        del chair
        self._ask(f"Press STOP at '{name}' now, while the wheels turn.", ("done",))

    def clear(self) -> None:
        """And away."""
        self._ask("Take the box away: nothing nearer than 3 m ahead.", ("done",))

    def unplug(self, chair: Trial, lane: str) -> None:
        """By hand."""
        del chair
        self._ask(f"Unplug the device of lane '{lane}' now, while the wheels turn.", ("done",))

    def plug(self, chair: Trial, lane: str) -> None:
        """By hand."""
        del chair
        self._ask(f"Plug the device of lane '{lane}' in again.", ("done",))


def simulated(chair: Trial) -> tuple[Simulated, Stimulus]:
    """The judge of a simulated chair, and what it lets appear."""
    obstacle = SimulatedObstacle(chair.run_dir)
    return Simulated(obstacle), obstacle

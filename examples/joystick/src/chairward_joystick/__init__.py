"""A joystick as the person's hand control: the same sensors guard a chair that is driven by hand.

Reads the kernel's joystick interface (/dev/input/js0): 8 bytes an event, told only when something changes. So a stick
that is held still is repeated here, by time; one that was already held when the device was opened moves nothing until
it has been at rest.
"""

from __future__ import annotations

import os
import select
import struct
import time
from collections.abc import Sequence

from pydantic import Field

from chairward.components import Component, Context, DeviceLost, Settings
from chairward.hookspecs import hookimpl
from chairward.messages import Alive, Button, Message, Press, Stick

CHAIRWARD_API = 1
EVENT = struct.Struct("<IhBB")  # time_ms, value, kind, number
BUTTON, AXIS, INITIAL = 0x01, 0x02, 0x80
FULL = 32767
EVERY_NS = 50_000_000
"""Heartbeat and held stick; the core wants both at least every 100 ms."""


class JoystickSettings(Settings):
    """Which joystick, and what its axes and buttons are."""

    device: str = Field("/dev/input/js0", min_length=1, description="the joystick, e.g. /dev/input/by-id/...-joystick")
    forward_axis: int = Field(1, ge=0, le=15, description="number of the axis that drives; pushed away is negative")
    turn_axis: int = Field(0, ge=0, le=15, description="number of the axis that turns; to the left is negative")
    dead_zone: float = Field(0.15, ge=0.02, le=0.5, description="a stick this near its rest is at rest (tremor)")
    stop_button: int = Field(0, ge=0, le=31, description="number of the button that stops")
    arm_button: int = Field(1, ge=0, le=31, description="number of the button that arms (if the chair file allows it)")
    reset_button: int = Field(2, ge=0, le=31, description="number of the button that resets (likewise)")


class Joystick:
    """A source that is its own recognizer: yields Stick, Press and Alive."""

    def __init__(self, settings: JoystickSettings, context: Context) -> None:
        del context
        self.settings, self.fd, self.seq = settings, -1, 0
        self.buttons = {settings.reset_button: Button.RESET, settings.arm_button: Button.ARM}
        self.buttons[settings.stop_button] = Button.STOP
        self.axes: dict[int, float] = {}
        self.due_ns, self.rested, self.moving, self.rest = 0, False, False, b""

    def open(self) -> None:
        """Open the device. Raises DeviceLost."""
        self.close()
        try:
            self.fd = os.open(self.settings.device, os.O_RDONLY | os.O_NONBLOCK)
            while not self.rest and select.select([self.fd], [], [], 0)[0]:
                self._take(self._bytes(), initial=True)
        except (OSError, DeviceLost) as error:
            self.close()
            raise DeviceLost(
                f"joystick {self.settings.device} cannot be opened: plug it in or correct joystick.device"
            ) from error
        self.rested = self._stick() == (0.0, 0.0)

    def read(self, timeout_s: float) -> list[Message] | None:
        """What is due, or None after timeout_s. Raises DeviceLost when the joystick is gone."""
        if self.fd < 0:
            raise DeviceLost(f"joystick {self.settings.device} is not open: open() comes first")
        wait_s = min(timeout_s, max(0, self.due_ns - time.monotonic_ns()) / 1e9)
        ready = select.select([self.fd], [], [], wait_s)[0]
        messages = self._take(self._bytes()) if ready else []
        return [*messages, *self._due()] or None

    def close(self) -> None:
        """Give it back; may be called twice."""
        if self.fd >= 0:
            os.close(self.fd)
        self.fd, self.axes, self.rest = -1, {}, b""
        self.moving = False

    def _bytes(self) -> bytes:
        try:
            data = os.read(self.fd, 64 * EVENT.size)
        except OSError as error:
            raise DeviceLost(f"joystick {self.settings.device} was unplugged: plug it in again") from error
        if not data:
            raise DeviceLost(f"joystick {self.settings.device} was unplugged: plug it in again")
        return data

    def _take(self, data: bytes, *, initial: bool = False) -> list[Message]:
        """Fold events into the axes' positions; buttons are told at once."""
        data = self.rest + data
        whole = len(data) - len(data) % EVENT.size
        self.rest = data[whole:]
        presses: list[Message] = []
        for _, value, kind, number in EVENT.iter_unpack(data[:whole]):
            if kind & ~INITIAL == AXIS:
                self.axes[number] = max(-1.0, value / FULL)
            elif kind == BUTTON and value and number in self.buttons and not initial:
                button = self.buttons[number]
                presses.append(Press(seq=self._next(), captured_ns=time.monotonic_ns(), button=button))
                self.rested = False  # nothing goes on by itself: let go of the stick first
        return presses

    def _due(self) -> list[Message]:
        """The stick while it is held, once more when it is let go, and the heartbeat."""
        forward, left = self._stick()
        held = (forward, left) != (0.0, 0.0)
        self.rested = self.rested or not held
        moving, let_go = held and self.rested, self.moving and not (held and self.rested)
        self.moving = moving
        now_ns = time.monotonic_ns()
        if now_ns < self.due_ns and not let_go:
            return []
        messages: list[Message] = []
        if moving or let_go:
            position = (forward, left) if moving else (0.0, 0.0)
            messages.append(Stick(seq=self._next(), captured_ns=now_ns, forward=position[0], left=position[1]))
        self.due_ns = now_ns + EVERY_NS
        return [*messages, Alive(seq=self._next(), captured_ns=now_ns)]

    def _stick(self) -> tuple[float, float]:
        """(forward, left), -1..1, with the dead zone taken out."""
        s = self.settings
        return self._calm(-self.axes.get(s.forward_axis, 0.0)), self._calm(-self.axes.get(s.turn_axis, 0.0))

    def _calm(self, position: float) -> float:
        beyond = (abs(position) - self.settings.dead_zone) / (1.0 - self.settings.dead_zone)
        return 0.0 if beyond <= 0.0 else min(1.0, beyond) * (1.0 if position > 0 else -1.0)

    def _next(self) -> int:
        self.seq += 1
        return self.seq


@hookimpl
def chairward_sources() -> Sequence[Component]:
    """One source."""
    what = "a joystick as hand control, with a stop button"
    return [
        Component(name="joystick", settings=JoystickSettings, make=Joystick, gives=(Stick, Press, Alive), summary=what)
    ]

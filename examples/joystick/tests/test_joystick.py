"""The joystick keeps every promise of a recognizer: the kernel's joystick interface played through a named pipe."""

from __future__ import annotations

import os
from collections.abc import Iterator
from pathlib import Path

import pytest
from chairward_joystick import AXIS, BUTTON, EVENT, FULL, chairward_sources

from chairward.messages import Command, Stick
from chairward.testing import HeldDeviceContract, RecognizerRig
from chairward.testing.device_rig import opened

PUSHED = {Command.FRONT: (1, -FULL), Command.BACK: (1, FULL), Command.LEFT: (0, -FULL), Command.RIGHT: (0, FULL)}


class JoystickRig(RecognizerRig):
    """A joystick with two axes and buttons."""

    component = chairward_sources()[0]

    def __init__(self, folder: Path) -> None:
        self.name = str(folder / "js0")
        self.settings = {"device": self.name}
        self.fd, self.axis = -1, 0
        self.plug()

    def tell(self, kind: int, number: int, value: int) -> None:
        if self.fd >= 0:
            os.write(self.fd, EVENT.pack(0, value, kind, number))

    def ask(self, command: Command) -> None:
        self.axis, value = PUSHED[command]
        self.tell(AXIS, self.axis, value)

    def let_go(self) -> None:
        self.tell(AXIS, self.axis, 0)

    def stop(self) -> None:
        self.tell(BUTTON, 0, 1)
        self.tell(BUTTON, 0, 0)

    def babble(self) -> None:
        for value in (900, -1500, 3000, -4000):  # a trembling hand
            self.tell(AXIS, 1, value)
        self.tell(BUTTON, 5, 1)

    def unplug(self) -> None:
        if self.fd >= 0:
            os.close(self.fd)
            os.unlink(self.name)
            self.fd = -1

    def plug(self) -> None:
        os.mkfifo(self.name)
        self.fd = os.open(self.name, os.O_RDWR | os.O_NONBLOCK)

    def close(self) -> None:
        self.unplug()


class TestJoystick(HeldDeviceContract):
    """All of the contract, and what is special to a stick."""

    @pytest.fixture
    def rig(self, tmp_path: Path) -> Iterator[JoystickRig]:
        rig = JoystickRig(tmp_path)
        yield rig
        rig.close()

    def test_a_half_pushed_stick_asks_for_half(self, rig: JoystickRig) -> None:
        with opened(rig) as reader:
            rig.tell(AXIS, 1, -FULL // 2)
            stick = reader.until(lambda m: isinstance(m, Stick), "the stick")
            assert 0.3 < stick.forward < 0.5, "half way, less the dead zone"
            assert stick.left == 0.0

    def test_a_stick_that_is_held_when_it_is_plugged_in_moves_nothing_until_it_was_let_go(
        self, rig: JoystickRig
    ) -> None:
        rig.ask(Command.FRONT)
        with opened(rig) as reader:
            assert not [m for m in reader.during(0.5) if isinstance(m, Stick)]
            rig.let_go()
            reader.during(0.2)
            rig.ask(Command.FRONT)
            reader.until(lambda m: rig.heard(m, Command.FRONT), "the stick, pushed anew")

    def test_stop_lets_nothing_go_on_until_the_stick_was_let_go(self, rig: JoystickRig) -> None:
        with opened(rig) as reader:
            rig.ask(Command.FRONT)
            reader.until(lambda m: rig.heard(m, Command.FRONT), "the stick")
            rig.stop()
            reader.during(0.3)
            first = len(reader.said)
            assert not [m for m in reader.during(0.5) if rig.heard(m, Command.FRONT)], reader.said[first:]

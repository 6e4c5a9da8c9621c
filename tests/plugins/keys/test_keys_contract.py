"""The keys keep every promise of a recognizer: an input device played through a named pipe."""

from __future__ import annotations

import contextlib
import os
import struct
from collections.abc import Iterator
from pathlib import Path

import pytest

from chairward.messages import Command
from chairward.testing import HeldDeviceContract, RecognizerRig
from chairward_keys.plugin import chairward_sources

UP, DOWN, LEFT, RIGHT, SPACE, PLAY = 103, 108, 105, 106, 57, 207
CODES = {Command.FRONT: UP, Command.BACK: DOWN, Command.LEFT: LEFT, Command.RIGHT: RIGHT}


class KeysRig(RecognizerRig):
    """A keyboard that speaks struct input_event."""

    component = chairward_sources()[0]

    def __init__(self, folder: Path) -> None:
        self.name = str(folder / "keyboard")
        self.settings = {"device": self.name, "other_keys": "ignore"}
        self.fd, self.down = -1, 0
        self.plug()

    def press(self, code: int, value: int) -> None:
        if self.fd >= 0:
            os.write(self.fd, struct.pack("llHHi", 0, 0, 1, code, value))

    def ask(self, command: Command) -> None:
        self.down = CODES[command]
        self.press(self.down, 1)

    def let_go(self) -> None:
        self.press(self.down, 0)

    def stop(self) -> None:
        self.press(SPACE, 1)
        self.press(SPACE, 0)

    def babble(self) -> None:
        self.press(PLAY, 1)
        self.press(PLAY, 0)

    def unplug(self) -> None:
        if self.fd >= 0:
            os.close(self.fd)
            os.unlink(self.name)
            self.fd = -1

    def plug(self) -> None:
        os.mkfifo(self.name)
        self.fd = os.open(self.name, os.O_RDWR | os.O_NONBLOCK)

    def close(self) -> None:
        with contextlib.suppress(OSError):
            self.unplug()


class TestKeys(HeldDeviceContract):
    """All of the contract."""

    @pytest.fixture
    def rig(self, tmp_path: Path) -> Iterator[KeysRig]:
        rig = KeysRig(tmp_path)
        yield rig
        rig.close()

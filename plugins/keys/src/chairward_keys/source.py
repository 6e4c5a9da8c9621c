"""The source `keys`: waits for keys and tells, in messages, what they mean."""

from __future__ import annotations

import os
import select
import time
from pathlib import Path

from chairward.components import DeviceLost
from chairward.messages import Message
from chairward.talk_switch import TalkSwitch
from chairward_keys.devices import InputDevice, Terminal, open_device
from chairward_keys.events import DeviceKeys, TypedKeys
from chairward_keys.settings import KeysSettings
from chairward_keys.switchboard import Switchboard

S = 1_000_000_000
MS = 1_000_000
_READ_BYTES = 4096
_TALK_NS = 250 * MS
"""How long a talk key that is held keeps ears open; renewed with every heartbeat."""


class Keys:
    """Yields lists of Press, Intent and Alive; Alive every 100 ms while the device can be read, never without it."""

    def __init__(self, settings: KeysSettings, run_dir: Path = Path()) -> None:
        self._settings = settings
        self._talk = TalkSwitch(run_dir) if "talk" in settings.keys.values() else None
        self._device: InputDevice | Terminal | None = None
        self._decoder: TypedKeys | DeviceKeys = DeviceKeys()
        self._board = Switchboard(settings.keys, settings.other_keys)

    def open(self) -> None:
        """Open the device; no key counts as held. Raises DeviceLost."""
        self.close()
        self._device = open_device(self._settings.device, grab=self._settings.grab)
        is_terminal = isinstance(self._device, Terminal)
        self._decoder = TypedKeys(self._settings.repeat_gap_ms * MS) if is_terminal else DeviceKeys()
        self._board.let_go()

    def read(self, timeout_s: float) -> list[Message] | None:
        """The messages that are due, or None after timeout_s. Raises DeviceLost when the device is gone."""
        if self._device is None:
            raise DeviceLost("the keys are not open: open() comes first")
        end_ns = time.monotonic_ns() + max(0, round(timeout_s * S))
        while True:
            due_ns = min(end_ns, self._board.next_due_ns(), self._decoder.next_due_ns() or end_ns)
            data = self._bytes(self._device, max(0, due_ns - time.monotonic_ns()) / S)
            now_ns = time.monotonic_ns()
            messages = self._board.step(now_ns, self._decoder.feed(data, now_ns))
            if self._talk is not None and self._board.talking:
                self._talk.hold(now_ns + _TALK_NS)
            if messages:
                return messages
            if now_ns >= end_ns:
                return None

    def close(self) -> None:
        """Give the device back; may be called twice."""
        if self._device is not None:
            self._device.close()
            self._device = None

    def _bytes(self, device: InputDevice | Terminal, timeout_s: float) -> bytes:
        """What has come within timeout_s, possibly nothing. Raises DeviceLost at the device's end."""
        ready, _, _ = select.select([device.fd], [], [], timeout_s)
        if not ready:
            return b""
        try:
            data = os.read(device.fd, _READ_BYTES)
        except BlockingIOError:
            return b""
        except OSError as error:
            raise DeviceLost(f"{device.name} is gone ({error.strerror}): plug it in again") from error
        if not data:
            raise DeviceLost(f"{device.name} was closed at its other end: plug it in or open it again")
        return data

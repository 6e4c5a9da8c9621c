"""A key that means talk opens the ears while it is held, and asks for nothing itself."""

from __future__ import annotations

import os
import struct
import time
from pathlib import Path

from chairward.components import Context
from chairward.messages import Alive
from chairward.talk_switch import TalkListener
from chairward_keys.plugin import make
from chairward_keys.settings import KeysSettings

T = 20


def test_motion_words_count_while_the_talk_key_is_held_and_soon_not_after(tmp_path: Path) -> None:
    device = tmp_path / "keyboard"
    os.mkfifo(device)
    keyboard = os.open(device, os.O_RDWR | os.O_NONBLOCK)
    source = make(
        KeysSettings(device=str(device), keys={"space": "stop", "t": "talk"}),
        Context(lane="panel", run_dir=tmp_path, chair_dir=tmp_path),
    )
    ears = TalkListener(tmp_path)
    source.open()
    try:
        assert not ears.is_held(time.monotonic_ns())
        os.write(keyboard, struct.pack("llHHi", 0, 0, 1, T, 1))
        said = source.read(0.5)
        assert isinstance(said, list)
        assert all(isinstance(message, Alive) for message in said)
        assert ears.is_held(said[0].captured_ns), "at the time of the reading that saw the key go down"
        os.write(keyboard, struct.pack("llHHi", 0, 0, 1, T, 0))
        source.read(0.0)
        assert not ears.is_held(time.monotonic_ns() + 300_000_000), "it ends by itself within 250 ms"
    finally:
        source.close()
        ears.close()
        os.close(keyboard)

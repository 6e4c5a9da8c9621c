"""The live source without a sound card: what it says, and that its queue is bounded and counts what it loses."""

from __future__ import annotations

import subprocess
import sys

import numpy as np
import pytest

from chairward.components import DeviceLost
from chairward_microphone.live import QUEUE_BLOCKS, Feed, LiveMicrophone, find_input, load_portaudio
from chairward_microphone.settings import MicrophoneSettings


class Machine:
    """What sounddevice would tell about a machine (only the two calls that choosing a device needs)."""

    def __init__(self, *names: str, default: int = -1) -> None:
        self.names = names
        self.default = type("Default", (), {"device": (default, -1)})

    def query_devices(self) -> list[dict[str, object]]:
        return [{"name": n, "max_input_channels": 0 if n == "speaker" else 1} for n in self.names]


def test_a_machine_without_a_microphone_is_one_sentence() -> None:
    with pytest.raises(DeviceLost, match="no sound input at all"):
        find_input(Machine("speaker"), "")


def test_inputs_are_found_by_part_of_the_name_or_number() -> None:
    machine = Machine("speaker", "Built-in Mic", "USB Headset", default=2)
    assert find_input(machine, "") == 2
    assert find_input(machine, "built-in") == 1
    assert find_input(machine, "1") == 1
    with pytest.raises(
        DeviceLost, match=r"no sound input matches 'radio' \(there are: 1 'Built-in Mic', 2 'USB Headset'\)"
    ):
        find_input(machine, "radio")


def test_a_full_queue_drops_the_newest_and_counts_it() -> None:
    feed = Feed(16_000)
    for n in range(QUEUE_BLOCKS + 3):
        feed.put(np.zeros(160, np.float32), n, overflowed=False)
    got = [feed.get(0.0) for _ in range(QUEUE_BLOCKS)]
    assert [b.captured_ns for b in got if b] == list(range(QUEUE_BLOCKS))
    assert all(b is not None and b.lost_samples == 0 for b in got)
    feed.put(np.zeros(160, np.float32), 99, overflowed=True)
    late = feed.get(0.0)
    assert late is not None
    assert late.lost_samples == 4 * 160
    assert feed.get(0.0) is None


def test_a_real_machine_either_opens_or_says_why_not() -> None:
    source = LiveMicrophone(MicrophoneSettings(device="a device that no machine has"))
    with pytest.raises(DeviceLost, match="microphone"):
        source.open()
    source.close()
    source.close()


def test_a_missing_portaudio_says_what_to_install(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "sounddevice", None)
    with pytest.raises(DeviceLost, match="sounddevice cannot be used"):
        load_portaudio()
    finder = type("Missing", (), {"find_spec": staticmethod(lambda name, *_: _raise(name))})
    monkeypatch.delitem(sys.modules, "sounddevice")
    monkeypatch.setattr(sys, "meta_path", [finder, *sys.meta_path])
    with pytest.raises(DeviceLost, match="sudo apt install libportaudio2"):
        load_portaudio()


def _raise(name: str) -> None:
    if name == "sounddevice":
        raise OSError("PortAudio library not found")


def test_offering_the_plugin_loads_no_device_library() -> None:
    code = (
        "import sys, chairward_microphone.plugin as m, chairward_voice_dtw.plugin as v; "
        "m.chairward_sources(); v.chairward_recognizers(); "
        "sys.exit(', '.join({'sounddevice', 'numba', 'scipy', 'soundfile', 'webrtcvad'} & set(sys.modules)) or 0)"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr

"""A real microphone through PortAudio: a bounded queue between its callback and the lane, losses counted."""

from __future__ import annotations

import queue
import time
from typing import Any

import numpy as np

from chairward.components import DeviceLost
from chairward.stages import AudioBlock, Floats
from chairward_microphone.settings import MicrophoneSettings

QUEUE_BLOCKS = 50
SILENT_S = 1.0


def load_portaudio() -> Any:
    """The sounddevice module. Raises DeviceLost with what to install."""
    try:
        import sounddevice
    except OSError:
        raise DeviceLost(
            "microphone: the PortAudio library is missing: install it with 'sudo apt install libportaudio2'"
        ) from None
    except ImportError as error:
        raise DeviceLost(f"microphone: the Python package sounddevice cannot be used ({error})") from None
    return sounddevice


def find_input(sounddevice: Any, wanted: str) -> int:
    """Number of the input device. Raises DeviceLost naming what there is."""
    inputs = {i: d["name"] for i, d in enumerate(sounddevice.query_devices()) if d["max_input_channels"] > 0}
    if not inputs:
        raise DeviceLost("microphone: this machine has no sound input at all: plug a microphone in")
    if not wanted:
        default = int(sounddevice.default.device[0])
        return default if default in inputs else min(inputs)
    for number, name in inputs.items():
        if wanted == str(number) or wanted.lower() in name.lower():
            return number
    known = ", ".join(f"{number} '{name}'" for number, name in inputs.items())
    raise DeviceLost(f"microphone: no sound input matches '{wanted}' (there are: {known}): correct microphone.device")


class Feed:
    """What the callback fills and the lane empties: never blocks the callback, counts what did not fit."""

    def __init__(self, rate_hz: int) -> None:
        self._rate_hz = rate_hz
        self._blocks: queue.Queue[AudioBlock] = queue.Queue(QUEUE_BLOCKS)
        self._lost = 0
        self._seq = 0

    def put(self, samples: Floats, captured_ns: int, overflowed: bool) -> None:
        """From the callback. overflowed: the driver lost sound just before (it does not say how much: one block)."""
        if overflowed:
            self._lost += len(samples)
        block = AudioBlock(
            samples=samples, rate_hz=self._rate_hz, captured_ns=captured_ns, seq=self._seq, lost_samples=self._lost
        )
        self._seq += 1
        try:
            self._blocks.put_nowait(block)
        except queue.Full:
            self._lost += len(samples)
        else:
            self._lost = 0

    def get(self, timeout_s: float) -> AudioBlock | None:
        """The oldest block, or None after timeout_s."""
        try:
            return self._blocks.get(timeout=timeout_s)
        except queue.Empty:
            return None


class LiveMicrophone:
    """Opens the device at the wanted rate, or at its own when it refuses (10 ms blocks of that rate then)."""

    def __init__(self, settings: MicrophoneSettings) -> None:
        self._settings = settings
        self._stream: Any = None
        self._feed: Feed | None = None
        self._heard_ns = 0

    def open(self) -> None:
        """Raises DeviceLost."""
        self.close()
        sounddevice = load_portaudio()
        try:
            device = find_input(sounddevice, self._settings.device)
            rate_hz = self._rate(sounddevice, device)
            feed = Feed(rate_hz)

            def callback(data: Any, frames: int, times: Any, status: Any) -> None:
                age_s = max(0.0, times.currentTime - times.inputBufferAdcTime) if times.inputBufferAdcTime else 0.0
                captured_ns = time.monotonic_ns() - int(min(age_s or frames / rate_hz, 1.0) * 1e9)
                feed.put(np.array(data[:, 0], np.float32), captured_ns, bool(status.input_overflow))

            self._stream = sounddevice.InputStream(
                device=device,
                samplerate=rate_hz,
                channels=1,
                dtype="float32",
                blocksize=rate_hz // 100,
                latency="low",
                callback=callback,
            )
            self._stream.start()
        except sounddevice.PortAudioError as error:
            self.close()
            raise DeviceLost(f"microphone '{self._settings.device or 'default'}': {error}") from None
        self._feed = feed
        self._heard_ns = time.monotonic_ns()

    def _rate(self, sounddevice: Any, device: int) -> int:
        wanted = self._settings.rate_hz
        try:
            sounddevice.check_input_settings(device=device, channels=1, dtype="float32", samplerate=wanted)
        except sounddevice.PortAudioError:
            return int(sounddevice.query_devices(device)["default_samplerate"])
        return wanted

    def read(self, timeout_s: float) -> AudioBlock | None:
        """The oldest block not yet read. Raises DeviceLost when the device has gone quiet for a second."""
        if self._feed is None or self._stream is None:
            raise DeviceLost("microphone: not open")
        block = self._feed.get(timeout_s)
        now_ns = time.monotonic_ns()
        if block is not None:
            self._heard_ns = now_ns
        elif not self._stream.active or now_ns - self._heard_ns > SILENT_S * 1e9:
            raise DeviceLost(
                f"microphone '{self._settings.device or 'default'}': gives no sound any more; is it unplugged?"
            )
        return block

    def close(self) -> None:
        """May be called twice."""
        if self._stream is not None:
            self._stream.close(ignore_errors=True)
            self._stream = None
        self._feed = None

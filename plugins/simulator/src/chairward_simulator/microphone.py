"""Source `sim_microphone`: the room's quiet noise, and the word that the simulated person is just saying."""

from __future__ import annotations

import time

import numpy as np

from chairward.components import Context, DeviceLost
from chairward.shared_state import SharedState
from chairward.stages import AudioBlock, Floats
from chairward_simulator import speech
from chairward_simulator.camera import attach, read
from chairward_simulator.settings import MicrophoneSettings

BLOCK_S = 0.010
HOARD_S = 0.5
"""A real sound card's buffer: what is not fetched within this time is lost, and said to be."""


BLOCK = int(BLOCK_S * speech.RATE_HZ)


def room_noise(settings: MicrophoneSettings) -> Floats:
    """Seven seconds of a quiet room: hiss and rumble at the level set."""
    rng = np.random.default_rng(settings.seed)
    hiss = rng.standard_normal(speech.RATE_HZ * 7)
    rumble = np.convolve(rng.standard_normal(speech.RATE_HZ * 7), np.ones(24) / np.sqrt(24), mode="same")
    room = 0.5 * hiss + rumble
    return np.asarray(room / room.std() * 10 ** (settings.noise_dbfs / 20), dtype=np.float32)


def mix(
    noise: Floats, block: int, captured_ns: int, utterance: int, word: str, said_ns: int, gain: float = 1.0
) -> Floats:
    """Noise of block number `block`, and the part of the utterance (0: none) begun at said_ns that falls into it."""
    at = block * BLOCK % (len(noise) - BLOCK)
    samples = noise[at : at + BLOCK].copy()
    if utterance == 0:
        return samples
    sound = speech.sound(speech.say_file(word, utterance))
    first = round((captured_ns - said_ns) / 1e9 * speech.RATE_HZ)
    begin, end = max(0, first), min(len(sound), first + BLOCK)
    if begin < end:
        samples[begin - first : end - first] += np.float32(gain) * sound[begin:end]
    return np.clip(samples, -1.0, 1.0, out=samples)


class SimMicrophone:
    """10 ms blocks at 16 kHz, paced by the clock: a block is there when its last sample has been heard."""

    def __init__(self, settings: MicrophoneSettings, context: Context) -> None:
        self._settings, self._context = settings, context
        self._world: SharedState | None = None
        self._noise = room_noise(settings)
        self._gain = 10 ** (settings.speech_gain_db / 20)
        self._start_ns = 0
        self._blocks = 0
        self._seq = 0

    def open(self) -> None:
        """Attach to the world; time starts now."""
        self._world = attach(self._context, "sim_microphone")
        for word in speech.WORDS:
            for path in sorted(speech.SAY.glob(f"{word}_*.wav")):
                speech.sound(path)
        self._start_ns, self._blocks = time.monotonic_ns(), 0

    def read(self, timeout_s: float) -> AudioBlock | None:
        """The next block."""
        if self._world is None:
            raise DeviceLost("sim_microphone: not open: call open() first")
        block_ns = int(BLOCK_S * 1e9)
        lost = 0
        behind_ns = time.monotonic_ns() - (self._start_ns + (self._blocks + 1) * block_ns)
        if behind_ns > HOARD_S * 1e9:
            skipped = behind_ns // block_ns
            self._blocks += skipped
            lost = int(skipped) * BLOCK
        captured_ns = self._start_ns + self._blocks * block_ns
        wait_s = (captured_ns + block_ns - time.monotonic_ns()) / 1e9
        if wait_s > timeout_s:
            time.sleep(timeout_s)
            return None
        if wait_s > 0:
            time.sleep(wait_s)
        state = read(self._world, "sim_microphone")
        word = speech.WORDS[int(state["utterance_word"])]
        said = int(state["utterance_id"]), word, int(state["utterance_ns"])
        samples = mix(self._noise, self._blocks, captured_ns, *said, self._gain)
        self._blocks += 1
        self._seq += 1
        return AudioBlock(
            samples=samples, rate_hz=speech.RATE_HZ, captured_ns=captured_ns, seq=self._seq, lost_samples=lost
        )

    def close(self) -> None:
        """Let go of the world."""
        if self._world is not None:
            self._world.close()
            self._world = None

"""Made-up words: each a fixed melody of formant-like tones, said with a little variation. No recordings needed."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import numpy.typing as npt
import pytest

HZ = 16_000
MELODIES = {
    "front": [(500, 1500), (300, 2200), (700, 1100)],
    "left": [(300, 2400), (600, 1800)],
    "right": [(800, 1200), (400, 2600), (300, 900)],
    "stop": [(1000, 3000), (700, 1000)],
}


def say(word: str, take: int, hz: int = HZ) -> npt.NDArray[np.float32]:
    """About 0.5 s: two or three steady vowels with harmonics of a 120 Hz voice, and a short silence around."""
    rng = np.random.default_rng([take, sum(map(ord, word))])
    parts = []
    for first, second in MELODIES[word]:
        n = int(hz * 0.2 * rng.uniform(0.9, 1.1))
        t = np.arange(n) / hz
        pitch = 120.0 * rng.uniform(0.97, 1.03)
        x = np.zeros(n)
        for k in range(1, 30):
            f = k * pitch
            gain = np.exp(-(((f - first) / 150.0) ** 2)) + 0.7 * np.exp(-(((f - second) / 200.0) ** 2)) + 0.01
            x += gain * np.sin(2 * np.pi * f * t + rng.uniform(0, 6.28))
        ramp = np.minimum(1.0, np.minimum(np.arange(n), np.arange(n)[::-1]) / (0.02 * hz))
        parts.append(x * ramp)
    word_sound = np.concatenate(parts)
    word_sound *= 0.1 / np.sqrt(np.mean(word_sound**2))
    out = np.concatenate([np.zeros(hz // 5), word_sound, np.zeros(hz // 5)])
    return (out + rng.normal(0.0, 3e-4, len(out))).astype(np.float32)


def sentence(words: list[str], *, take: int = 9, hz: int = HZ, gap_s: float = 1.2) -> npt.NDArray[np.float32]:
    """The words with room noise before, between and after."""
    rng = np.random.default_rng(4)
    parts = [rng.normal(0.0, 3e-4, 2 * hz)]
    for number, word in enumerate(words):
        parts += [say(word, take + number, hz), rng.normal(0.0, 3e-4, int(gap_s * hz))]
    return np.concatenate(parts).astype(np.float32)


@pytest.fixture(scope="session")
def word_folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Three takes of each word as `<word>_<n>.wav`."""
    import soundfile

    folder = tmp_path_factory.mktemp("words")
    for word in MELODIES:
        for take in range(3):
            soundfile.write(str(folder / f"{word}_{take}.wav"), say(word, take), HZ)
    return folder


@pytest.fixture(scope="session")
def speak():  # type: ignore[no-untyped-def]
    """The voice, for tests that need single takes."""
    return say


@pytest.fixture(scope="session")
def sentence_of():  # type: ignore[no-untyped-def]
    """The voice, for tests that need a stream."""
    return sentence

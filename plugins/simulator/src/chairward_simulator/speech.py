"""The recorded words of the simulated person: one synthetic speaker, made by tools/make_words.py.

words/templates/<word>_<n>.wav: what the person enrolled. words/say/<word>_<n>.wav: what the person says.
"""

from __future__ import annotations

import wave
from functools import cache
from pathlib import Path

import numpy as np

from chairward.stages import Floats

WORDS = ("front", "back", "left", "right", "reverse", "stop")
RATE_HZ = 16_000
FOLDER = Path(__file__).with_name("words")
TEMPLATES = FOLDER / "templates"
SAY = FOLDER / "say"


def say_file(word: str, utterance_id: int) -> Path:
    """The recording of the person's n-th utterance: repetitions take turns."""
    files = sorted(SAY.glob(f"{word}_*.wav"))
    if not files:
        raise FileNotFoundError(f"{SAY}: no recording of '{word}' (there are: {', '.join(WORDS)})")
    return files[utterance_id % len(files)]


@cache
def sound(path: Path) -> Floats:
    """Samples of a recording, -1..1, 16 kHz. Raises ValueError for any other format."""
    with wave.open(str(path)) as file:
        rate, channels, width = file.getframerate(), file.getnchannels(), file.getsampwidth()
        data = file.readframes(file.getnframes())
    if (rate, channels, width) != (RATE_HZ, 1, 2):
        raise ValueError(
            f"{path}: {rate} Hz, {channels} channels, {8 * width} bit: words are {RATE_HZ} Hz, mono, 16 bit; "
            "make them with make_words.py"
        )
    return np.frombuffer(data, dtype="<i2").astype(np.float32) / np.float32(32768.0)


def duration_s(word: str, utterance_id: int) -> float:
    """How long that utterance lasts."""
    return len(sound(say_file(word, utterance_id))) / RATE_HZ

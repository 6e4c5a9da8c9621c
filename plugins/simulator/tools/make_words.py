"""Make the spoken words of the simulated person: `python make_words.py` (needs the Debian packages flite and sox).

One synthetic speaker (flite's "slt"), every repetition with another speed, pitch and loudness; templates (what the
person has enrolled) and utterances (what the person says) are different renderings. 16 kHz, 16 bit, mono.
"""

from __future__ import annotations

import subprocess
import tempfile
import wave
from pathlib import Path

import numpy as np

WORDS = ("front", "back", "left", "right", "reverse", "stop")
FOLDER = Path(__file__).parents[1] / "src/chairward_simulator/words"
RATE_HZ = 16_000
PAD_S = 0.05
REPETITIONS = {"templates": 4, "say": 4}


def render(word: str, stretch: float, pitch_hz: float, shift_cents: float, folder: Path) -> np.ndarray:
    """One rendering, trimmed to the word with a little silence around it; peak at 1."""
    raw, out = folder / "raw.wav", folder / "out.wav"
    subprocess.run(
        ["flite", "-voice", "slt", "--setf", f"duration_stretch={stretch:.3f}",
         "--setf", f"int_f0_target_mean={pitch_hz:.1f}", "-t", f"{word}.", "-o", str(raw)],
        check=True,
    )  # fmt: skip
    subprocess.run(
        ["sox", "-R", str(raw), "-r", str(RATE_HZ), "-b", "16", "-c", "1", str(out), "pitch", f"{shift_cents:.0f}"],
        check=True,
    )
    with wave.open(str(out)) as file:
        sound = np.frombuffer(file.readframes(file.getnframes()), dtype="<i2") / 32768.0
    loud = np.flatnonzero(np.abs(sound) > 0.012 * np.abs(sound).max())
    pad = int(PAD_S * RATE_HZ)
    piece = sound[max(0, loud[0] - pad) : loud[-1] + pad]
    return piece / np.abs(piece).max()


def write(path: Path, sound: np.ndarray) -> None:
    """16 kHz, 16 bit, mono."""
    with wave.open(str(path), "wb") as file:
        file.setnchannels(1)
        file.setsampwidth(2)
        file.setframerate(RATE_HZ)
        file.writeframes(np.rint(np.clip(sound, -1.0, 1.0) * 32768.0).astype("<i2").tobytes())


def main() -> None:
    """Write all files."""
    rng = np.random.default_rng(7)
    with tempfile.TemporaryDirectory() as name:
        for kind, count in REPETITIONS.items():
            (FOLDER / kind).mkdir(parents=True, exist_ok=True)
            for word in WORDS:
                for n in range(1, count + 1):
                    sound = render(
                        word, rng.uniform(0.9, 1.15), rng.uniform(155, 190), rng.uniform(-60, 60), Path(name)
                    )
                    level = 0.5 * 10 ** (rng.uniform(-4, 2) / 20)
                    write(FOLDER / kind / f"{word}_{n}.wav", sound * level)


if __name__ == "__main__":
    main()

"""Sound files of any rate and width, at the rate that is wanted."""

from __future__ import annotations

import csv
from dataclasses import dataclass
from math import gcd
from pathlib import Path

import numpy as np

from chairward.components import DeviceLost
from chairward.stages import Floats

COLUMNS = ("path", "word", "speaker", "role")


class SoundFileError(DeviceLost):
    """A sound file or manifest that cannot be played: one sentence with its name."""


def read_sound(path: Path, rate_hz: int) -> Floats:
    """Mono float32 in -1..1 at rate_hz, whatever the file's rate, width and channels. Raises SoundFileError."""
    import soundfile  # type: ignore[import-untyped,unused-ignore]

    if not path.is_file():
        raise SoundFileError(f"{path}: there is no such sound file; correct the path in the chair file")
    try:
        data, rate = soundfile.read(str(path), dtype="float32", always_2d=True)
    except (soundfile.LibsndfileError, RuntimeError) as error:
        raise SoundFileError(f"{path}: cannot be read as sound ({error}); export it again as wav") from None
    samples = np.asarray(data.mean(axis=1), np.float32)
    if not len(samples) or not np.isfinite(samples).all():
        raise SoundFileError(f"{path}: holds no usable sound; export it again as wav")
    if rate < 8000:
        raise SoundFileError(f"{path}: recorded at {rate} Hz, words need at least 8000 Hz: record it again")
    if rate != rate_hz:
        from scipy.signal import resample_poly

        common = gcd(rate, rate_hz)
        samples = np.asarray(resample_poly(samples, rate_hz // common, rate // common), np.float32)
    return np.clip(samples, -1.0, 1.0)


@dataclass(frozen=True, slots=True)
class Word:
    """A recording of one word."""

    path: Path
    word: str


def words_of(manifest: Path, speaker: str, playlist: tuple[str, ...]) -> list[Word]:
    """The test recordings of one speaker: all in the file's order, or as the playlist says, each word's recordings in
    turn. Raises SoundFileError naming what is missing."""
    try:
        with manifest.open(newline="", encoding="utf-8") as file:
            reader = csv.DictReader(file)
            missing = [c for c in COLUMNS if c not in (reader.fieldnames or [])]
            if missing:
                raise SoundFileError(f"{manifest}: lacks the column(s) {', '.join(missing)}")
            every = list(reader)
    except (OSError, UnicodeDecodeError, csv.Error) as error:
        raise SoundFileError(f"{manifest}: the manifest cannot be read ({error})") from None
    rows = [row for row in every if row["role"] == "test"]
    enrolled = {row["speaker"] for row in every if row["role"] == "template"}
    order = [row["speaker"] for row in rows if row["speaker"] in enrolled] + [row["speaker"] for row in rows]
    who = speaker or (order[0] if order else "")
    mine = [Word(manifest.parent / row["path"], row["word"]) for row in rows if row["speaker"] == who]
    if not mine:
        known = ", ".join(sorted({row["speaker"] for row in rows})) or "nobody"
        raise SoundFileError(f"{manifest}: no test words of speaker '{who}' (there are: {known})")
    if not playlist:
        return mine
    by_word: dict[str, list[Word]] = {}
    for item in mine:
        by_word.setdefault(item.word, []).append(item)
    unknown = [word for word in playlist if word not in by_word]
    if unknown:
        raise SoundFileError(
            f"{manifest}: speaker '{who}' never says '{unknown[0]}' (says: {', '.join(sorted(by_word))})"
        )
    used = dict.fromkeys(by_word, 0)
    chosen = []
    for word in playlist:
        chosen.append(by_word[word][used[word] % len(by_word[word])])
        used[word] += 1
    return chosen


def word_bounds(samples: Floats, rate_hz: int) -> tuple[int, int]:
    """First and one past the last sample within 30 dB of the recording's loudest 10 ms."""
    tick = rate_hz // 100
    count = max(1, len(samples) // tick)
    level = np.sqrt((np.resize(samples, count * tick).reshape(count, tick) ** 2).mean(axis=1))
    loud = np.flatnonzero(level > level.max() * 10.0 ** (-30.0 / 20.0))
    return (int(loud[0]) * tick, int(loud[-1] + 1) * tick) if len(loud) else (0, len(samples))

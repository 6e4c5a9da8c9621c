"""Test streams: a person's utterances at random places in a long, continuous sound, with the truth about each.

Every utterance is brought to one speaking level and the room of its own recording goes on before and after it;
noise runs through the whole stream at the wanted distance from the words (SNR against the loudest 30 % of frames).
"""

from __future__ import annotations

import csv
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from chairward_voice_dtw.audio import Floats, SoundError, read_wav

STREAM_HZ = 16_000
TICK = STREAM_HZ // 100
COLUMNS = ("path", "word", "speaker", "role", "source")
LOUD_DB = 20.0
ROLES = ("template", "test", "unknown", "noise", "talk")


@dataclass(frozen=True, slots=True)
class Row:
    """One line of a manifest; path is absolute."""

    path: Path
    word: str
    speaker: str
    role: str
    source: str


def read_manifest(path: Path) -> list[Row]:
    """The rows of a manifest. Raises SoundError naming file, line and what is wrong."""
    try:
        with path.open(newline="", encoding="utf-8") as file:
            reader = csv.DictReader(file)
            missing = [c for c in COLUMNS if c not in (reader.fieldnames or [])]
            if missing:
                raise SoundError(
                    f"{path}: the manifest lacks the column(s) {', '.join(missing)}; it needs {', '.join(COLUMNS)}"
                )
            rows = []
            for line, row in enumerate(reader, start=2):
                if row["role"] not in ROLES:
                    raise SoundError(f"{path}:{line}: role '{row['role']}', allowed are {', '.join(ROLES)}")
                rows.append(Row(path.parent / row["path"], row["word"], row["speaker"], row["role"], row["source"]))
    except OSError as error:
        raise SoundError(f"{path}: the manifest cannot be read ({error.strerror})") from None
    except (UnicodeDecodeError, csv.Error):
        raise SoundError(f"{path}: the manifest is not a UTF-8 csv file") from None
    if not rows:
        raise SoundError(f"{path}: the manifest has no rows")
    return rows


def family(row: Row) -> str:
    """Short name of a corpus, from the speaker's prefix ("asc_00000006" -> "asc"), else the source column."""
    return row.speaker.split("_")[0] if "_" in row.speaker else row.source


def frame_rms(samples: Floats) -> Floats:
    """Level of each whole 10 ms at STREAM_HZ."""
    count = len(samples) // TICK
    return np.asarray(np.sqrt((samples[: count * TICK].reshape(count, TICK) ** 2).mean(axis=1) + 1e-12), np.float32)


def active_rms(samples: Floats) -> float:
    """Level of the loudest 30 % of 10 ms frames."""
    power = np.sort(frame_rms(samples) ** 2)
    return float(np.sqrt(power[-max(5, int(0.3 * len(power))) :].mean() + 1e-12))


def word_bounds(samples: Floats, under_db: float = 30.0) -> tuple[int, int]:
    """First and one past the last sample of the word in a clean recording: frames within under_db of the loudest, or
    within three quarters of the way to the quietest where that is less, at least 3 in a row."""
    level = 20.0 * np.log10(np.convolve(frame_rms(samples), np.ones(3) / 3.0, mode="same") + 1e-9)
    top, bottom = np.percentile(level, 97), np.percentile(level, 5)
    line = top - min(under_db, 0.75 * (top - bottom))
    loud = level > line
    solid = loud.copy()
    solid[1:-1] &= loud[:-2] & loud[2:]
    where = np.flatnonzero(solid)
    if not len(where):
        return 0, len(samples)
    return int(max(where[0] - 1, 0) * TICK), int(min(where[-1] + 2, len(level)) * TICK)


def load(path: Path) -> Floats:
    """A recording at STREAM_HZ without its mean."""
    samples, _ = read_wav(path, STREAM_HZ)
    return np.asarray(samples - samples.mean(), np.float32)


def room_tone(samples: Floats, length: int, rng: np.random.Generator) -> Floats:
    """`length` samples of the recording's own background: random 40 ms grains of its quietest tenth, overlapped."""
    grain = 4 * TICK
    starts = np.arange(0, max(1, len(samples) - grain), TICK)
    power = np.array([float((samples[s : s + grain] ** 2).mean()) for s in starts])
    quiet = starts[np.argsort(power)[: max(3, len(starts) // 10)]]
    window = np.sin(np.pi * (np.arange(grain) + 0.5) / grain).astype(np.float32)
    out = np.zeros(length + grain, np.float32)
    for at in range(0, length, grain // 2):
        start = int(quiet[rng.integers(len(quiet))])
        piece = samples[start : start + grain]
        out[at : at + len(piece)] += piece * window[: len(piece)] * (1.0 if rng.random() < 0.5 else -1.0)
    loudest = 0.02 * active_rms(samples)
    level = float(np.sqrt((out**2).mean() + 1e-12))
    out *= min(1.0, loudest / level)
    out += rng.normal(0.0, active_rms(samples) * 1e-3, len(out)).astype(np.float32)
    return out[:length]


@dataclass(frozen=True, slots=True)
class Placed:
    """An utterance in a stream: the word's bounds in seconds of the stream, its own label and role.

    loud_end_s: where it is last within LOUD_DB of its loudest; breath and room follow, which noise covers.
    """

    word: str
    role: str
    onset_s: float
    end_s: float
    from_s: float
    to_s: float
    loud_end_s: float


@dataclass(frozen=True, slots=True)
class Stream:
    """samples at STREAM_HZ and what was put where, in order."""

    samples: Floats
    placed: tuple[Placed, ...]


def noise_bed(clips: Sequence[Floats], length: int, rng: np.random.Generator) -> Floats:
    """One noise, from a random place on, repeated with cross-faded seams to the wanted length; unit level."""
    clip = clips[int(rng.integers(len(clips)))]
    fade = min(STREAM_HZ // 10, len(clip) // 4)
    ramp = np.linspace(0.0, 1.0, fade, dtype=np.float32)
    loop = clip[: len(clip) - fade].copy()
    loop[:fade] = loop[:fade] * np.sqrt(ramp) + clip[len(clip) - fade :] * np.sqrt(1.0 - ramp)
    start = int(rng.integers(len(loop)))
    bed = np.resize(np.roll(loop, -start), length).astype(np.float32)
    return np.asarray(bed / np.sqrt((bed**2).mean() + 1e-12), np.float32)


def embed(
    utterances: Sequence[tuple[Row, Floats]],
    noises: Sequence[Floats],
    snr_db: float | None,
    rng: np.random.Generator,
    *,
    level_dbfs: float = -26.0,
    gain_db: float = 0.0,
    lead_s: float = 2.5,
    gap_s: tuple[float, float] = (0.9, 2.1),
) -> Stream:
    """The utterances in random order, each somewhere between silences; snr_db None: only each recording's own room.

    gain_db: of the words over level_dbfs, to which the noise keeps its distance.
    """
    level = 10.0 ** (level_dbfs / 20.0)
    word_level = level * 10.0 ** (gain_db / 20.0)
    parts: list[Floats] = []
    placed: list[Placed] = []
    now = 0
    order = rng.permutation(len(utterances))
    for number, which in enumerate(order):
        row, clip = utterances[int(which)]
        clip = clip * np.float32(word_level / active_rms(clip))
        before = int(STREAM_HZ * (lead_s if number == 0 else rng.uniform(*gap_s) / 2.0))
        after = int(STREAM_HZ * rng.uniform(*gap_s) / 2.0)
        cell = room_tone(clip, before + len(clip) + after, rng)
        ramp = np.minimum(1.0, np.minimum(np.arange(len(clip)), np.arange(len(clip))[::-1]) / (2.0 * TICK))
        cell[before : before + len(clip)] *= np.float32(1.0) - ramp.astype(np.float32)
        cell[before : before + len(clip)] += clip * ramp.astype(np.float32)
        first, last = word_bounds(clip)
        begin = now + before
        placed.append(
            Placed(
                row.word,
                row.role,
                (begin + first) / STREAM_HZ,
                (begin + last) / STREAM_HZ,
                now / STREAM_HZ,
                (now + len(cell)) / STREAM_HZ,
                (begin + word_bounds(clip, LOUD_DB)[1]) / STREAM_HZ,
            )
        )
        parts.append(cell)
        now += len(cell)
    parts.append(room_tone(utterances[int(order[-1])][1] * np.float32(level), STREAM_HZ, rng))
    samples = np.concatenate(parts)
    if snr_db is not None:
        samples = samples + noise_bed(noises, len(samples), rng) * np.float32(level * 10.0 ** (-snr_db / 20.0))
    return Stream(np.clip(samples, -1.0, 1.0).astype(np.float32), tuple(placed))


def by_role(rows: Sequence[Row], speaker: str) -> Mapping[str, list[Row]]:
    """A speaker's rows by role."""
    return {role: [r for r in rows if r.speaker == speaker and r.role == role] for role in ROLES}


def babble(
    unknown: Sequence[Floats],
    talk: Sequence[Floats],
    noises: Sequence[Floats],
    seconds: float,
    rng: np.random.Generator,
) -> Floats:
    """Sound without commands: 15 s scenes of one noise at -60..-25 dBFS with talk, single words, or nothing over it."""
    length = int(seconds * STREAM_HZ)
    out = np.zeros(length, np.float32)
    scene = 15 * STREAM_HZ
    for at in range(0, length, scene):
        size = min(scene, length - at)
        piece = rng.normal(0.0, 10.0 ** (-75.0 / 20.0), size).astype(np.float32)
        if noises:
            piece += noise_bed(noises, size, rng) * np.float32(10.0 ** (rng.uniform(-60.0, -25.0) / 20.0))
        kind = rng.random()
        voices = talk if kind < 0.35 and talk else unknown if kind < 0.85 else []
        now = int(rng.uniform(0.3, 1.5) * STREAM_HZ)
        level = rng.uniform(-42.0, -20.0)
        while voices and now < size:
            clip = voices[int(rng.integers(len(voices)))]
            clip = clip * np.float32(10.0 ** ((level + rng.uniform(-4.0, 4.0)) / 20.0) / active_rms(clip))
            clip = clip[: size - now]
            piece[now : now + len(clip)] += clip
            now += len(clip) + int(rng.uniform(0.3, 2.0) * STREAM_HZ)
        out[at : at + size] = piece
    return np.clip(out, -1.0, 1.0)

"""A person's recordings turned into templates: the same segmenter and the same features as what is heard later."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from chairward_voice_dtw.audio import RATE_HZ, Floats, SoundError, read_wav, resample
from chairward_voice_dtw.segmenter import LISTENERS, Segment, Segmenter
from chairward_voice_dtw.streams import STREAM_HZ, active_rms, read_manifest, room_tone, word_bounds


@dataclass(frozen=True, slots=True)
class Template:
    """One repetition of a word. mel: n x BANDS power, pads included. noise: of its room. name: for messages.

    sound: at RATE_HZ, with LEAD_S and TAIL_S of the recording's own room around it. onset_s, end_s: of the word in it.
    pitch: log2 Hz, NaN when it is not known.
    """

    word: str
    mel: Floats
    noise: Floats
    name: str
    sound: Floats
    onset_s: float
    end_s: float
    pitch: float


LEAD_S, TAIL_S = 1.5, 0.3
LEVEL_DBFS = -26.0


def at_level(samples: Floats) -> Floats:
    """Without its mean, its loud part at LEVEL_DBFS."""
    samples = np.asarray(samples - samples.mean(), np.float32)
    return samples * np.float32(10.0 ** (LEVEL_DBFS / 20.0) / active_rms(samples))


def cut_out(samples: Floats) -> Segment | None:
    """The word of a recording at STREAM_HZ, as the streaming path would find it in the recording's own room."""
    samples = at_level(samples)
    rng = np.random.default_rng(1)
    before, after = (room_tone(samples, n, rng) for n in (2 * STREAM_HZ, STREAM_HZ))
    sound = resample(np.concatenate([before, samples, after]), STREAM_HZ, RATE_HZ)
    found = [s for s in Segmenter((LISTENERS[0],)).push(sound) if not s.too_long]
    return max(found, key=lambda s: s.peak_db * (s.last - s.first), default=None)


def make_template(word: str, samples: Floats, name: str = "") -> Template:
    """Raises SoundError when no word stands out of the recording."""
    segment = cut_out(samples)
    if segment is None:
        raise SoundError(f"{name or word}: no word stands out of the background; record it again, louder or nearer")
    samples = at_level(samples)
    first, last = word_bounds(samples)
    rng = np.random.default_rng(2)
    lead, tail = (room_tone(samples, int(s * STREAM_HZ), rng) for s in (LEAD_S, TAIL_S))
    sound = resample(np.concatenate([lead, samples, tail]), STREAM_HZ, RATE_HZ)
    onset_s, end_s = (LEAD_S + at / STREAM_HZ for at in (first, last))
    return Template(word, segment.mel, segment.noise, name, sound, onset_s, end_s, segment.pitch)


def from_files(files: Mapping[str, Sequence[Path]]) -> list[Template]:
    """Templates of wav files by word. Raises SoundError."""
    return [
        make_template(word, read_wav(path, STREAM_HZ)[0], str(path)) for word, paths in files.items() for path in paths
    ]


def files_of_folder(folder: Path) -> dict[str, list[Path]]:
    """Recordings named `<word>_<n>.wav`, or `<word>/<n>.wav`. Raises SoundError when there are none."""
    if not folder.is_dir():
        raise SoundError(f"{folder}: there is no such folder of word recordings (<word>_<n>.wav)")
    files: dict[str, list[Path]] = {}
    for path in sorted(folder.glob("*.wav")):
        files.setdefault(path.stem.rsplit("_", 1)[0], []).append(path)
    for path in sorted(folder.glob("*/*.wav")):
        files.setdefault(path.parent.name, []).append(path)
    if not files:
        raise SoundError(f"{folder}: holds no word recordings; name them <word>_<n>.wav")
    return files


def files_of_manifest(manifest: Path, speaker: str) -> dict[str, list[Path]]:
    """The template rows of one speaker. Raises SoundError.

    speaker "": the first in the manifest with test and template rows (as the microphone plays), else with templates.
    """
    every = read_manifest(manifest)
    rows = [row for row in every if row.role == "template"]
    enrolled = {row.speaker for row in rows}
    order = [r.speaker for r in every if r.role == "test" and r.speaker in enrolled] + [r.speaker for r in rows]
    who = speaker or (order[0] if order else "")
    files: dict[str, list[Path]] = {}
    for row in rows:
        if row.speaker == who:
            files.setdefault(row.word, []).append(row.path)
    if not files:
        known = ", ".join(sorted(enrolled)) or "none"
        raise SoundError(f"{manifest}: no template rows of speaker '{who}' (there are: {known})")
    return files

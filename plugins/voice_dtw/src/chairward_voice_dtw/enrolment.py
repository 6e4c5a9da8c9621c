"""Are these repetitions good enough to recognise a word by, and do two words sound alike?"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import numpy.typing as npt

from chairward_voice_dtw import dtw
from chairward_voice_dtw.audio import Floats, SoundError
from chairward_voice_dtw.engine import Thresholds, Voice
from chairward_voice_dtw.frontend import features, subtract
from chairward_voice_dtw.streams import STREAM_HZ, active_rms, frame_rms
from chairward_voice_dtw.templates import Template, from_files, make_template
from chairward_voice_dtw.trial import hear

FEWEST, MOST = 3, 5
QUIET_DBFS = -50.0
CLIPPED_SHARE = 0.002
ODD_ONE_OUT = 1.45
ALIKE = 1.35


def sound_problem(samples: Floats) -> str:
    """ "" or what is wrong with one recording, by itself."""
    peak = float(np.max(np.abs(samples)))
    level = 20.0 * float(np.log10(active_rms(samples)))
    if level < QUIET_DBFS:
        return f"too quiet ({level:.0f} dBFS, at least {QUIET_DBFS:.0f}): speak up, or raise the microphone's level"
    if peak >= 0.98 and float(np.mean(np.abs(samples) >= 0.98 * peak)) > CLIPPED_SHARE:
        return "clipped (too loud for the microphone): lower its level or move away"
    frames = np.sort(frame_rms(samples))
    contrast = 20.0 * float(np.log10(frames[-len(frames) // 5] / frames[len(frames) // 20]))
    if len(samples) >= STREAM_HZ and contrast < 8.0:
        return f"the word hardly stands out of the noise ({contrast:.0f} dB, at least 8): find a quieter place"
    return ""


def table_of(templates: Sequence[Template]) -> npt.NDArray[np.float64]:
    """Distances of all templates to all."""
    packed, lengths = dtw.pack([features(subtract(t.mel, t.noise)) for t in templates])
    return np.array([dtw.distances(packed[i, : lengths[i]], packed, lengths) for i in range(len(templates))])


def check(word: str, recordings: Sequence[tuple[str, Floats]]) -> list[str]:
    """One sentence for each thing that is wrong with the repetitions (name, samples at STREAM_HZ) of a word."""
    problems = []
    if len(recordings) < FEWEST:
        problems.append(f"'{word}': {len(recordings)} repetition(s), at least {FEWEST} are needed ({MOST} are better)")
    templates = []
    for name, samples in recordings:
        problem = sound_problem(samples)
        if problem:
            problems.append(f"{name}: {problem}")
            continue
        try:
            templates.append(make_template(word, samples, name))
        except SoundError as error:
            problems.append(str(error))
    if len(templates) >= 3:
        table = table_of(templates)
        to_others = np.array([np.median(np.delete(row, i)) for i, row in enumerate(table)])
        for i, template in enumerate(templates):
            usual = float(np.median(np.delete(to_others, i)))
            if to_others[i] > ODD_ONE_OUT * usual:
                problems.append(
                    f"{template.name}: sounds unlike the other repetitions of '{word}' "
                    f"({to_others[i] / usual:.1f} times as far apart as they are): record it again"
                )
    return problems


def tried(
    word: str, recordings: Sequence[tuple[str, Floats]], trial: Floats, others: Mapping[str, Sequence[Path]]
) -> list[str]:
    """A sentence if the new recordings of a word, among the person's other words, do not recognise one more take."""
    kept = {name: paths for name, paths in others.items() if name != word}
    templates = [*from_files(kept), *(make_template(word, samples, name) for name, samples in recordings)]
    heard = hear(Voice(templates), Thresholds(), trial)
    if heard is None:
        return [f"'{word}', tried once more: no word stands out of the background"]
    if heard.word != word:
        return [f"'{word}', tried once more, was taken for '{heard.word}': record it again, or choose another word"]
    return []


@dataclass(frozen=True, slots=True)
class Separability:
    """nearest: each word's nearest other word, its distance in units of the word's own spread.

    warnings: sentences."""

    nearest: Mapping[str, tuple[str, float]]
    warnings: tuple[str, ...]


def separability(templates: Sequence[Template]) -> Separability:
    """How far apart the words are."""
    names = sorted({t.word for t in templates})
    table = table_of(templates)
    of = np.array([names.index(t.word) for t in templates])
    nearest: dict[str, tuple[str, float]] = {}
    warnings = []
    for w, word in enumerate(names):
        mine = np.flatnonzero(of == w)
        inside = table[np.ix_(mine, mine)]
        own = inside.sum() / (len(mine) * (len(mine) - 1)) if len(mine) > 1 else np.nan
        gaps = {names[v]: float(np.min(table[np.ix_(mine, of == v)])) for v in range(len(names)) if v != w}
        if not gaps:
            nearest[word] = ("", float("inf"))
            continue
        other = min(gaps, key=lambda name: gaps[name])
        ratio = gaps[other] / own if np.isfinite(own) else float("inf")
        nearest[word] = (other, ratio)
        if ratio < ALIKE and (other not in nearest or nearest[other][0] != word):
            warnings.append(
                f"'{word}' and '{other}' sound alike: choose another word for one of them, or more recordings"
            )
    return Separability(nearest, tuple(warnings))

"""Gathers evidence on development recordings and fits the score's weights (see calibration.py)."""

from __future__ import annotations

import zlib
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import numpy.typing as npt

from chairward_voice_dtw import calibration
from chairward_voice_dtw.audio import RATE_HZ, Floats
from chairward_voice_dtw.engine import DtwEngine, Thresholds, Voice, frame_end_s
from chairward_voice_dtw.evaluate import speakers_of
from chairward_voice_dtw.frontend import HOP
from chairward_voice_dtw.matcher import Measures
from chairward_voice_dtw.streams import STREAM_HZ, Placed, babble, by_role, embed, load, read_manifest
from chairward_voice_dtw.templates import from_files

SNRS = (None, 20.0, 10.0, 5.0)
BABBLE_S = 150.0
NEAR_END_S = 0.35


@dataclass(frozen=True, slots=True)
class Example:
    """Evidence of one offered stretch, whether its word was said, and by whom the words were enrolled."""

    evidence: npt.NDArray[np.float64]
    said: bool
    speaker: str


def offers(voice: Voice, samples: Floats) -> list[Measures]:
    """All that could be a word in a stream, measured."""
    engine = DtwEngine(voice, Thresholds(), STREAM_HZ)
    found = []
    for at in range(0, len(samples), STREAM_HZ // 10):
        for segment, spotted in engine.offers(samples[at : at + STREAM_HZ // 10]):
            if not segment.too_long:
                found.append(voice.matcher.measure(segment, spotted))
    return found


def said_in(measures: Measures, placed: tuple[Placed, ...]) -> Placed | None:
    """The utterance that a stretch overlaps and whose end it is near, if any."""
    onset, end = measures.segment.first * HOP / RATE_HZ, frame_end_s(measures.segment.last)
    over = [p for p in placed if onset < p.end_s + 0.1 and end > p.onset_s - 0.1]
    return next((p for p in over if end < p.end_s + NEAR_END_S), None)


def gather(manifest: Path, say: Callable[[str], None], *, embedding: bool, seed: int = 5) -> list[Example]:
    """Examples of every speaker: own words, unknown words, and other people's talk, in clean and noisy streams.

    A known word is also compared with the vocabulary without it: words that are nearly right must be refused too.
    """
    rows = read_manifest(manifest)
    noises, talk, strangers = ([load(r.path) for r in rows if r.role == role] for role in ("noise", "talk", "unknown"))
    examples: list[Example] = []
    for speaker in speakers_of(rows):
        roles = by_role(rows, speaker)
        files: dict[str, list[Path]] = {}
        for row in roles["template"]:
            files.setdefault(row.word, []).append(row.path)
        voice = Voice(from_files(files), embedding=embedding)
        utterances = [(row, load(row.path)) for row in [*roles["test"], *roles["unknown"]]]
        for snr in SNRS:
            rng = np.random.default_rng([seed, zlib.crc32(speaker.encode()), 99 if snr is None else int(snr)])
            stream = embed(utterances, noises, snr, rng, level_dbfs=float(rng.uniform(-32.0, -20.0)))
            for measures in offers(voice, stream.samples):
                over = said_in(measures, stream.placed)
                label = over.word if over is not None and over.role == "test" else ""
                verdict = voice.matcher.weigh(measures)
                examples.append(Example(verdict.evidence, verdict.word == label, speaker))
                if label in voice.matcher.words and len(voice.matcher.words) > 2:
                    examples.append(Example(voice.matcher.weigh(measures, without=label).evidence, False, speaker))
        rng = np.random.default_rng([seed, zlib.crc32(speaker.encode()), 77])
        strange = offers(voice, babble(strangers, talk, noises, BABBLE_S, rng))
        examples += [Example(voice.matcher.weigh(measures).evidence, False, speaker) for measures in strange]
        say(f"{speaker}: {len(examples)} examples so far")
    return examples


def fit(examples: list[Example]) -> tuple[npt.NDArray[np.float64], float]:
    """Weights and bias from all examples."""
    return calibration.fit(np.array([e.evidence for e in examples]), np.array([e.said for e in examples]))


def table(name: str, weights: npt.NDArray[np.float64], bias: float) -> str:
    """As it stands in calibration.py."""
    lines = ",\n".join(f"        {w:.3f}" for w in weights)
    return f"{name} = np.array(\n    [\n{lines},\n    ]\n)\n{name}_BIAS = {bias:.3f}\n"

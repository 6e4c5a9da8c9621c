"""Gathers evidence on development recordings and fits the score's weights (see calibration.py)."""

from __future__ import annotations

import zlib
from collections.abc import Callable
from pathlib import Path

import numpy as np
import numpy.typing as npt

from chairward_voice_dtw import calibration
from chairward_voice_dtw.audio import RATE_HZ, Floats
from chairward_voice_dtw.engine import frame_end_s
from chairward_voice_dtw.evaluate import speakers_of
from chairward_voice_dtw.frontend import HOP
from chairward_voice_dtw.matcher import Matcher
from chairward_voice_dtw.segmenter import Segment, Segmenter
from chairward_voice_dtw.streams import STREAM_HZ, babble, by_role, embed, load, read_manifest
from chairward_voice_dtw.templates import from_files

SNRS = (None, 20.0, 15.0, 10.0, 5.0)


def segments(samples: Floats) -> list[Segment]:
    """All that could be a word in a stream."""
    segmenter = Segmenter(STREAM_HZ)
    found = [s for at in range(0, len(samples), STREAM_HZ) for s in segmenter.push(samples[at : at + STREAM_HZ])]
    return [s for s in found if not s.too_long]


def gather(
    manifest: Path, say: Callable[[str], None], seed: int = 5, babble_s: float = 180.0
) -> tuple[npt.NDArray[np.float64], npt.NDArray[np.bool_], npt.NDArray[np.str_]]:
    """Evidence (n x len(EVIDENCE)), whether its word was said, and the speaker of each segment."""
    rows = read_manifest(manifest)
    noises = [load(r.path) for r in rows if r.role == "noise"]
    talk = [load(r.path) for r in rows if r.role == "talk"]
    strangers = [load(r.path) for r in rows if r.role == "unknown"]
    evidence: list[npt.NDArray[np.float64]] = []
    said: list[bool] = []
    who: list[str] = []
    for speaker in speakers_of(rows):
        roles = by_role(rows, speaker)
        files: dict[str, list[Path]] = {}
        for row in roles["template"]:
            files.setdefault(row.word, []).append(row.path)
        templates = from_files(files)
        matcher = Matcher(templates)
        without = {word: Matcher([t for t in templates if t.word != word]) for word in matcher.words}
        utterances = [(row, load(row.path)) for row in [*roles["test"], *roles["unknown"]]]
        for snr in SNRS:
            rng = np.random.default_rng([seed, zlib.crc32(speaker.encode()), 99 if snr is None else int(snr)])
            stream = embed(utterances, noises, snr, rng, level_dbfs=float(rng.uniform(-32.0, -20.0)))
            for segment in segments(stream.samples):
                onset, end = segment.first * HOP / RATE_HZ, frame_end_s(segment.last)
                over = [p for p in stream.placed if onset < p.end_s + 0.1 and end > p.onset_s - 0.1]
                label = over[0].word if over and over[0].role == "test" else None
                verdict = matcher.judge(segment)
                evidence.append(verdict.evidence)
                said.append(verdict.word == label)
                who.append(speaker)
                if label in without:
                    evidence.append(without[label].judge(segment).evidence)
                    said.append(False)
                    who.append(speaker)
        rng = np.random.default_rng([seed, zlib.crc32(speaker.encode()), 77])
        for segment in segments(babble(strangers, talk, noises, babble_s, rng)):
            evidence.append(matcher.judge(segment).evidence)
            said.append(False)
            who.append(speaker)
        say(f"{speaker}: {len(said)} segments so far")
    return np.array(evidence), np.array(said), np.array(who)


def table(weights: npt.NDArray[np.float64], bias: float) -> str:
    """As it stands in calibration.py."""
    lines = ",\n".join(f"        {w:.3f}" for w in weights)
    return f"WEIGHTS = np.array(\n    [\n{lines},\n    ]\n)\nBIAS = {bias:.3f}\n"


def fit(manifest: Path, say: Callable[[str], None]) -> str:
    """The new table, from everything in the manifest."""
    x, said, _ = gather(manifest, say)
    return table(*calibration.fit(x, said))

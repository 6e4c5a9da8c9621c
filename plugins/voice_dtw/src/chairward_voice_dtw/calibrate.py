"""Gathers evidence on development recordings, fits the score (calibration.py), and tells how it does on strangers.

Every speaker's words are put in streams with one half of the noises and with the other, so that the score can be tried
on speakers *and* noises that it was not fitted to. Every speaker enrols twice: the template rows, and the test rows.
"""

from __future__ import annotations

import zlib
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import product
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from chairward_voice_dtw import calibration
from chairward_voice_dtw.audio import RATE_HZ, Floats
from chairward_voice_dtw.engine import NEVER, DtwEngine, Thresholds, Voice, frame_end_s
from chairward_voice_dtw.evaluate import BLOCK, speakers_of
from chairward_voice_dtw.figures import accepted_at, equal_error_rate_pct, rate_per_hour, share
from chairward_voice_dtw.frontend import HOP
from chairward_voice_dtw.matcher import Matcher, Measures
from chairward_voice_dtw.streams import STREAM_HZ, Placed, Row, babble, by_role, embed, load, read_manifest
from chairward_voice_dtw.templates import from_files

SNRS: tuple[float | None, ...] = (None, 20.0, 15.0, 10.0, 5.0)
PLAIN_SNRS: tuple[float | None, ...] = (None, 10.0, 5.0)
"""dB; fewer without the speech embedding, whose score has less to learn."""
REPETITIONS = 3
BABBLE = "babble"
BABBLE_S = 360.0
"""As much as of all the streams with commands: it is what a chair hears all day."""
NEAR_END_S = 0.35
FOLDS = 4
Stream = tuple[str, int, int]
LINES = (-2.0, -1.0, -0.5, 0.0, 0.5, 1.0, 1.5, 2.0, 3.0)


@dataclass(frozen=True, slots=True, kw_only=True)
class Example:
    """Evidence of one offered stretch and whether its word was said. speaker: who enrolled the words.

    enrolment: 0 or 1. half: of the noises. snr: dB, None for clean, BABBLE for sound without commands. placed: its
    utterance. counted: a stretch as it is offered; else one made for the fit, against the vocabulary without its word.
    """

    evidence: npt.NDArray[np.float64]
    said: bool
    speaker: str
    enrolment: int
    half: int
    snr: float | str | None
    onset_s: float
    end_s: float
    placed: Placed | None = None
    counted: bool = True


def offers(voice: Voice, samples: Floats) -> list[Measures]:
    """All that could be a word in a stream, measured."""
    engine = DtwEngine(voice, Thresholds(), STREAM_HZ, at_once=True)
    found = []
    for at in range(0, len(samples), BLOCK):
        for segment, spotted in engine.offers(samples[at : at + BLOCK]):
            if not segment.too_long:
                found.append(voice.matcher.measure(segment, spotted))
    return found


def said_in(onset_s: float, end_s: float, placed: Sequence[Placed]) -> Placed | None:
    """The utterance that a stretch overlaps and whose end it is near, if any."""
    over = [p for p in placed if onset_s < p.end_s + 0.1 and end_s > p.onset_s - 0.1]
    return next((p for p in over if end_s < p.end_s + NEAR_END_S), None)


def examples_of(
    matcher: Matcher, measured: Sequence[Measures], placed: Sequence[Placed], **known: Any
) -> list[Example]:
    """Examples of one stream. A known word is also compared with the vocabulary without it: words that are nearly right
    must be refused too."""
    examples = []
    for measures in measured:
        onset_s, end_s = measures.segment.first * HOP / RATE_HZ, frame_end_s(measures.segment.last)
        over = said_in(onset_s, end_s, placed)
        label = over.word if over is not None and over.role == "test" else ""
        known |= {"onset_s": onset_s, "end_s": end_s, "placed": over}
        word, evidence = matcher.evidence(measures)
        examples.append(Example(evidence=evidence, said=word == label, **known))
        if label in matcher.words and len(matcher.words) > 2:
            _, evidence = matcher.evidence(measures, without=label)
            examples.append(Example(evidence=evidence, said=False, counted=False, **known))
    return examples


def halves(rows: Sequence[Row], role: str) -> list[list[Floats]]:
    """The sounds of a role, every second one."""
    sounds = [load(row.path) for row in rows if row.role == role]
    return [sounds[0::2], sounds[1::2]]


def enrolments(roles: Mapping[str, Sequence[Row]]) -> list[tuple[dict[str, list[Path]], list[Row]]]:
    """What a speaker may enrol, by word, and what is then said: the template and the test rows, and the other way round
    as far as there are REPETITIONS of a word."""
    found = []
    for enrolled, said in (("template", "test"), ("test", "template")):
        files: dict[str, list[Path]] = {}
        for row in roles[enrolled]:
            files.setdefault(row.word, []).append(row.path)
        files = {word: paths[:REPETITIONS] for word, paths in files.items() if len(paths) >= REPETITIONS}
        if len(files) > 2:
            found.append((files, [replace(row, role="test") for row in roles[said] if row.word in files]))
    return found


def gather(manifest: Path, say: Callable[[str], None], *, embedding: bool, seed: int) -> list[Example]:
    """Examples of every speaker: own words, unknown words, and other people's talk, in clean and noisy streams."""
    rows = read_manifest(manifest)
    noises, talk = halves(rows, "noise"), halves(rows, "talk")
    strangers = [load(row.path) for row in rows if row.role == "unknown"]
    examples: list[Example] = []
    for speaker in speakers_of(rows):
        roles, who = by_role(rows, speaker), zlib.crc32(speaker.encode())
        for enrolment, (files, tests) in enumerate(enrolments(roles)):
            voice = Voice(from_files(files), embedding=embedding)
            utterances = [(row, load(row.path)) for row in [*tests, *roles["unknown"]]]
            for half, snr in product((0, 1), SNRS if embedding else PLAIN_SNRS):
                rng = np.random.default_rng([seed, who, enrolment, half, 99 if snr is None else int(snr)])
                stream = embed(utterances, noises[half], snr, rng, level_dbfs=float(rng.uniform(-32.0, -20.0)))
                known = {"speaker": speaker, "enrolment": enrolment, "half": half, "snr": snr}
                examples += examples_of(voice.matcher, offers(voice, stream.samples), stream.placed, **known)
            for half in (0, 1):
                rng = np.random.default_rng([seed, who, enrolment, half, 31337])
                measured = offers(voice, babble(strangers, talk[half], noises[half], BABBLE_S, rng))
                known = {"speaker": speaker, "enrolment": enrolment, "half": half, "snr": BABBLE}
                examples += examples_of(voice.matcher, measured, (), **known)
        say(f"{speaker}: {len(examples)} examples so far")
    return examples


def fit(examples: Sequence[Example]) -> calibration.Score:
    """The score from all examples."""
    return calibration.fit(np.array([e.evidence for e in examples]), np.array([e.said for e in examples]))


def held_back(examples: Sequence[Example]) -> npt.NDArray[np.float64]:
    """Each example's score by weights that saw neither its speaker nor its half of the noises."""
    speakers = sorted({e.speaker for e in examples})
    fold = np.array([speakers.index(e.speaker) % FOLDS for e in examples])
    half = np.array([e.half for e in examples])
    scores = np.zeros(len(examples))
    for f in range(FOLDS):
        for h in (0, 1):
            mine = [i for i in range(len(examples)) if fold[i] == f and half[i] == h]
            if not mine:
                continue
            found = fit([e for e, k, q in zip(examples, fold, half, strict=True) if k != f and q != h])
            scores[mine] = found.of(np.array([examples[i].evidence for i in mine]))
    return scores


def table(examples: Sequence[Example], scores: npt.NDArray[np.float64]) -> list[str]:
    """What one threshold for all words gives: right and accepted, unknown accepted, false accepts an hour."""
    best: dict[tuple[str, int, float | str | None, Placed], tuple[float, bool]] = {}
    strange: dict[Stream, list[tuple[Example, float]]] = {}
    for example, score in zip(examples, scores, strict=True):
        if example.counted and example.snr == BABBLE:
            strange.setdefault((example.speaker, example.enrolment, example.half), []).append((example, score))
        elif example.counted and example.placed is not None:
            key = (example.speaker, example.half, example.snr, example.placed)
            best[key] = max(best.get(key, (NEVER, False)), (float(score), example.said))
    lines = []
    for snr in dict.fromkeys(e.snr for e in examples if e.snr != BABBLE):
        known = [(s, said) for (_, _, q, p), (s, said) in best.items() if q == snr and p.role == "test"]
        unknown = [s for (_, _, q, p), (s, _) in best.items() if q == snr and p.role == "unknown"]
        right = [s if said else NEVER for s, said in known]
        at = "  ".join(
            f"{line:+.1f}: {share(sum(r >= line for r in right), len(right))['pct']} / "
            f"{share(sum(u >= line for u in unknown), len(unknown))['pct']}"
            for line in LINES
        )
        lines.append(
            f"{'clean' if snr is None else f'{snr} dB'}: {len(known)} known offered, {len(unknown)} unknown; EER "
            f"{equal_error_rate_pct(right, unknown)} %, unknown accepted at 95 % true accept "
            f"{accepted_at(right, unknown, 0.95)['pct']} %; right and accepted / unknown accepted by threshold: {at}"
        )
    hours = len(strange) * BABBLE_S / 3600.0
    rates = "  ".join(f"{line:+.1f}: {rate_per_hour(_accepts(strange, line), hours)['per_hour']}" for line in LINES)
    lines.append(f"false accepts an hour in {hours:.2f} h of noise, talk and unknown words: {rates}")
    return lines


def _accepts(strange: dict[Stream, list[tuple[Example, float]]], line: float) -> int:
    """How often a stretch passes that does not overlap the last one that passed."""
    count = 0
    for stream in strange.values():
        until = -1.0
        for example, score in stream:
            if score >= line and example.onset_s > until:
                count, until = count + 1, example.end_s
    return count

"""How good the ears are: streams with known truth through the streaming path, everything counted with its bounds."""

from __future__ import annotations

import time
import zlib
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from functools import cache, lru_cache
from pathlib import Path
from typing import Any

import numpy as np

from chairward_voice_dtw import calibration
from chairward_voice_dtw.audio import Floats, SoundError
from chairward_voice_dtw.embedding import network
from chairward_voice_dtw.engine import NEVER, Engine, Heard, Thresholds
from chairward_voice_dtw.figures import accepted_at, equal_error_rate_pct, percentiles, rate_per_hour, share
from chairward_voice_dtw.settings import EngineName, VoiceSettings
from chairward_voice_dtw.stage import EngineMaker
from chairward_voice_dtw.streams import STREAM_HZ, Placed, Row, babble, by_role, embed, load, read_manifest
from chairward_voice_dtw.variants import VARIANTS, said
from chairward_voice_dtw.workers import workers

BLOCK = STREAM_HZ // 2
"""How sound is cut changes nothing (the tests of the streaming laws say so): long blocks only save time."""
LINES = (-2.0, -1.5, -1.0, -0.5, 0.0, 0.5, 1.0, 1.5, 2.0, 2.5, 3.0)
ARM_EVERY_S = 180.0
Say = Callable[[str], None]


@dataclass(frozen=True, slots=True, kw_only=True)
class Plan:
    """What to evaluate; snrs in dB, None for clean. hours: of sound without commands, over all speakers.

    embedding: use the speech embedding where it is installed. variant: how the tested words are said.
    speakers: only these; none: all. weights: file of the score.
    """

    manifest: Path
    templates: int = 3
    snrs: tuple[float | None, ...] = (None, 20.0, 10.0, 5.0)
    hours: float = 3.0
    placements: int = 2
    engine: EngineName = "default"
    stop_word: str = "stop"
    seed: int = 1
    processes: int = 0
    embedding: bool = True
    variant: str = "usual"
    settings: VoiceSettings = field(default_factory=VoiceSettings)
    speakers: tuple[str, ...] = ()
    weights: Path = calibration.FILE


@dataclass(frozen=True, slots=True, kw_only=True)
class Trial:
    """One utterance and what became of it. heard: everything that overlaps it."""

    source: str
    speaker: str
    snr: float | None
    placed: Placed
    heard: tuple[Heard, ...]


@cache
def _rows(manifest: Path) -> list[Row]:
    return read_manifest(manifest)


@cache
def _sound(path: Path) -> Floats:
    return load(path)


def speakers_of(rows: Sequence[Row]) -> list[str]:
    """Speakers with template and test rows, in the manifest's order."""
    templates = {row.speaker for row in rows if row.role == "template"}
    return list(dict.fromkeys(r.speaker for r in rows if r.role == "test" and r.speaker in templates))


@lru_cache(maxsize=4)
def _maker(plan: Plan, speaker: str) -> EngineMaker:
    files: dict[str, list[Path]] = {}
    for row in by_role(_rows(plan.manifest), speaker)["template"]:
        if len(files.setdefault(row.word, [])) < plan.templates:
            files[row.word].append(row.path)
    thresholds = Thresholds(
        word=plan.settings.threshold, stop=plan.settings.stop_threshold, stop_words=frozenset({plan.stop_word})
    )
    return EngineMaker(files, thresholds, plan.engine, embedding=plan.embedding, weights=plan.weights)


def _engine(plan: Plan, speaker: str, *, at_once: bool = True) -> Engine:
    return _maker(plan, speaker).make(STREAM_HZ, at_once=at_once)


def listen(engine: Engine, samples: Floats, block: int = BLOCK) -> list[Heard]:
    """Everything that the engine hears in a stream."""
    return [heard for at in range(0, len(samples), block) for heard in engine.push(samples[at : at + block])]


def _noises(plan: Plan) -> list[Floats]:
    return [_sound(row.path) for row in _rows(plan.manifest) if row.role == "noise"]


def trials(
    plan: Plan, speaker: str, snr: float | None, placement: int, make: Callable[[], Engine] | None = None
) -> list[Trial]:
    """One stream of one speaker's test and unknown utterances; `make` brings another engine than the plan's."""
    roles = by_role(_rows(plan.manifest), speaker)
    variant = VARIANTS[plan.variant]
    utterances = [(row, said(_sound(row.path), variant)) for row in [*roles["test"], *roles["unknown"]]]
    rng = np.random.default_rng([plan.seed, zlib.crc32(speaker.encode()), 999 if snr is None else int(snr), placement])
    level_dbfs = float(rng.uniform(-32.0, -20.0))
    stream = embed(utterances, _noises(plan), snr, rng, level_dbfs=level_dbfs, gain_db=variant.gain_db)
    heard = listen(make() if make else _engine(plan, speaker), stream.samples)
    source = roles["test"][0].source
    out = []
    for placed in stream.placed:
        mine = tuple(h for h in heard if h.onset_s < placed.end_s + 0.1 and h.end_s > placed.onset_s - 0.1)
        out.append(Trial(source=source, speaker=speaker, snr=snr, placed=placed, heard=mine))
    return out


def false_accepts(plan: Plan, speaker: str, seconds: float) -> tuple[float, list[Heard]]:
    """Hours of noise, talk and unknown words at varied levels, and everything that was heard in them."""
    rows = _rows(plan.manifest)
    rng = np.random.default_rng([plan.seed, zlib.crc32(speaker.encode()), 31337])
    unknown = [_sound(row.path) for row in rows if row.role == "unknown"]
    talk = [_sound(row.path) for row in rows if row.role == "talk"]
    engine = _engine(plan, speaker)
    found: list[Heard] = []
    done = 0.0
    while done < seconds:
        part = min(300.0, seconds - done)
        samples = babble(unknown, talk, _noises(plan), part, rng)
        found += [h for h in listen(engine, samples) if h.word]
        done += part
    return seconds / 3600.0, found


def computing(plan: Plan, speaker: str) -> tuple[float, list[float]]:
    """Of the whole path on a stream full of words in blocks of 10 ms: processor time for a second of sound, and of each
    block with which something was decided, ms."""
    roles = by_role(_rows(plan.manifest), speaker)
    utterances = [(row, _sound(row.path)) for row in roles["test"]]
    stream = embed(utterances, _noises(plan), 20.0, np.random.default_rng(plan.seed))
    engine = _engine(plan, speaker, at_once=False)
    listen(engine, stream.samples[: 2 * STREAM_HZ], STREAM_HZ // 100)
    total, deciding = 0.0, []
    for at in range(0, len(stream.samples), STREAM_HZ // 100):
        began = time.process_time()
        heard = engine.push(stream.samples[at : at + STREAM_HZ // 100])
        took = (time.process_time() - began) * 1e3
        total += took
        if heard:
            deciding.append(took)
    return total / (len(stream.samples) / STREAM_HZ), deciding


def _job(job: tuple[Any, ...]) -> Any:
    kind, *arguments = job
    work: dict[str, Callable[..., Any]] = {"trials": trials, "false": false_accepts, "computing": computing}
    return work[kind](*arguments)


def evaluate(plan: Plan, say: Say) -> dict[str, Any]:
    """Run everything; the report as plain values. `say` gets progress lines."""
    rows = _rows(plan.manifest)
    speakers = [s for s in speakers_of(rows) if s in plan.speakers or not plan.speakers]
    if not speakers:
        raise SoundError(f"{plan.manifest}: no speaker has both template and test rows")
    if any(snr is not None for snr in plan.snrs) and not any(row.role == "noise" for row in rows):
        raise SoundError(f"{plan.manifest}: has no noise rows; evaluate with --snr clean, or add some")
    jobs: list[tuple[Any, ...]] = [
        ("trials", plan, speaker, snr, p) for speaker in speakers for snr in plan.snrs for p in range(plan.placements)
    ]
    if plan.hours > 0.0:
        jobs += [("false", plan, speaker, plan.hours * 3600.0 / len(speakers)) for speaker in speakers]
    found: list[Trial] = []
    hours, strange = 0.0, list[list[Heard]]()
    began = time.monotonic()
    with workers(plan.processes) as pool:
        for number, (job, result) in enumerate(zip(jobs, pool.map(_job, jobs), strict=True), start=1):
            if job[0] == "trials":
                found += result
            else:
                hours += result[0]
                strange.append(result[1])
            if number % 20 == 0 or number == len(jobs):
                say(f"{number} of {len(jobs)} streams, {time.monotonic() - began:.0f} s")
        # one at a time: these are times
        timed = [pool.submit(_job, ("computing", plan, speaker)).result() for speaker in speakers[:3]]
    return report(plan, found, hours, strange, timed)


def known_score(trial: Trial) -> float:
    """The best score with which the right word was heard, NEVER when it was not."""
    return max((h.score for h in trial.heard if h.word == trial.placed.word), default=NEVER)


def correct(trial: Trial) -> bool:
    """Exactly the right word was accepted."""
    return {h.word for h in trial.heard if h.accepted} == {trial.placed.word}


def cell(found: Sequence[Trial], stop_word: str) -> dict[str, Any]:
    """The figures of one source at one SNR."""
    known = [t for t in found if t.placed.role == "test"]
    unknown = [t for t in found if t.placed.role == "unknown"]
    stops = [t for t in known if t.placed.word == stop_word]
    right = [(t, next(h for h in t.heard if h.accepted)) for t in known if correct(t)]
    closed = [max(t.heard, key=lambda h: h.score).word == t.placed.word for t in known if t.heard]
    # the hypothesis that decides: the accepted one, else the best
    deciding = [(t, max(t.heard, key=lambda h: (h.accepted, h.score))) for t in known if any(h.word for h in t.heard)]
    delays_ms = [1e3 * (h.decided_s - t.placed.end_s) for t, h in deciding]
    early = [(t, h) for t, h in deciding if h.decided_s < t.placed.end_s]
    known_scores = [known_score(t) for t in known]
    unknown_scores = [max((h.score for h in t.heard), default=NEVER) for t in unknown]
    accepted = [any(h.accepted for h in t.heard) for t in unknown]
    stopped = [any(h.accepted and h.word == stop_word for h in t.heard) for t in stops]
    return {
        "speakers": len({t.speaker for t in found}),
        "accuracy_pct": share(len(right), len(known)),
        "closed_set_accuracy_pct": share(sum(closed), len(known)),
        "wrong_word_pct": share(
            sum(any(h.accepted and h.word != t.placed.word for h in t.heard) for t in known), len(known)
        ),
        "stop_recall_pct": share(sum(stopped), len(stops)),
        "unknown_accepted_pct": share(sum(accepted), len(unknown)),
        "unknown_accepted_at_95_pct": accepted_at(known_scores, unknown_scores, 0.95),
        "equal_error_rate_pct": equal_error_rate_pct(known_scores, unknown_scores),
        "onset_to_intent_ms": percentiles([1e3 * (h.decided_s - t.placed.onset_s) for t, h in right], 50, 95),
        "stop_onset_to_intent_ms": percentiles(
            [1e3 * (h.decided_s - t.placed.onset_s) for t, h in right if t.placed.word == stop_word], 50, 95
        ),
        "end_to_intent_ms": percentiles([1e3 * (h.decided_s - t.placed.end_s) for t, h in right], 50, 95),
        "endpoint_delay_ms": percentiles([delay for delay in delays_ms if delay >= 0.0], 50, 95),
        "cut_early_pct": share(len(early), len(known)),
        "cut_in_loud_part_pct": share(sum(h.decided_s < t.placed.loud_end_s for t, h in deciding), len(known)),
        "cut_early_and_not_right_pct": share(sum(not correct(t) for t, _ in early), len(known)),
        "never_ended_pct": share(sum(bool(t.heard) and not any(h.word for h in t.heard) for t in known), len(known)),
        "undetected_pct": share(sum(not t.heard for t in known), len(known)),
    }


def armed_accepts(strange: Sequence[Sequence[Heard]], plan: Plan) -> int:
    """Motion words that were wrongly accepted while a listener that a switch opens now and then was open."""
    return sum(
        h.accepted and h.word != plan.stop_word and h.end_s % ARM_EVERY_S < plan.settings.armed_s
        for stream in strange
        for h in stream
    )


def operating_point(
    found: Sequence[Trial], hours: float, strange: Sequence[Sequence[Heard]], line: float
) -> dict[str, Any]:
    """What one threshold for all words would give, over all sources: deafness against wrong motion."""
    best = [(t, max(t.heard, key=lambda h: h.score, default=None)) for t in found]
    passed = [(t, h is not None and h.score >= line, bool(h and h.word == t.placed.word)) for t, h in best]
    known = [over and right for t, over, right in passed if t.placed.role == "test"]
    unknown = [over for t, over, _ in passed if t.placed.role == "unknown"]
    count = 0
    for stream in strange:
        until = -1.0
        for heard in stream:
            if heard.score >= line:
                count += heard.onset_s > until
                until = heard.decided_s
    return {
        "threshold": line,
        "accuracy_pct": share(sum(known), len(known)),
        "unknown_accepted_pct": share(sum(unknown), len(unknown)),
        "false_accepts_per_hour": rate_per_hour(count, hours),
    }


def report(
    plan: Plan,
    found: Sequence[Trial],
    hours: float,
    strange: Sequence[Sequence[Heard]],
    measured: Sequence[tuple[float, list[float]]],
) -> dict[str, Any]:
    """Everything together."""
    accepted = [h.word for stream in strange for h in stream if h.accepted]
    sources = list(dict.fromkeys(t.source for t in found))
    stops = sum(word == plan.stop_word for word in accepted)
    names = {snr: "clean" if snr is None else f"{snr:g}" for snr in plan.snrs}
    cells = {
        source: {
            name: cell([t for t in found if t.source == source and t.snr == snr], plan.stop_word)
            for snr, name in names.items()
        }
        for source in sources
    }
    return {
        "manifest": plan.manifest.name,
        "engine": plan.engine,
        "speech_embedding": plan.engine == "default" and plan.embedding and network() is not None,
        "variant": plan.variant,
        "templates": plan.templates,
        "placements": plan.placements,
        "seed": plan.seed,
        "thresholds": {"word": plan.settings.threshold, "stop": plan.settings.stop_threshold},
        "note": "n counts placements of the same recordings too; the number of speakers is the real sample size",
        "sources": cells,
        "false_accepts_per_hour": {
            "hours": round(hours, 3),
            "motion": rate_per_hour(len(accepted) - stops, hours),
            "stop": rate_per_hour(stops, hours),
            "motion_armed": rate_per_hour(armed_accepts(strange, plan), hours),
            "motion_armed_note": f"open for {plan.settings.armed_s:g} s every {ARM_EVERY_S:g} s, as if by a switch",
        },
        "operating_points": [operating_point(found, hours, strange, line) for line in LINES],
        "cpu_ms_per_s": round(float(np.median([cpu for cpu, _ in measured])), 2),
        "deciding_ms": percentiles([ms for _, each in measured for ms in each], 50, 95),
    }

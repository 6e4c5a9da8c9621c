"""How good the ears are: streams with known truth through the streaming path."""

from __future__ import annotations

import time
import zlib
from collections.abc import Callable, Sequence
from functools import cache, lru_cache
from pathlib import Path
from typing import Any

import numpy as np

from chairward_voice_dtw.audio import Floats, SoundError
from chairward_voice_dtw.engine import Acceptance, Engine, Heard
from chairward_voice_dtw.plan import DRIVEN, Plan, Strange, Trial
from chairward_voice_dtw.reporting import report
from chairward_voice_dtw.stage import EngineMaker
from chairward_voice_dtw.streams import STREAM_HZ, Placed, Row, babble, by_role, embed, load, read_manifest
from chairward_voice_dtw.variants import VARIANTS, said
from chairward_voice_dtw.workers import workers

BLOCK = STREAM_HZ // 2
"""How sound is cut changes nothing (the tests of the streaming laws say so): long blocks only save time."""
Say = Callable[[str], None]


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
    return EngineMaker(files, plan.thresholds(DRIVEN), plan.engine, embedding=plan.embedding, weights=plan.weights)


def _engine(plan: Plan, speaker: str, *, at_once: bool = True) -> Engine:
    return _maker(plan, speaker).make(STREAM_HZ, at_once=at_once)


def listen(engine: Engine, samples: Floats, block: int = BLOCK) -> list[Heard]:
    """Everything that the engine hears in a stream."""
    return [heard for at in range(0, len(samples), block) for heard in engine.push(samples[at : at + block])]


def always_open(plan: Plan, heard: Sequence[Heard]) -> list[Heard]:
    """A stream as ears that are always open would have accepted it; the thesis' engines accept everything."""
    if plan.engine != "default":
        return list(heard)
    acceptance = Acceptance(plan.thresholds("always"))
    return [acceptance.of(h) for h in heard]


def _noises(plan: Plan) -> list[Floats]:
    return [_sound(row.path) for row in _rows(plan.manifest) if row.role == "noise"]


def trials(
    plan: Plan, speaker: str, snr: float | None, placement: int, make: Callable[[], Engine] | None = None
) -> list[Trial]:
    """One stream of one speaker's test and unknown utterances; `make` brings another engine than the plan's."""
    roles = by_role(_rows(plan.manifest), speaker)
    variant = VARIANTS[plan.variant]
    rows = [row for row in [*roles["test"], *roles["unknown"]] if row.word in plan.words or not plan.words]
    utterances = [(row, said(_sound(row.path), variant)) for row in rows]
    rng = np.random.default_rng([plan.seed, zlib.crc32(speaker.encode()), 999 if snr is None else int(snr), placement])
    level_dbfs = float(rng.uniform(-32.0, -20.0))
    stream = embed(utterances, _noises(plan), snr, rng, level_dbfs=level_dbfs, gain_db=variant.gain_db)
    heard = listen(make() if make else _engine(plan, speaker), stream.samples)
    always = [] if make else always_open(plan, heard)
    source = roles["test"][0].source

    def over(found: Sequence[Heard], placed: Placed) -> tuple[Heard, ...]:
        return tuple(h for h in found if h.onset_s < placed.end_s + 0.1 and h.end_s > placed.onset_s - 0.1)

    return [
        Trial(source=source, speaker=speaker, snr=snr, placed=p, heard=over(heard, p), always=over(always, p))
        for p in stream.placed
    ]


def false_accepts(plan: Plan, speaker: str, seconds: float) -> Strange:
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
    return Strange(hours=seconds / 3600.0, heard=found, always=always_open(plan, found))


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
    if plan.words:
        speakers = [s for s in speakers if any(row.word in plan.words for row in by_role(rows, s)["test"])]
    if not speakers:
        of = f" of {', '.join(plan.words)}" if plan.words else ""
        raise SoundError(f"{plan.manifest}: no speaker has both template and test rows{of}")
    if any(snr is not None for snr in plan.snrs) and not any(row.role == "noise" for row in rows):
        raise SoundError(f"{plan.manifest}: has no noise rows; evaluate with --snr clean, or add some")
    jobs: list[tuple[Any, ...]] = [
        ("trials", plan, speaker, snr, p) for speaker in speakers for snr in plan.snrs for p in range(plan.placements)
    ]
    if plan.hours > 0.0:
        jobs += [("false", plan, speaker, plan.hours * 3600.0 / len(speakers)) for speaker in speakers]
    found: list[Trial] = []
    strange: list[Strange] = []
    began = time.monotonic()
    with workers(plan.processes) as pool:
        for number, (job, result) in enumerate(zip(jobs, pool.map(_job, jobs), strict=True), start=1):
            if job[0] == "trials":
                found += result
            else:
                strange.append(result)
            if number % 20 == 0 or number == len(jobs):
                say(f"{number} of {len(jobs)} streams, {time.monotonic() - began:.0f} s")
        # one at a time: these are times
        timed = [pool.submit(_job, ("computing", plan, speaker)).result() for speaker in speakers[:3]]
    return report(plan, found, strange, timed)

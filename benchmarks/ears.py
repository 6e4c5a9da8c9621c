"""Our ears beside others on the same streams, speed of the warping kernel, and the fit of the score.

    python benchmarks/ears.py compare MANIFEST [--placements 1] [--speakers 3] [--source asc]
    python benchmarks/ears.py speed
    python benchmarks/ears.py fit MANIFEST
    python benchmarks/ears.py evaluate|stops|variants MANIFEST

`compare`: default, thesis_text, thesis_code and a Raven-like matcher (13 MFCC, cosine DTW, no noise handling, behind
our endpointer) on equal streams; pocketsphinx, when installed, on English sources with the true bounds given to it (an
advantage). `speed`: our kernel and, when installed, dtaidistance. Extra packages: pocketsphinx, dtaidistance.
`evaluate`: `words evaluate` as it stands. `stops`: the same of the word "stop" alone, in many more places. `variants`:
words said slowly, slurred, loudly and softly. All but `speed` write their figures into results/ears.json.
"""

from __future__ import annotations

import argparse
import json
import sys
import time
from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np
import numpy.typing as npt
import report

from chairward_voice_dtw import calibrate, calibration, dtw, evaluate, reporting
from chairward_voice_dtw.audio import RATE_HZ, Resampler
from chairward_voice_dtw.engine import Heard, frame_end_s
from chairward_voice_dtw.figures import Share, share
from chairward_voice_dtw.frontend import HOP, features
from chairward_voice_dtw.plan import Plan, Trial
from chairward_voice_dtw.segmenter import LISTENERS, Segmenter
from chairward_voice_dtw.streams import STREAM_HZ, by_role, embed, family, load, read_manifest
from chairward_voice_dtw.templates import Template, from_files
from chairward_voice_dtw.variants import VARIANTS

SNRS = (None, 20.0, 10.0, 5.0)
ENGLISH = ("sc", "fsdd", "tts")
Floats = npt.NDArray[np.float32]


def unit(mel: Floats) -> Floats:
    """13 plain cepstra of unit length (no noise handling)."""
    x = features(mel)[:, :13]
    return np.ascontiguousarray(x / (np.linalg.norm(x, axis=1, keepdims=True) + 1e-9))


class RavenLike:
    """Cosine DTW on plain MFCC: on unit vectors the Euclidean distance orders frames as the cosine does."""

    now_s = 0.0

    def __init__(self, templates: Sequence[Template], words: Sequence[str]) -> None:
        self._packed, self._lengths = dtw.pack([unit(t.mel) for t in templates])
        self._words = list(words)
        self._resampler = Resampler(STREAM_HZ)
        self._segmenter = Segmenter((LISTENERS[0],))

    def push(self, samples: Floats) -> list[Heard]:
        """Every ended sound gets the nearest word."""
        out = []
        for s in self._segmenter.push(self._resampler.push(samples)):
            if s.too_long:
                continue
            found = dtw.distances(unit(s.mel), self._packed, self._lengths)
            word = self._words[int(np.argmin(found))]
            end = frame_end_s(s.last)
            out.append(
                Heard(
                    word=word,
                    score=-float(found.min()),
                    accepted=True,
                    onset_s=s.first * HOP / RATE_HZ,
                    end_s=end,
                    decided_s=frame_end_s(s.decided),
                )
            )
        return out


def compare(manifest: Path, placements: int, most: int, wanted: str) -> None:
    """Closed-set accuracy of each engine by source and SNR, added to results/ears.json."""
    rows = read_manifest(manifest)
    speakers = evaluate.speakers_of(rows)
    engines: dict[str, Callable[[str, float | None, int], list[Trial]]] = {
        name: (lambda s, snr, p, n=name: evaluate.trials(Plan(manifest=manifest, engine=n), s, snr, p))  # type: ignore[misc]
        for name in ("default", "thesis_text", "thesis_code")
    }
    engines["Raven-like"] = lambda s, snr, p: raven_trials(manifest, s, snr, p)
    result = load_results()
    for source in dict.fromkeys(family(by_role(rows, s)["test"][0]) for s in speakers):
        if wanted not in ("", source):
            continue
        mine = [s for s in speakers if family(by_role(rows, s)["test"][0]) == source][:most]
        table: dict[str, dict[str, Share]] = {}
        for name, run in engines.items():
            for snr in SNRS:
                found = [t for s in mine for p in range(placements) for t in run(s, snr, p)]
                table.setdefault(name, {})[reporting.snr_name(snr)] = reporting.cell(found, "stop")[
                    "closed_set_accuracy_pct"
                ]
        if source in ENGLISH and (peer := pocketsphinx(manifest, mine)) is not None:
            table["pocketsphinx, true bounds"] = peer
        result.setdefault("compare", {})[source] = {"speakers": mine, "placements": placements, "engines": table}
        print(source, *(f"{name}: {row}" for name, row in table.items()), sep="\n  ", flush=True)
        save(result)


def load_results() -> dict[str, Any]:
    """What was measured before, to be added to."""
    file = report.RESULTS / "ears.json"
    return json.loads(file.read_text(encoding="utf-8")) if file.exists() else {}


def raven_trials(manifest: Path, speaker: str, snr: float | None, placement: int) -> list[Trial]:
    """The same streams as `evaluate.trials`, through the Raven-like matcher."""
    roles = by_role(read_manifest(manifest), speaker)
    files: dict[str, list[Path]] = {}
    for row in roles["template"]:
        files.setdefault(row.word, []).append(row.path)
    templates = from_files(files)
    words = [t.word for t in templates]
    return evaluate.trials(Plan(manifest=manifest), speaker, snr, placement, lambda: RavenLike(templates, words))


def pocketsphinx(manifest: Path, speakers: Sequence[str]) -> dict[str, Share] | None:
    """Speaker-independent JSGF recognition of each utterance, cut out at its true bounds with 0.3 s around."""
    try:
        from pocketsphinx import Decoder, get_model_path
    except ImportError:
        print("pocketsphinx is not installed: left out")
        return None
    rows = read_manifest(manifest)
    spoken = dict(
        zip("0123456789", ["zero", "one", "two", "three", "four", "five", "six", "seven", "eight", "nine"], strict=True)
    )
    noises = [load(r.path) for r in rows if r.role == "noise"]
    found: dict[str, Share] = {}
    for snr in SNRS:
        right = total = 0
        for speaker in speakers:
            tests = by_role(rows, speaker)["test"]
            names = {spoken.get(r.word, r.word): r.word for r in tests}
            model = Path(get_model_path())
            decoder = Decoder(
                hmm=str(model / "en-us/en-us"), dict=str(model / "en-us/cmudict-en-us.dict"), lm=None, loglevel="FATAL"
            )
            grammar = f"#JSGF V1.0; grammar g; public <word> = {' | '.join(names)} ;"
            decoder.add_jsgf_string("words", grammar)
            decoder.activate_search("words")
            stream = embed([(r, load(r.path)) for r in tests], noises, snr, np.random.default_rng(1))
            for placed in stream.placed:
                first, last = (int(max(0.0, s) * STREAM_HZ) for s in (placed.onset_s - 0.3, placed.end_s + 0.3))
                decoder.start_utt()
                decoder.process_raw((stream.samples[first:last] * 32767).astype("<i2").tobytes(), full_utt=True)
                decoder.end_utt()
                said = decoder.hyp()
                right += said is not None and names.get(said.hypstr) == placed.word
                total += 1
        found[reporting.snr_name(snr)] = share(right, total)
    return found


def speed() -> None:
    """One 1.5 s word (150 frames of 26) against 6 and 60 templates of 150 frames: best of 20, one thread."""
    rng = np.random.default_rng(0)
    x = rng.normal(size=(150, 26)).astype(np.float32)
    word, window = x.astype(np.float64), int(dtw.BAND * 150)
    for count in (6, 60):
        packed, lengths = dtw.pack([rng.normal(size=(150, 26)).astype(np.float32) for _ in range(count)])
        dtw.distances(x, packed, lengths)
        print(f"{count} templates: ours {best_of(lambda p=packed, n=lengths: dtw.distances(x, p, n)):.2f} ms")  # type: ignore[misc]
        try:
            from dtaidistance import dtw_ndim
        except ImportError:
            print("  dtaidistance is not installed: left out")
            continue
        items = [np.asarray(p[:n], np.float64) for p, n in zip(packed, lengths, strict=True)]
        found = best_of(lambda i=items: [dtw_ndim.distance_fast(word, y, window=window) for y in i])  # type: ignore[misc]
        print(f"  dtaidistance {found:.2f} ms (C, the same band)")


def best_of(work: Callable[[], object], times: int = 20) -> float:
    """Least time of some runs, ms."""
    found = []
    for _ in range(times):
        began = time.perf_counter()
        work()
        found.append(1e3 * (time.perf_counter() - began))
    return min(found)


def fit(manifest: Path, seed: int) -> None:
    """Fit both scores and write them where the recogniser reads them; tell, and write into results/ears.json, how the
    same fit does on what it has not seen: folds over speakers and noises, and every third speaker through `evaluate`.
    """
    held = tuple(evaluate.speakers_of(read_manifest(manifest))[::3])
    scores, partial, result = {}, {}, load_results()
    for name in ("plain", "fused"):
        examples = calibrate.gather(manifest, tell, embedding=name == "fused", seed=seed)
        lines = calibrate.table(examples, calibrate.held_back(examples))
        print(f"{name}, {len(examples)} examples; speakers and noises held back:", *lines, sep="\n", flush=True)
        result.setdefault("folds", {})[name] = lines
        scores[name] = calibrate.fit(examples)
        partial[name] = calibrate.fit([e for e in examples if e.speaker not in held])
    calibration.FILE.write_text(calibration.text(scores), encoding="utf-8")
    with TemporaryDirectory() as folder:
        weights = Path(folder) / "weights.json"
        weights.write_text(calibration.text(partial), encoding="utf-8")
        plan = Plan(manifest=manifest, speakers=held, weights=weights, hours=1.0, seed=seed + 1)
        result["held_back"] = {"speakers": held, **evaluate.evaluate(plan, tell)}
    save(result)


def measure(manifest: Path, what: str, processes: int) -> None:
    """The report of one plan for every speaker, written into results/ears.json under its name."""
    plans = {"evaluate": Plan(manifest=manifest), "stops": Plan(manifest=manifest, words=("stop",), placements=20)}
    found = evaluate.evaluate(replace(plans[what], processes=processes), tell)
    save({**load_results(), what: found})


def variants(manifest: Path, placements: int) -> None:
    """The words of all speakers at 20 dB, said otherwise than they were enrolled; written into results/ears.json."""
    speakers = evaluate.speakers_of(read_manifest(manifest))
    table: dict[str, dict[str, Share]] = {}
    for name in VARIANTS:
        plan = Plan(manifest=manifest, variant=name)
        found = [t for s in speakers for p in range(placements) for t in evaluate.trials(plan, s, 20.0, p)]
        figures = reporting.cell(found, plan.stop_word)
        table[name] = {key: figures[key] for key in ("accuracy_pct", "wrong_word_pct", "unknown_accepted_pct")}
        print(name, table[name], flush=True)
    measured = {"snr_db": 20.0, "speakers": len(speakers), "placements": placements, "said": table}
    save({**load_results(), "variants": measured})


def save(result: dict[str, Any]) -> None:
    """Into results/ears.json, with the machine of this call."""
    report.save("ears", {**result, "machine": report.machine()})


def tell(line: str) -> None:
    """Progress."""
    print(line, file=sys.stderr)


def main() -> None:
    """See the module's docstring."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("what", choices=("compare", "speed", "fit", "evaluate", "stops", "variants"))
    parser.add_argument("manifest", type=Path, nargs="?")
    parser.add_argument("--placements", type=int, default=1)
    parser.add_argument("--speakers", type=int, default=1000, help="at most, of each source")
    parser.add_argument("--source", default="", help="only this one: the speakers' prefix")
    parser.add_argument("--processes", type=int, default=0, help="of evaluate and stops; 0: up to two")
    parser.add_argument("--seed", type=int, default=77, help="of the streams that are fitted to")
    options = parser.parse_args()
    if options.what == "speed":
        speed()
    elif options.manifest is None:
        parser.error(f"{options.what} needs a manifest")
    elif options.what == "fit":
        fit(options.manifest, options.seed)
    elif options.what == "variants":
        variants(options.manifest, options.placements)
    elif options.what in ("evaluate", "stops"):
        measure(options.manifest, options.what, options.processes)
    else:
        compare(options.manifest, options.placements, options.speakers, options.source)


if __name__ == "__main__":
    main()

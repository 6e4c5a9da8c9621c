"""What a screen's words page asks, answered: list, look at, keep, forget and try recordings of a person's words.

`chairward words serve` reads one JSON object a line and writes one a line, so that a page in another process (and of
another plugin) needs nothing of this package but the command. A request that cannot be met is answered with
{"error": sentence}; every path in a request is a sound file that the asking program has written.
"""

from __future__ import annotations

import json
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from chairward_voice_dtw import dtw
from chairward_voice_dtw.audio import RATE_HZ, Floats, SoundError, read_wav, resample
from chairward_voice_dtw.engine import Thresholds, Voice
from chairward_voice_dtw.enrolment import FEWEST, MOST, check, separability, sound_problem
from chairward_voice_dtw.frontend import MelStream, features, subtract
from chairward_voice_dtw.segmenter import Segment
from chairward_voice_dtw.settings import VoiceSettings
from chairward_voice_dtw.store import StoreError, WordStore, folder_of
from chairward_voice_dtw.streams import STREAM_HZ, active_rms
from chairward_voice_dtw.templates import cut_out, from_files
from chairward_voice_dtw.trial import hear

LONGEST_S = 10.0
WAVE_COLUMNS = 240
DARKEST_DB = 50.0

Request = Mapping[str, Any]
Answer = dict[str, Any]


@dataclass(frozen=True, slots=True)
class Known:
    """A person's words, ready to be compared: the voice that decides, and plain distances for people to look at."""

    files: Mapping[str, list[Path]]
    voice: Voice
    words: list[str]
    packed: npt.NDArray[np.float32]
    lengths: npt.NDArray[np.int64]

    @classmethod
    def of(cls, files: Mapping[str, list[Path]]) -> Known:
        """Of the recordings of each word. Raises SoundError."""
        templates = from_files(files)
        packed, lengths = dtw.pack([features(subtract(t.mel, t.noise)) for t in templates])
        return cls(files, Voice(templates), [t.word for t in templates], packed, lengths)

    def nearness(self, segment: Segment) -> list[Answer]:
        """Each word's distance under the least one, so 1 for the nearest word and less for farther ones, in order."""
        found = features(subtract(np.ascontiguousarray(segment.mel), segment.noise))
        distances = np.minimum(dtw.distances(found, self.packed, self.lengths), 1e3)
        best: dict[str, float] = {}
        for word, distance in zip(self.words, distances, strict=True):
            best[word] = min(best.get(word, np.inf), float(distance))
        least = max(min(best.values()), 1e-6)
        ordered = sorted(best.items(), key=lambda item: item[1])
        return [{"word": word, "near": round(least / max(distance, 1e-6), 3)} for word, distance in ordered]


class WordsDesk:
    """Answers about the people whose recordings are in one folder (`<people>/<person>/words`)."""

    def __init__(self, people: Path) -> None:
        self._people = people
        self._known: Known | None = None
        self._answers: dict[str, Callable[[Request], Answer]] = {
            "list": self._list,
            "look": self._look,
            "save": self._save,
            "remove": self._remove,
            "try": self._try,
        }

    def answer(self, line: str) -> str:
        """One request as JSON, answered as JSON; never raises for what is in it."""
        try:
            request = json.loads(line)
            answer = self._answers[request["do"]](request)
        except (SoundError, StoreError) as error:
            answer = {"error": str(error)}
        except (KeyError, TypeError, ValueError, RecursionError) as error:
            answer = {"error": f"not a request of a words page: {error!r}"[:200]}
        except OSError as error:
            answer = {"error": f"{error.filename or self._people}: {error.strerror or error}"}
        return json.dumps(answer, ensure_ascii=False)

    def _store(self, request: Request) -> WordStore:
        return WordStore(folder_of(self._people, str(request["person"])))

    def _list(self, request: Request) -> Answer:
        """Every recorded word: its files, the nearest other word and how far that is."""
        files = self._store(request).files()
        found = separability(from_files(files)) if files else None
        words = []
        for word, paths in sorted(files.items()):
            near, apart = found.nearest[word] if found else ("", float("inf"))
            row = {"word": word, "files": [str(path) for path in paths], "nearest": near}
            words.append({**row, "apart": round(apart, 2) if np.isfinite(apart) else None})
        return {"words": words, "warnings": list(found.warnings) if found else [], "fewest": FEWEST, "most": MOST}

    def _look(self, request: Request) -> Answer:
        """A recording as pictures: waveform columns (lowest, highest, -1..1), mel bands (0..255), level, problem."""
        samples = _sound(Path(str(request["path"])))
        seconds = len(samples) / STREAM_HZ
        columns = np.array_split(samples, min(WAVE_COLUMNS, len(samples)))
        mel = MelStream().push(resample(samples, STREAM_HZ, RATE_HZ))
        decibels = 10.0 * np.log10(mel + 1e-12)
        shades = np.clip((decibels - decibels.max(initial=-120.0) + DARKEST_DB) / DARKEST_DB, 0.0, 1.0)
        problem = sound_problem(samples)
        if not problem and cut_out(samples) is None:
            problem = "no word stands out of the background: record it again, louder or nearer"
        return {
            "seconds": round(seconds, 2),
            "level_dbfs": round(20.0 * float(np.log10(active_rms(samples))), 1),
            "problem": problem,
            "wave": [[round(float(c.min()), 3), round(float(c.max()), 3)] for c in columns],
            "mel": (shades * 255.0).astype(int).tolist(),
        }

    def _save(self, request: Request) -> Answer:
        """Make these files the recordings of a word if they are good (or force); the old ones stay otherwise."""
        word, store = str(request["word"]).strip(), self._store(request)
        if not word:
            raise SoundError("a word needs a name")
        recordings = [(f"recording {n}", _sound(Path(str(path)))) for n, path in enumerate(request["paths"], 1)]
        problems = check(word, recordings)
        if problems and not request.get("force"):
            return {"stored": 0, "problems": problems, "warnings": []}
        store.replace(word, [samples for _, samples in recordings])
        self._known = None
        warnings = separability(from_files(store.files())).warnings
        return {"stored": len(recordings), "problems": problems, "warnings": list(warnings)}

    def _remove(self, request: Request) -> Answer:
        self._store(request).remove(str(request["word"]))
        self._known = None
        return {"removed": request["word"]}

    def _try(self, request: Request) -> Answer:
        """What would be heard, armed, and how near each word is: 1 for the nearest, less for farther ones."""
        files = self._store(request).files()
        if not files:
            raise SoundError(f"{request['person']} has no recorded words yet")
        if self._known is None or self._known.files != files:
            self._known = Known.of(files)
        sound, settings = _sound(Path(str(request["path"]))), VoiceSettings(listening="armed")
        stop_words = frozenset(str(word) for word in request.get("stop_words", []))
        thresholds = Thresholds(word=settings.threshold, stop=settings.stop_threshold, stop_words=stop_words)
        heard, segment = hear(self._known.voice, thresholds, sound), cut_out(sound)
        if heard is None:
            return {"heard": None, "word": "", "score": None, "needed": None, "scores": []}
        return {
            "heard": heard.word if heard.accepted else None,
            "word": heard.word,
            "score": round(heard.score, 2),
            "needed": thresholds.of(heard.word),
            "scores": [] if segment is None else self._known.nearness(segment),
        }


def _sound(path: Path) -> Floats:
    samples = read_wav(path, STREAM_HZ)[0]
    if len(samples) > LONGEST_S * STREAM_HZ:
        raise SoundError(f"{len(samples) / STREAM_HZ:.0f} s of sound for one word: at most {LONGEST_S:.0f} s")
    if len(samples) < STREAM_HZ // 10:
        raise SoundError("less than a tenth of a second of sound: record it again")
    return samples

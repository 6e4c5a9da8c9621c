"""The streaming recognisers: samples in, heard words out. Causal; how sound is cut in blocks changes nothing."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Protocol

import numpy as np

from chairward_voice_dtw import calibration
from chairward_voice_dtw.audio import RATE_HZ, Floats, Resampler
from chairward_voice_dtw.embedding import network
from chairward_voice_dtw.frontend import HOP, WINDOW
from chairward_voice_dtw.matcher import Matcher
from chairward_voice_dtw.segmenter import LISTENERS, Segment, Segmenter
from chairward_voice_dtw.spotter import Prints, Spotted, Spotter
from chairward_voice_dtw.templates import Template
from chairward_voice_dtw.thesis import RECORDING, Mode, ThesisMatcher

NEVER = -1e9
"""Score of what cannot be a word."""
SAME_SOUND_S = 0.12
"""Two words may overlap by less than this and still be two sounds: bounds are that sure."""
LEAST_VOICED = 0.01
"""A sound without one frame that webrtcvad takes for speech moves nothing (0.2 % of real words are such)."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Heard:
    """Something that ended and was compared. Times are seconds of the stream.

    word: the nearest, "" for talk and noise that is too long for a word. score: log-odds that it was said.
    accepted: over that word's threshold, and not the same sound once more. voiced: share of it that is speech.
    onset_s, end_s: of the active part; decided_s: of the newest sample that the decision rests on.
    """

    word: str
    score: float
    accepted: bool
    onset_s: float
    end_s: float
    decided_s: float
    voiced: float = 1.0


@dataclass(frozen=True, slots=True, kw_only=True)
class Thresholds:
    """Scores are log-odds; a word is accepted at `word`, the stop words at `stop`."""

    word: float = 0.0
    stop: float = -2.0
    stop_words: frozenset[str] = frozenset()

    def of(self, word: str) -> float:
        """The threshold of one word."""
        return self.stop if word in self.stop_words else self.word


class Acceptance:
    """Which of the heard words count, in the order in which they are heard: one word for each sound."""

    def __init__(self, thresholds: Thresholds) -> None:
        self._thresholds = thresholds
        self._taken_until_s = 0.0
        self._taken_word = ""

    def of(self, heard: Heard) -> Heard:
        """The same, accepted or not."""
        stop = heard.word in self._thresholds.stop_words
        speech = stop or heard.voiced >= LEAST_VOICED
        # a sound that has given a word may still give a stop
        taken = heard.onset_s < self._taken_until_s and (not stop or heard.word == self._taken_word)
        accepted = speech and heard.score >= self._thresholds.of(heard.word) and not taken
        if accepted:
            self._taken_until_s, self._taken_word = heard.end_s - SAME_SOUND_S, heard.word
        return replace(heard, accepted=accepted)


class Engine(Protocol):
    """What the stage and the evaluation run."""

    def push(self, samples: Floats) -> list[Heard]:
        """Everything that these samples decide."""

    @property
    def now_s(self) -> float:
        """Seconds of sound that have been looked at."""


def frame_end_s(frame: int) -> float:
    """Second of the stream at which a frame's last sample lies."""
    return (frame * HOP + WINDOW) / RATE_HZ


class Voice:
    """A person's templates made ready, once, for as many engines as are needed. embedding: use it where installed.
    weights: file of the score."""

    def __init__(
        self, templates: Sequence[Template], *, embedding: bool = True, weights: Path = calibration.FILE
    ) -> None:
        self.matcher = Matcher(templates, weights)
        model = network() if embedding else None
        self.prints = None if model is None else Prints(model, templates, self.matcher.words)


class DtwEngine:
    """The default: words are offered by likeness of embeddings (where installed) or by endpointers that follow the
    noise; templates moved into the room's noise, DTW, one fused score. at_once: as the Spotter's."""

    def __init__(self, voice: Voice, thresholds: Thresholds, rate_hz: int, *, at_once: bool = False) -> None:
        self._matcher = voice.matcher
        self._stop_words = thresholds.stop_words
        self._acceptance = Acceptance(thresholds)
        self._resampler = Resampler(rate_hz)
        self._spotter = None if voice.prints is None else Spotter(voice.prints, at_once=at_once)
        longest = max(150, int(1.6 * self._matcher.longest))
        self._segmenter = Segmenter(() if self._spotter else tuple(replace(p, longest=longest) for p in LISTENERS))

    def push(self, samples: Floats) -> list[Heard]:
        """Everything that these samples decide."""
        return [self._acceptance.of(self._heard(segment, spotted)) for segment, spotted in self.offers(samples)]

    def offers(self, samples: Floats) -> list[tuple[Segment, Spotted | None]]:
        """The stretches that may be words."""
        samples = self._resampler.push(samples)
        segments = self._segmenter.push(samples)
        if self._spotter is None:
            return [(segment, None) for segment in segments]
        spotted = self._spotter.push(samples)
        cuts = [(self._segmenter.cut(s.first, s.last, s.known), s) for s in spotted]
        return [(segment, s) for segment, s in cuts if segment is not None]

    def _heard(self, segment: Segment, spotted: Spotted | None) -> Heard:
        word, score = "", NEVER
        if not segment.too_long:
            verdict = self._matcher.judge(segment, spotted, self._stop_words)
            word, score = verdict.word, verdict.score
        return Heard(
            word=word,
            score=score,
            accepted=False,
            onset_s=segment.first * HOP / RATE_HZ,
            end_s=frame_end_s(segment.last),
            decided_s=frame_end_s(segment.decided),
            voiced=segment.voiced,
        )

    @property
    def now_s(self) -> float:
        """Seconds of sound that have been looked at."""
        return frame_end_s(self._segmenter.frames_seen - 1) if self._segmenter.frames_seen else 0.0


class ThesisEngine:
    """The thesis' matcher on a stream: an onset starts a recording of 1.5 s, and its end gives a word, always."""

    LEAD = 3 * RATE_HZ // 20

    def __init__(self, recordings: Mapping[str, Floats], stop_word: str, mode: Mode, rate_hz: int) -> None:
        self._matcher = ThesisMatcher(dict(recordings), stop_word, mode)
        self._resampler = Resampler(rate_hz)
        self._segmenter = Segmenter((LISTENERS[0],))
        self._sound = np.zeros(0, np.float32)
        self._sound_from = 0
        self._busy_until = 0

    def push(self, samples: Floats) -> list[Heard]:
        """Everything that these samples decide."""
        fresh = self._resampler.push(samples)
        self._sound = np.concatenate([self._sound, fresh])
        self._segmenter.push(fresh)
        heard: list[Heard] = []
        while self._segmenter.onsets:
            begin = max(0, self._segmenter.onsets[0] * HOP - self.LEAD)
            if begin < self._busy_until:
                self._segmenter.onsets.pop(0)
                continue
            at = begin - self._sound_from
            if at + RECORDING > len(self._sound):
                break
            self._segmenter.onsets.pop(0)
            word = self._matcher.decide(self._sound[at : at + RECORDING])
            end = begin + RECORDING
            self._busy_until = end
            heard.append(
                Heard(
                    word=word,
                    score=0.0,
                    accepted=True,
                    onset_s=(begin + self.LEAD) / RATE_HZ,
                    end_s=end / RATE_HZ,
                    decided_s=end / RATE_HZ,
                )
            )
        drop = max(0, len(self._sound) - 4 * RECORDING)
        self._sound, self._sound_from = self._sound[drop:], self._sound_from + drop
        return heard

    @property
    def now_s(self) -> float:
        """Seconds of sound that have been looked at."""
        return frame_end_s(self._segmenter.frames_seen - 1) if self._segmenter.frames_seen else 0.0

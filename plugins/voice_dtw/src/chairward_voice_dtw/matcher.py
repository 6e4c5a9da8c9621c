"""Which word a segment is, and how sure that is.

The templates are moved into the room of the segment (its noise added at the segment's level: parallel model
combination, Gales & Young 1996, here on mel power), so that both sides of the comparison are equally noisy.
One fused score a word: log-odds from a few distance ratios, weights found on development speakers.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from chairward_voice_dtw import dtw
from chairward_voice_dtw.audio import Floats
from chairward_voice_dtw.frontend import features
from chairward_voice_dtw.segmenter import Segment
from chairward_voice_dtw.templates import Template

EVIDENCE = ("own", "second", "free", "mean", "length")
WEIGHTS = np.array([-3.0, -6.0, -6.0, -3.0, -3.0])
BIAS = 0.5


@dataclass(frozen=True, slots=True, kw_only=True)
class Verdict:
    """word: the best. score: log-odds that it was said. distances: best of each word, by `Matcher.words`."""

    word: str
    score: float
    distances: npt.NDArray[np.float64]
    evidence: npt.NDArray[np.float64]


class Matcher:
    """A person's templates, ready to be compared."""

    def __init__(self, templates: Sequence[Template]) -> None:
        self.words = sorted({t.word for t in templates})
        self._word_of = np.array([self.words.index(t.word) for t in templates])
        self._clean = [np.maximum(t.mel - np.float32(1.5) * t.noise, np.float32(0.02) * t.mel) for t in templates]
        self._level = [float(np.percentile(c.sum(axis=1), 80)) for c in self._clean]
        self._lengths = np.array([len(c) for c in self._clean])
        self._own = self._own_spread()
        self.longest = int(self._lengths.max(initial=60))

    def _own_spread(self) -> npt.NDArray[np.float64]:
        """Per word: the mean distance between its own repetitions (with but one: a share of that to others)."""
        plain = [features(c) for c in self._clean]
        packed, lengths = dtw.pack(plain)
        table = np.array([dtw.distances(x, packed, lengths) for x in plain])
        own = np.empty(len(self.words))
        for w in range(len(self.words)):
            mine = np.flatnonzero(self._word_of == w)
            others = np.flatnonzero(self._word_of != w)
            if len(mine) > 1:
                inside = table[np.ix_(mine, mine)]
                own[w] = inside.sum() / (len(mine) * (len(mine) - 1))
            else:
                own[w] = 0.6 * np.median(table[np.ix_(mine, others)]) if len(others) else 1.0
        return own

    def judge(self, segment: Segment) -> Verdict:
        """Compare one segment with every template."""
        mel, noise = segment.mel, segment.noise
        level = max(float(np.percentile(mel.sum(axis=1), 80)) - float(noise.sum()), 0.05 * float(noise.sum()))
        moved = [features(c * np.float32(level / g) + noise) for c, g in zip(self._clean, self._level, strict=True)]
        packed, lengths = dtw.pack(moved)
        x = features(mel)
        every = dtw.distances(x, packed, lengths)
        by_word = np.array([every[self._word_of == w].min() for w in range(len(self.words))])
        order = np.argsort(by_word, kind="stable")
        best = int(order[0])
        d1 = float(by_word[best])
        d2 = float(by_word[order[1]]) if len(order) > 1 else 2.0 * d1
        free = free_distance(x, np.concatenate(moved))
        nearest = int(np.flatnonzero(self._word_of == best)[np.argmin(every[self._word_of == best])])
        evidence = np.array(
            [
                np.log(d1 / self._own[best]),
                np.log(d1 / d2),
                np.log(d1 / free),
                np.log(d1 / float(by_word.mean())),
                abs(np.log(len(x) / self._lengths[nearest])),
            ]
        )
        return Verdict(
            word=self.words[best], score=float(WEIGHTS @ evidence + BIAS), distances=by_word, evidence=evidence
        )


def free_distance(x: Floats, frames: Floats) -> float:
    """Mean distance of each frame to its nearest frame of any template: how well *any* sequence could explain x."""
    squares = (x * x).sum(1)[:, None] + (frames * frames).sum(1)[None] - 2.0 * (x @ frames.T)
    return float(np.sqrt(np.maximum(squares.min(axis=1), 1e-6)).mean())

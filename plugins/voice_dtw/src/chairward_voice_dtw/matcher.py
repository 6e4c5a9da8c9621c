"""Which word a segment is, and how sure that is.

The templates are moved into the room of the segment (its noise added at the segment's level: parallel model
combination, Gales & Young 1996, here on mel power), so that both sides of the comparison are equally noisy.
One fused score: log-odds by logistic regression on distance ratios, fitted on development speakers (calibration.py).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from chairward_voice_dtw import calibration, dtw
from chairward_voice_dtw.frontend import features, moved_features, subtract
from chairward_voice_dtw.segmenter import Segment
from chairward_voice_dtw.templates import Template

WORST_FRAMES = 15
LIMIT = 3.0


@dataclass(frozen=True, slots=True, kw_only=True)
class Verdict:
    """word: the nearest. score: log-odds that it was said. evidence: by `calibration.EVIDENCE`.

    distances: the best of each word, by `Matcher.words`.
    """

    word: str
    score: float
    distances: npt.NDArray[np.float64]
    evidence: npt.NDArray[np.float64]


class Matcher:
    """A person's templates, ready to be compared."""

    def __init__(self, templates: Sequence[Template]) -> None:
        self.words = sorted({t.word for t in templates})
        self._word_of = np.array([self.words.index(t.word) for t in templates])
        clean = [np.ascontiguousarray(subtract(t.mel, t.noise, keep=0.02)) for t in templates]
        self._clean, self._lengths = dtw.pack(clean)
        self._level = np.array([max(float(np.percentile(c.sum(axis=1), 80)), 1e-9) for c in clean])
        packed, lengths = dtw.pack([features(c) for c in clean])
        self._quiet = packed
        table = np.array([dtw.distances(packed[i, : lengths[i]], packed, lengths) for i in range(len(clean))])
        table = np.minimum(table, 1e3)
        self._own, self._between = self._spreads(table)
        self.longest = int(self._lengths.max(initial=60))

    def _spreads(self, table: npt.NDArray[np.float64]) -> tuple[npt.NDArray[np.float64], npt.NDArray[np.float64]]:
        """Per word: the mean distance between its own repetitions, and the median distance to other words'."""
        own, between = np.ones(len(self.words)), np.ones(len(self.words))
        for w in range(len(self.words)):
            mine, others = np.flatnonzero(self._word_of == w), np.flatnonzero(self._word_of != w)
            if len(others):
                between[w] = np.median(table[np.ix_(mine, others)])
            elif len(mine) > 1:
                between[w] = 2.0 * table[np.ix_(mine, mine)].max()
            if len(mine) > 1:
                own[w] = table[np.ix_(mine, mine)].sum() / (len(mine) * (len(mine) - 1))
            else:
                own[w] = 0.6 * between[w]
        return np.maximum(own, 1e-6), np.maximum(between, 1e-6)

    def judge(self, segment: Segment) -> Verdict:
        """Compare one segment with every template."""
        mel, noise = np.ascontiguousarray(segment.mel), segment.noise
        room = float(noise.sum())
        level = max(float(np.percentile(mel.sum(axis=1), 80)) - room, 0.05 * room)
        moved = moved_features(self._clean, self._lengths, level / self._level, noise)
        x = features(mel)
        every = np.minimum(dtw.distances(x, moved, self._lengths), 1e3)
        backwards = np.minimum(dtw.distances(np.ascontiguousarray(x[::-1]), moved, self._lengths), 1e3)
        by_word = np.array([every[self._word_of == w].min() for w in range(len(self.words))])
        order = np.argsort(by_word, kind="stable")
        best = int(order[0])
        mine = np.flatnonzero(self._word_of == best)
        template = int(mine[np.argmin(every[mine])])
        near = dtw.nearest(x, moved, self._lengths)
        d1 = max(float(by_word[best]), 1e-6)
        d2 = float(by_word[order[1]]) if len(order) > 1 else 1.5 * d1
        elsewhere = near[self._word_of != best]
        free_own = float(near[mine].min(axis=0).mean())
        free_others = float(elsewhere.min(axis=0).mean()) if len(elsewhere) else 1.2 * free_own
        freed = np.minimum(dtw.distances(features(subtract(mel, noise)), self._quiet, self._lengths), 1e3)
        freed_by_word = np.array([freed[self._word_of == w].min() for w in range(len(self.words))])
        # capped at 1.5 times the best: beyond that, farther means nothing more
        freed_others = np.delete(freed_by_word, best).min(initial=1.5 * freed_by_word[best])
        worst, straight = dtw.path_shape(x, moved[template, : self._lengths[template]], dtw.BAND, WORST_FRAMES)
        ratios = np.log(
            np.maximum(
                [
                    d1 / self._own[best],
                    d1 / max(d2, 1e-6),
                    d1 / max(float(near.min(axis=0).mean()), 1e-6),
                    d1 / float(by_word.mean()),
                    worst / d1,
                    float(every[mine].mean()) / self._own[best],
                    free_own / max(free_others, 1e-6),
                    d1 / self._between[best],
                    float(backwards.min()) / d1,
                    d1,
                    float(freed_by_word[best]) / self._own[best],
                    float(freed_by_word[best]) / max(float(freed_others), 1e-6),
                    float(freed_by_word[best]) / self._between[best],
                    float(every.min()) / max(float(np.median(every)), 1e-6),
                ],
                1e-9,
            )
        )
        shape = [
            abs(np.log(len(x) / self._lengths[template])),
            straight,
            segment.peak_db / 20.0,
            np.log(len(x) / 60.0),
        ]
        evidence = np.clip(np.concatenate([ratios, shape]), -LIMIT, LIMIT)
        return Verdict(word=self.words[best], score=calibration.score(evidence), distances=by_word, evidence=evidence)

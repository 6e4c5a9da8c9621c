"""Which word a segment is, and how sure that is.

The templates are moved into the room of the segment (its noise added at the segment's level: parallel model
combination, Gales & Young 1996, here on mel power), so that both sides of the comparison are equally noisy.
One fused score: log-odds by logistic regression on distance ratios and, where the speech embedding is installed, on
likenesses of prints (`spotter`), fitted on development speakers (calibration.py).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import numpy.typing as npt

from chairward_voice_dtw import calibration, dtw
from chairward_voice_dtw.frontend import features, moved_features, subtract
from chairward_voice_dtw.segmenter import Segment
from chairward_voice_dtw.spotter import Spotted
from chairward_voice_dtw.templates import Template

LIMIT = 3.0
FARTHEST = 1e3
# what a word is chosen by: log distance in the room's noise, likeness of prints
CHOOSE = (9.0, 4.0)

Numbers = npt.NDArray[np.float64]


@dataclass(frozen=True, slots=True, kw_only=True)
class Measures:
    """What was measured of one segment. moved, backwards: distance to each template in the room's noise, and of the
    reversed segment. free: distance of each frame to each template's nearest frame.
    """

    segment: Segment
    spotted: Spotted | None
    moved: Numbers
    backwards: Numbers
    free: npt.NDArray[np.float32]


@dataclass(frozen=True, slots=True, kw_only=True)
class Verdict:
    """word: the nearest. score: log-odds that it was said."""

    word: str
    score: float


class Matcher:
    """A person's templates, ready to be compared. weights: file of the score."""

    def __init__(self, templates: Sequence[Template], weights: Path = calibration.FILE) -> None:
        self._scores = calibration.fitted(weights)
        self.words = sorted({t.word for t in templates})
        self._word_of = np.array([self.words.index(t.word) for t in templates])
        self._rows = [np.flatnonzero(self._word_of == w) for w in range(len(self.words))]
        clean = [np.ascontiguousarray(subtract(t.mel, t.noise, keep=0.02)) for t in templates]
        self._clean, self._lengths = dtw.pack(clean)
        self._level = np.array([max(float(np.percentile(c.sum(axis=1), 80)), 1e-9) for c in clean])
        quiet = [features(c) for c in clean]
        table = np.array([dtw.distances(q, *dtw.pack(quiet)) for q in quiet])
        self._own, self._between = self._spreads(np.minimum(table, FARTHEST))
        self.longest = int(self._lengths.max(initial=60))
        self._pitch = np.array([t.pitch for t in templates])
        self._usual_pitch = _middle(self._pitch)

    def _spreads(self, table: Numbers) -> tuple[Numbers, Numbers]:
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

    def judge(
        self, segment: Segment, spotted: Spotted | None = None, at_any_pitch: frozenset[str] = frozenset()
    ) -> Verdict:
        """Compare one segment with every template. at_any_pitch: words that count however high they are said."""
        return self.weigh(self.measure(segment, spotted), at_any_pitch)

    def measure(self, segment: Segment, spotted: Spotted | None = None) -> Measures:
        """The distances of one segment to every template."""
        mel, noise = np.ascontiguousarray(segment.mel), segment.noise
        room = float(noise.sum())
        level = max(float(np.percentile(mel.sum(axis=1), 80)) - room, 0.05 * room)
        moved = moved_features(self._clean, self._lengths, level / self._level, noise)
        near, backwards, free = dtw.both_ways(features(mel), moved, self._lengths)
        return Measures(
            segment=segment,
            spotted=spotted,
            moved=np.clip(near, 1e-6, FARTHEST),
            backwards=np.clip(backwards, 1e-6, FARTHEST),
            free=free,
        )

    def weigh(self, m: Measures, at_any_pitch: frozenset[str] = frozenset()) -> Verdict:
        """The nearest word and how sure it is."""
        word, evidence = self.evidence(m)
        if m.spotted is not None and word in at_any_pitch:
            evidence[list(calibration.PITCH)] = 0.0
        return Verdict(word=word, score=float(self._scores[len(evidence)].of(evidence)))

    def evidence(self, m: Measures, without: str | None = None) -> tuple[str, Numbers]:
        """The nearest word and what speaks for it, by `calibration.EVIDENCE`. without: as if that word had not been
        enrolled (for the calibration)."""
        keep = [w for w, word in enumerate(self.words) if word != without]
        allowed = np.concatenate([self._rows[w] for w in keep])
        moved = np.array([m.moved[rows].min() for rows in self._rows])
        choice = -CHOOSE[0] * np.log(moved)
        if m.spotted is not None:
            choice += CHOOSE[1] * m.spotted.best
        best = max(keep, key=lambda w: choice[w])
        others = [w for w in keep if w != best]
        mine = self._rows[best]
        nearest = mine[int(np.argmin(m.moved[mine]))]
        d, own, between = float(moved[best]), self._own[best], self._between[best]
        free = np.array([m.free[rows].min(axis=0).mean() for rows in self._rows])
        ratios = [
            d / own,
            d / moved[others].min(initial=1.5 * d),
            d / moved[keep].mean(),
            m.moved[mine].mean() / own,
            d / between,
            m.backwards[allowed].min() / d,
            free[best] / free[others].min(initial=1.2 * free[best]),
            d / max(float(m.free[mine].mean(axis=1).min()), 1e-6),
            d,
            len(m.segment.mel) / 60.0,
        ]
        stretch = abs(np.log(len(m.segment.mel) / self._lengths[nearest]))
        around = [m.segment.before_db / 10.0, m.segment.after_db / 10.0, m.segment.peak_db / 20.0]
        prints = []
        if m.spotted is not None:
            likeness, usual, phrase = m.spotted.best, m.spotted.usual, m.spotted.phrase
            phrases = [
                phrase[best] / m.spotted.spread[best],
                phrase[best] / phrase[others].min(initial=1.5 * phrase[best]),
                phrase[best] / phrase[keep].mean(),
                m.spotted.usual_phrase[best] / m.spotted.spread[best],
            ]
            prints = [
                likeness[best],
                likeness[best] - likeness[others].max(initial=0.0),
                likeness[best] - likeness[keep].mean(),
                usual[best],
                usual[best] - usual[others].max(initial=0.0),
                phrase[best],
                *np.log(phrases),
                *self._off_pitch(m.segment.pitch, mine),
                m.segment.harmonic,
            ]
        found = [*np.log(np.maximum(ratios, 1e-9)), stretch, *around, *prints]
        return self.words[best], np.clip(found, -LIMIT, LIMIT)

    def _off_pitch(self, pitch: float, mine: npt.NDArray[np.int64]) -> list[float]:
        """Octaves off the person's pitch, and off the nearest of the word's own recordings; 0 when not known."""
        off = np.abs(self._pitch[mine] - pitch)
        apart = [abs(self._usual_pitch - pitch), float(off[np.isfinite(off)].min(initial=np.inf))]
        return [octaves if np.isfinite(octaves) else 0.0 for octaves in apart]


def _middle(values: Numbers) -> float:
    """The median of those that are known; NaN when none is."""
    known = values[np.isfinite(values)]
    return float(np.median(known)) if len(known) else float("nan")

"""Which word may just have ended, without anybody saying where it began or ended: the embeddings of the last second are
compared with those of the templates every 40 ms, and where the likeness peaks a word is offered.

A print is four embeddings 200 ms apart, the newest TAIL_S after the word's end, without the person's mean, of unit
length. Each template gives one for each of CONDITIONS, so that some print is as noisy as the room. Energy endpointers
lose words in noise (README); likeness does not need the word to stand out.

Where a word is offered, all embeddings of the stretch (its phrase) are warped in time onto those of each template: that
refuses words that only end alike, or are said in another order.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from chairward_voice_dtw.audio import RATE_HZ, Floats
from chairward_voice_dtw.embedding import SIZE, SPAN, STEP, EmbeddingStream, Network, window_end
from chairward_voice_dtw.frontend import HOP, WINDOW
from chairward_voice_dtw.jit import jit
from chairward_voice_dtw.templates import LEVEL_DBFS, Template

TAIL_S = 0.14
BACK = np.array((15, 10, 5, 0))
"""Embeddings of a print, counted back from the newest."""
NEEDED = SPAN + STEP * int(BACK.max())
"""Frames that a print sees."""
CONDITIONS = ((0.0, 200.0), (0.0, 10.0), (0.5, 10.0), (1.0, 10.0))
"""Noise of a print: slope of its amplitude over frequency (0 white, 1 red), and dB under the word."""
FLOOR = 0.3
"""Likeness under which nothing is offered; five in a hundred words at 5 dB had less than 0.36 to 0.45."""
MOST_ALIKE = 4
AROUND = 6
"""Embeddings of a phrase more than the word is long: those that see its beginning and its end."""
LONGEST = 60

Numbers = npt.NDArray[np.float64]


@dataclass(frozen=True, slots=True, kw_only=True)
class Spotted:
    """A word that may have ended at frame `last` (10 ms, of the stream); `first` is a template's length before.

    known: the newest frame that this rests on. best: likeness (cosine) of each word's best print; usual: the mean of
    its MOST_ALIKE best. phrase, usual_phrase: the same of the distance between phrases; spread: that distance between
    each word's own recordings.
    """

    first: int
    last: int
    known: int
    best: Numbers
    usual: Numbers
    phrase: Numbers
    usual_phrase: Numbers
    spread: Numbers


def coloured(length: int, slope: float, seed: int) -> Floats:
    """Noise of unit level whose amplitude falls as frequency to the -slope; nothing under 60 Hz."""
    spectrum = np.fft.rfft(np.random.default_rng(seed).normal(size=length))
    hz = np.fft.rfftfreq(length, 1.0 / RATE_HZ)
    spectrum *= np.where(hz < 60.0, 0.0, np.maximum(hz, 60.0) ** -slope)
    sound = np.fft.irfft(spectrum, length)
    return np.asarray(sound / sound.std(), np.float32)


def phrase_length(frames: int) -> int:
    """Embeddings of the phrase of a word of that many frames."""
    return min(LONGEST, round(frames / STEP) + AROUND)


@jit
def _warp(likeness: Floats, lengths: npt.NDArray[np.int64], out: Numbers) -> None:
    """out[r]: symmetric DTW (1/2/1, no band) over 1 - likeness[:, r, :lengths[r]], divided by the lengths' sum."""
    n = likeness.shape[0]
    for r in range(len(lengths)):
        m = lengths[r]
        before = np.full(m + 1, np.inf)
        now = np.full(m + 1, np.inf)
        before[0] = 0.0
        for i in range(n):
            now[0] = np.inf
            for j in range(m):
                cost = 1.0 - likeness[i, r, j]
                now[j + 1] = min(before[j] + 2.0 * cost, min(before[j + 1], now[j]) + cost)
            before, now = now, before
        out[r] = before[m] / (n + m)


class Phrases:
    """The embeddings of each recording of a word, end to end, in each of CONDITIONS."""

    def __init__(self, rows: Sequence[Floats], rows_of_word: Sequence[npt.NDArray[np.int64]]) -> None:
        self._rows_of_word = rows_of_word
        self._lengths = np.array([len(row) for row in rows], np.int64)
        self.longest = int(self._lengths.max())
        packed = np.zeros((len(rows), self.longest, SIZE), np.float32)
        for place, row in zip(packed, rows, strict=True):
            place[: len(row)] = unit(row)
        self._flat = np.ascontiguousarray(packed.reshape(-1, SIZE).T)
        table = np.array([self._distances(row) for row in rows])
        self.spread = np.array([max(float(table[np.ix_(own, own)].mean()), 1e-3) for own in rows_of_word])

    def _distances(self, x: Floats) -> Numbers:
        likeness = (unit(x) @ self._flat).reshape(len(x), len(self._lengths), -1)
        out = np.empty(len(self._lengths))
        _warp(likeness, self._lengths, out)
        return np.maximum(out, 1e-4)

    def compare(self, x: Floats) -> tuple[Numbers, Numbers]:
        """Of embeddings without the person's mean (n x SIZE): each word's least distance, and its MOST_ALIKE least."""
        found = self._distances(x)
        own = [np.sort(found[rows]) for rows in self._rows_of_word]
        return np.array([d[0] for d in own]), np.array([d[:MOST_ALIKE].mean() for d in own])


def unit(x: Floats) -> Floats:
    """Rows of unit length."""
    return np.asarray(x / (np.linalg.norm(x, axis=-1, keepdims=True) + 1e-9), np.float32)


class Prints:
    """A person's templates as prints, made once. words: as `Matcher.words` orders them."""

    def __init__(self, model: Network, templates: Sequence[Template], words: Sequence[str]) -> None:
        stacks, phrases, means, frames = [], [], [], []
        for number, template in enumerate(templates):
            # no more than is looked at, to the sample that makes the newest frame whole
            stop = round((template.end_s + TAIL_S) * RATE_HZ) + WINDOW - HOP
            long = round(100.0 * (template.end_s - template.onset_s))
            needed = max(NEEDED, SPAN + STEP * phrase_length(long))
            sound = template.sound[max(0, stop - needed * HOP - WINDOW + HOP) : stop]
            for slope, under_db in CONDITIONS:
                noise = coloured(len(sound), slope, number)
                noisy = sound + noise * np.float32(10.0 ** ((LEVEL_DBFS - under_db) / 20.0))
                embeddings = EmbeddingStream(model).push_all(noisy)[SPAN // STEP - 1 :]
                stacks.append(embeddings[-1 - BACK])
                phrases.append(embeddings[-phrase_length(long) :])
                means.append(embeddings[-1 - int(BACK.max()) :].mean(axis=0))
                frames.append(long)
        self.model = model
        self._mean = np.mean(means, axis=0)
        self.rows = np.array([self.of(stack) for stack in stacks])
        word_of = np.repeat([words.index(t.word) for t in templates], len(CONDITIONS))
        self.rows_of_word = [np.flatnonzero(word_of == w) for w in range(len(words))]
        self.frames = np.array(frames)
        self.phrases = Phrases([self.centred(phrase) for phrase in phrases], self.rows_of_word)

    def centred(self, embeddings: Floats) -> Floats:
        """Without the person's mean."""
        return np.asarray(embeddings - self._mean, np.float32)

    def of(self, stack: Floats) -> Numbers:
        """The print of embeddings (len(BACK) x SIZE)."""
        flat = (stack - self._mean).ravel().astype(np.float64)
        return np.asarray(flat / (np.linalg.norm(flat) + 1e-9))


class Spotter:
    """Streaming; what it says does not depend on how the sound is cut into blocks.

    at_once: embeddings of a block are computed together: faster for long blocks, equal but for the last bits.
    """

    def __init__(self, prints: Prints, *, at_once: bool = False) -> None:
        self._prints = prints
        stream = EmbeddingStream(prints.model)
        self._embeddings = stream.push_all if at_once else stream.push
        self._recent = np.zeros((max(int(BACK.max()), prints.phrases.longest) + 1, SIZE), np.float32)
        self._count = 0
        self._now = self._before = np.full(len(prints.rows), -1.0)

    def push(self, samples: Floats) -> list[Spotted]:
        """The words that may have ended, as soon as the likeness falls again."""
        found = []
        for embedding in self._embeddings(samples):
            self._recent = np.concatenate([self._recent[1:], embedding[None]])
            after = np.full(len(self._prints.rows), -1.0)
            if self._count >= SPAN // STEP:
                after = self._prints.rows @ self._prints.of(self._recent[len(self._recent) - 1 - BACK])
            peak = self._now.max()
            if peak >= FLOOR and peak >= self._before.max() and peak > after.max():
                found.append(self._spotted(self._now, self._count - 1))
            self._before, self._now = self._now, after
            self._count += 1
        return found

    def _spotted(self, likeness: Numbers, t: int) -> Spotted:
        """The newest embedding came after the peak at t."""
        by_word = [np.sort(likeness[rows])[::-1] for rows in self._prints.rows_of_word]
        last = window_end(t) + 1 - round(100.0 * TAIL_S)
        long = int(self._prints.frames[int(np.argmax(likeness))])
        phrases = self._prints.phrases
        phrase, usual_phrase = phrases.compare(self._prints.centred(self._recent[-1 - phrase_length(long) : -1]))
        return Spotted(
            first=last - long,
            last=last,
            known=window_end(t + 1),
            best=np.array([own[0] for own in by_word]),
            usual=np.array([own[:MOST_ALIKE].mean() for own in by_word]),
            phrase=phrase,
            usual_phrase=usual_phrase,
            spread=phrases.spread,
        )

"""Which word may just have ended, without anybody saying where it began or ended: the embeddings of the last second are
compared with those of the templates every 40 ms, and where the likeness peaks a word is offered.

A print is four embeddings 200 ms apart, the newest TAIL_S after the word's end, without the person's mean, of unit
length. Each template gives one for each of CONDITIONS, so that some print is as noisy as the room. Energy endpointers
lose words in noise (README); likeness does not need the word to stand out.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from chairward_voice_dtw.audio import RATE_HZ, Floats
from chairward_voice_dtw.embedding import SIZE, SPAN, STEP, EmbeddingStream, Network, window_end
from chairward_voice_dtw.frontend import HOP, WINDOW
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


@dataclass(frozen=True, slots=True)
class Spotted:
    """A word that may have ended at frame `last` (10 ms, of the stream); `first` is a template's length before.

    known: the newest frame that this rests on. best: likeness (cosine) of each word's best print; usual: the mean of
    its MOST_ALIKE best.
    """

    first: int
    last: int
    known: int
    best: npt.NDArray[np.float64]
    usual: npt.NDArray[np.float64]


def coloured(length: int, slope: float, seed: int) -> Floats:
    """Noise of unit level whose amplitude falls as frequency to the -slope; nothing under 60 Hz."""
    spectrum = np.fft.rfft(np.random.default_rng(seed).normal(size=length))
    hz = np.fft.rfftfreq(length, 1.0 / RATE_HZ)
    spectrum *= np.where(hz < 60.0, 0.0, np.maximum(hz, 60.0) ** -slope)
    sound = np.fft.irfft(spectrum, length)
    return np.asarray(sound / sound.std(), np.float32)


class Prints:
    """A person's templates as prints, made once. words: as `Matcher.words` orders them."""

    def __init__(self, model: Network, templates: Sequence[Template], words: Sequence[str]) -> None:
        stacks, means = [], []
        for number, template in enumerate(templates):
            # no more than the print sees, to the sample that makes its newest frame whole
            stop = round((template.end_s + TAIL_S) * RATE_HZ) + WINDOW - HOP
            sound = template.sound[max(0, stop - NEEDED * HOP - WINDOW + HOP) : stop]
            for slope, under_db in CONDITIONS:
                noise = coloured(len(sound), slope, number)
                noisy = sound + noise * np.float32(10.0 ** ((LEVEL_DBFS - under_db) / 20.0))
                embeddings = EmbeddingStream(model).push_all(noisy)[SPAN // STEP - 1 :]
                stacks.append(embeddings[-1 - BACK])
                means.append(embeddings.mean(axis=0))
        self.model = model
        self._mean = np.mean(means, axis=0)
        self.rows = np.array([self.of(stack) for stack in stacks])
        word_of = np.repeat([words.index(t.word) for t in templates], len(CONDITIONS))
        self.rows_of_word = [np.flatnonzero(word_of == w) for w in range(len(words))]
        self.frames = np.repeat([round(100.0 * (t.end_s - t.onset_s)) for t in templates], len(CONDITIONS))

    def of(self, stack: Floats) -> npt.NDArray[np.float64]:
        """The print of embeddings (len(BACK) x SIZE)."""
        flat = (stack - self._mean).ravel().astype(np.float64)
        return np.asarray(flat / (np.linalg.norm(flat) + 1e-9))


class Spotter:
    """Streaming; what it says does not depend on how the sound is cut into blocks."""

    def __init__(self, prints: Prints) -> None:
        self._prints = prints
        self._stream = EmbeddingStream(prints.model)
        self._recent = np.zeros((int(BACK.max()) + 1, SIZE), np.float32)
        self._count = 0
        self._now = self._before = np.full(len(prints.rows), -1.0)

    def push(self, samples: Floats) -> list[Spotted]:
        """The words that may have ended, as soon as the likeness falls again."""
        found = []
        for embedding in self._stream.push(samples):
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

    def _spotted(self, likeness: npt.NDArray[np.float64], t: int) -> Spotted:
        by_word = [np.sort(likeness[rows])[::-1] for rows in self._prints.rows_of_word]
        last = window_end(t) + 1 - round(100.0 * TAIL_S)
        return Spotted(
            first=last - int(self._prints.frames[int(np.argmax(likeness))]),
            last=last,
            known=window_end(t + 1),
            best=np.array([own[0] for own in by_word]),
            usual=np.array([own[:MOST_ALIKE].mean() for own in by_word]),
        )

"""How high a voice is, every 10 ms, as a stream: what tells one person from another where words do not.

Autocorrelation of a frame between LOW_HZ and HIGH_HZ, divided by that of its window (Boersma 1993): the highest peak,
less OCTAVE_COST for each octave down, for a voice repeats itself after two periods too.
"""

from __future__ import annotations

from math import ceil, nan
from statistics import median

import numpy as np

from chairward_voice_dtw.audio import RATE_HZ, Floats
from chairward_voice_dtw.frontend import HOP, WINDOW
from chairward_voice_dtw.jit import jit

SPAN = 384
FFT = 512
"""SPAN and the longest lag fit in."""
SHORTEST, LONGEST = 20, 114
"""Lags in samples: 400 to 70 Hz."""
LOW_HZ, HIGH_HZ = 60.0, 1000.0
OCTAVE_COST = 0.03
VOICED = 0.5
"""Least height of the peak in a voiced frame; 1 is a perfect repetition."""
FEWEST = 4
"""Voiced frames that a pitch needs."""
LOUDER = 0.4
"""Share of a word's frames that are too soft to be asked."""


@jit
def _peaks(power: Floats, cosines: Floats, own: Floats, cost: Floats, out: Floats) -> None:
    """out[t]: log2 Hz, height and power of the highest peak of frame t; plain loops, so that no block changes a bit."""
    for t in range(power.shape[0]):
        level = np.float32(1e-12)
        for k in range(power.shape[1]):
            level += power[t, k]
        best, highest = 0, np.float32(-1e9)
        for lag in range(cosines.shape[0]):
            total = np.float32(0.0)
            for k in range(power.shape[1]):
                total += power[t, k] * cosines[lag, k]
            height = total * own[lag] / level - cost[lag]
            if height > highest:
                best, highest = lag, height
        out[t, 0] = np.log2(np.float32(RATE_HZ) / np.float32(best + SHORTEST))
        out[t, 1] = highest + cost[best]
        out[t, 2] = level


class PitchStream:
    """8 kHz samples in; for each mel frame that they complete log2 Hz, how surely (the peak's height) and power."""

    def __init__(self) -> None:
        self._window = np.hanning(SPAN).astype(np.float32)
        lags = np.arange(SHORTEST, LONGEST + 1)
        own = np.fft.irfft(np.abs(np.fft.rfft(self._window, FFT)) ** 2)
        self._own = (own[0] / own[lags]).astype(np.float32)
        self._cost = (OCTAVE_COST * np.log2(lags / SHORTEST)).astype(np.float32)
        self._bins = slice(round(LOW_HZ * FFT / RATE_HZ), round(HIGH_HZ * FFT / RATE_HZ) + 1)
        bins = np.arange(FFT // 2 + 1)[self._bins]
        self._cosines = np.cos(2.0 * np.pi * np.outer(lags, bins) / FFT).astype(np.float32)
        # a frame ends where the mel frame of the same number ends
        self._rest = np.zeros(SPAN - WINDOW, np.float32)

    def push(self, samples: Floats) -> Floats:
        """The new frames, n x 3."""
        self._rest = np.concatenate([self._rest, samples.astype(np.float32)])
        count = max(0, (len(self._rest) - SPAN) // HOP + 1)
        frames = np.empty((count, SPAN), np.float32)
        for t in range(count):
            np.multiply(self._rest[t * HOP : t * HOP + SPAN], self._window, out=frames[t])
        self._rest = self._rest[count * HOP :]
        out = np.empty((count, 3), np.float32)
        if count:
            spectrum = np.fft.rfft(frames, FFT, axis=1)[:, self._bins]
            power = np.ascontiguousarray(spectrum.real**2 + spectrum.imag**2, np.float32)
            _peaks(power, self._cosines, self._own, self._cost, out)
        return out


def pitch_of(track: Floats) -> tuple[float, float]:
    """Of a word's frames (n x 3): log2 Hz, NaN when too few frames are voiced; and the share that is."""
    if not len(track):
        return nan, 0.0
    frames = track.tolist()
    least = sorted(power for _, _, power in frames)[ceil(LOUDER * (len(frames) - 1))]
    loud = [(octave, height) for octave, height, power in frames if power >= least]
    voiced = [octave for octave, height in loud if height >= VOICED]
    return median(voiced) if len(voiced) >= FEWEST else nan, len(voiced) / len(loud)

"""From 8 kHz samples to mel power frames (streaming) and from a stretch of frames to MFCC features (per word).

25 ms Hamming windows every 10 ms, pre-emphasis 0.97, 24 triangular mel bands 100..3800 Hz (each of unit sum),
cepstrum c0..c12 liftered, mean and variance normalised over the word, with first derivatives
(Davis & Mermelstein 1980; Furui 1981; the choice was made on development speakers, README).
"""

from __future__ import annotations

from functools import cache

import numpy as np
import numpy.typing as npt

from chairward_voice_dtw.audio import RATE_HZ, Floats
from chairward_voice_dtw.jit import jit

HOP = RATE_HZ // 100
WINDOW = RATE_HZ // 40
FFT = 256
BANDS = 24
CEPSTRA = 13
DIMENSIONS = 2 * CEPSTRA
PRE_EMPHASIS = 0.97
POWER_FLOOR = 1e-6
"""Band power of about -80 dBFS: below it a recording is digital silence, not a quieter room."""


def hz_to_mel(hz: float) -> float:
    """Mel scale, 2595 log10(1 + f/700)."""
    return float(2595.0 * np.log10(1.0 + hz / 700.0))


def mel_to_hz(mel: npt.NDArray[np.float64]) -> npt.NDArray[np.float64]:
    """Inverse of hz_to_mel."""
    return 700.0 * (10.0 ** (mel / 2595.0) - 1.0)


@cache
def mel_filters() -> Floats:
    """BANDS x (FFT/2+1) weights, rows of unit sum."""
    edges = mel_to_hz(np.linspace(hz_to_mel(100.0), hz_to_mel(3800.0), BANDS + 2))
    hz = np.arange(FFT // 2 + 1) * RATE_HZ / FFT
    rising = (hz[None] - edges[:-2, None]) / (edges[1:-1] - edges[:-2])[:, None]
    falling = (edges[2:, None] - hz[None]) / (edges[2:] - edges[1:-1])[:, None]
    weights = np.maximum(0.0, np.minimum(rising, falling))
    return np.asarray(weights / weights.sum(axis=1, keepdims=True), np.float32)


@jit
def band_power(power: Floats, filters: Floats, out: Floats) -> None:
    """out[t, b] = sum of power[t] over filter b: plain loops, so a frame's value never depends on its block."""
    for t in range(power.shape[0]):
        for b in range(filters.shape[0]):
            total = np.float32(0.0)
            for k in range(filters.shape[1]):
                total += power[t, k] * filters[b, k]
            out[t, b] = total


class MelStream:
    """Frame t covers samples HOP*t .. HOP*t+WINDOW of the stream and comes out as soon as the last of them is in.

    window: WINDOW weights (Hamming by default). filters: bands x (FFT/2+1) (`mel_filters` by default).
    """

    def __init__(
        self, *, window: Floats | None = None, filters: Floats | None = None, pre_emphasis: float = PRE_EMPHASIS
    ) -> None:
        self._rest = np.zeros(0, np.float32)
        self._last = np.float32(0.0)
        self._window = np.hamming(WINDOW).astype(np.float32) if window is None else window
        self._filters = mel_filters() if filters is None else filters
        self._pre_emphasis = np.float32(pre_emphasis)

    def push(self, samples: Floats) -> Floats:
        """New frames, n x bands power (float32)."""
        bands = len(self._filters)
        if len(samples):
            emphasised = samples.astype(np.float32)
            emphasised[1:] -= self._pre_emphasis * samples[:-1]
            emphasised[0] -= self._pre_emphasis * self._last
            self._last = np.float32(samples[-1])
            self._rest = np.concatenate([self._rest, emphasised])
        count = (len(self._rest) - WINDOW) // HOP + 1
        if count <= 0:
            return np.zeros((0, bands), np.float32)
        frames = np.empty((count, WINDOW), np.float32)
        for t in range(count):
            np.multiply(self._rest[t * HOP : t * HOP + WINDOW], self._window, out=frames[t])
        self._rest = self._rest[count * HOP :]
        spectrum = np.fft.rfft(frames, FFT, axis=1)
        power = np.ascontiguousarray(spectrum.real**2 + spectrum.imag**2, np.float32)
        out = np.empty((count, bands), np.float32)
        band_power(power, self._filters, out)
        return out


@cache
def _cosines() -> Floats:
    """CEPSTRA x BANDS: orthonormal DCT-II, sinusoidal lifter of 22 included."""
    n, k = np.arange(BANDS)[:, None], np.arange(CEPSTRA)[None]
    basis = np.cos(np.pi * k * (2 * n + 1) / (2 * BANDS)) * np.sqrt(2.0 / BANDS)
    basis[:, 0] /= np.sqrt(2.0)
    lifter = (1.0 + 11.0 * np.sin(np.pi * k / 22.0)) / 12.0
    return np.ascontiguousarray((basis * lifter).T, np.float32)


FLOOR = 10.0 ** (-15.0 / 10.0)
DELTA_WEIGHT = 1.5


@jit
def _features_into(mel: Floats, gain: float, noise: Floats, cosines: Floats, out: Floats) -> None:
    """Features of gain * mel + noise; see `features`."""
    n, bands, cepstra = mel.shape[0], mel.shape[1], cosines.shape[0]
    mean = 0.0
    for t in range(n):
        for b in range(bands):
            mean += gain * mel[t, b] + noise[b]
    lift = FLOOR * mean / (n * bands) + 1e-10
    logs = np.empty(bands, np.float32)
    for t in range(n):
        for b in range(bands):
            logs[b] = np.log(np.float32(gain * mel[t, b] + noise[b] + lift))
        for c in range(cepstra):
            total = np.float32(0.0)
            for b in range(bands):
                total += logs[b] * cosines[c, b]
            out[t, c] = total
    spreads = np.empty(cepstra)
    overall = 0.0
    for c in range(cepstra):
        average = 0.0
        for t in range(n):
            average += out[t, c]
        average /= n
        square = 0.0
        for t in range(n):
            out[t, c] -= average
            square += out[t, c] * out[t, c]
        spreads[c] = np.sqrt(square / n)
        overall += square
    overall = np.sqrt(overall / (n * cepstra))
    for c in range(cepstra):
        scale = 1.0 / (spreads[c] + 0.1 * overall + 1e-3)
        for t in range(n):
            out[t, c] *= scale
    for t in range(n):
        before2, before1, after1, after2 = max(t - 2, 0), max(t - 1, 0), min(t + 1, n - 1), min(t + 2, n - 1)
        for c in range(cepstra):
            slope = 2.0 * (out[after2, c] - out[before2, c]) + out[after1, c] - out[before1, c]
            out[t, cepstra + c] = DELTA_WEIGHT * slope / 10.0


def features(mel: Floats, *, gain: float = 1.0, noise: Floats | None = None) -> Floats:
    """Mel power frames of one word (n x BANDS) to n x DIMENSIONS float32, of gain * mel + noise.

    Log mel power over a floor 15 dB under the word's mean (so that the valleys of the spectrum, which noise fills, do
    not count), cepstra, mean and variance normalised over the word, and slopes over five frames (edges repeated).
    """
    out = np.empty((len(mel), DIMENSIONS), np.float32)
    _features_into(mel, gain, np.zeros(BANDS, np.float32) if noise is None else noise, _cosines(), out)
    return out


@jit
def _move_all(
    clean: Floats,
    lengths: npt.NDArray[np.int64],
    gains: npt.NDArray[np.float64],
    noise: Floats,
    cosines: Floats,
    out: Floats,
) -> None:
    for r in range(len(lengths)):
        n = lengths[r]
        _features_into(clean[r, :n], gains[r], noise, cosines, out[r, :n])


def moved_features(
    clean: Floats, lengths: npt.NDArray[np.int64], gains: npt.NDArray[np.float64], noise: Floats
) -> Floats:
    """Features of packed templates (r x longest x BANDS) at a level and in a room: r x longest x DIMENSIONS."""
    out = np.zeros((*clean.shape[:2], DIMENSIONS), np.float32)
    _move_all(clean, lengths, gains, noise, _cosines(), out)
    return out


def subtract(mel: Floats, noise: Floats, *, factor: float = 1.5, keep: float = 0.05) -> Floats:
    """Spectral subtraction with a relative floor (Berouti 1979)."""
    return np.asarray(np.maximum(mel - np.float32(factor) * noise, np.float32(keep) * mel), np.float32)

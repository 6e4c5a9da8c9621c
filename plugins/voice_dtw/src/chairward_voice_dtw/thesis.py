"""The thesis' own recogniser, word for word: for the simulator, files and a robot nobody sits on.

No rejection: every sound gets a word; the stop template's distance is the starting minimum and another word must be
strictly nearer, so ties stop. One stored template a word, 1.5 s at 8 kHz. `code`: log mel energies and asymmetric DP,
as the program had them; `text`: cepstra with energy and slopes, symmetric weights and band, as the chapter has them.
(Thesis section 6. The thesis starts a recording by hand; in a stream the endpointer's onset starts it.)
"""

from __future__ import annotations

from functools import cache
from typing import Literal

import numpy as np
import numpy.typing as npt

from chairward_voice_dtw.audio import RATE_HZ, Floats
from chairward_voice_dtw.jit import jit

Mode = Literal["text", "code"]
RECORDING = 3 * RATE_HZ // 2
WINDOW, SHIFT, BANDS, CEPSTRA = 256, 80, 22, 14
BAND_FRAMES = 30


@cache
def filters() -> npt.NDArray[np.float64]:
    """BANDS x 128 triangles, centres equally spaced in mel up to fs/2, each of sum 1."""
    half = WINDOW // 2
    mel = np.linspace(0.0, 2595.0 * np.log10(1.0 + RATE_HZ / 2 / 700.0), BANDS + 2)
    centres = np.round(700.0 * (10.0 ** (mel / 2595.0) - 1.0) / (RATE_HZ / 2) * (half - 1)).astype(int)
    out = np.zeros((BANDS, half))
    for b in range(BANDS):
        low, mid, high = centres[b : b + 3]
        for k in range(low, high + 1):
            rise = (k - low) / max(1, mid - low)
            fall = (high - k) / max(1, high - mid)
            out[b, k] = 1.0 if k == mid else min(rise, 1.0) if k < mid else fall
        out[b] /= out[b].sum()
    return out


def powers(samples: Floats) -> npt.NDArray[np.float64]:
    """Power of the lower half of each frame's spectrum, n x 128."""
    x = np.asarray(samples, np.float64)
    x = np.pad(x, (0, max(0, WINDOW - len(x))))
    frames = np.lib.stride_tricks.sliding_window_view(x, WINDOW)[::SHIFT] * np.hamming(WINDOW)
    spectrum = np.fft.rfft(frames, WINDOW, axis=1)[:, : WINDOW // 2]
    return np.asarray(spectrum.real**2 + spectrum.imag**2)


def code_features(samples: Floats) -> npt.NDArray[np.float64]:
    """n x 22: log of mel energies over the frame's energy, not below log 1e-4."""
    power = powers(samples)
    energy = power.sum(axis=1, keepdims=True)
    logs: npt.NDArray[np.float64] = np.log(np.maximum(power @ filters().T / np.maximum(energy, 1e-20), 1e-4))
    return logs


def text_features(samples: Floats) -> npt.NDArray[np.float64]:
    """n x 30: 14 cepstra and the log energy of pre-emphasised frames, and their slopes."""
    x = np.asarray(samples, np.float64)
    power = powers(np.append(x[:1], x[1:] - 0.97 * x[:-1]).astype(np.float64))
    logs = np.log(np.maximum(power @ filters().T, 1e-10))
    k, q = np.arange(BANDS)[:, None], np.arange(CEPSTRA)[None]
    static = np.hstack([logs @ np.cos(np.pi * q * (2 * k + 1) / (2 * BANDS)), np.log(power.sum(1) + 1e-10)[:, None]])
    around = np.vstack([static[:1], static, static[-1:]])
    return np.hstack([static, (around[2:] - around[:-2]) / 2.0])


@jit
def code_distance(x: npt.NDArray[np.float64], y: npt.NDArray[np.float64]) -> float:
    """Asymmetric DP along the input x: predecessors i, i-1, i-2 of the template y, weight 1, far corner."""
    n, m = x.shape[0], y.shape[0]
    before = np.full(m, np.inf)
    now = np.full(m, np.inf)
    before[0] = np.sqrt(((x[0] - y[0]) ** 2).sum())
    for j in range(1, n):
        for i in range(m):
            best = before[i]
            if i >= 1:
                best = min(best, before[i - 1])
            if i >= 2:
                best = min(best, before[i - 2])
            now[i] = best + np.sqrt(((x[j] - y[i]) ** 2).sum())
        before, now = now, before
    return float(before[m - 1])


@jit
def text_distance(x: npt.NDArray[np.float64], y: npt.NDArray[np.float64]) -> float:
    """Symmetric DTW, predecessors (i, j-1), (i-1, j-1), (i-1, j) with weights 1, 2, 1, two columns, fixed band."""
    n, m = x.shape[0], y.shape[0]
    reach = max(BAND_FRAMES, abs(n - m) + 1)
    before = np.full(m + 1, np.inf)
    now = np.full(m + 1, np.inf)
    before[0] = 0.0
    for j in range(n):
        now[:] = np.inf
        for i in range(max(0, j - reach), min(m, j + reach + 1)):
            cost = np.sqrt(((x[j] - y[i]) ** 2).sum())
            best = min(before[i] + 2.0 * cost, before[i + 1] + cost)
            now[i + 1] = min(best, now[i] + cost)
        before, now = now, before
    return float(before[m])


class ThesisMatcher:
    """One template a word; `decide` gives the word for 1.5 s of sound at RATE_HZ."""

    def __init__(self, recordings: dict[str, Floats], stop_word: str, mode: Mode) -> None:
        self._features = code_features if mode == "code" else text_features
        self._distance = code_distance if mode == "code" else text_distance
        self._stop = stop_word
        self._templates = {word: self._features(one_recording(x)) for word, x in recordings.items()}

    def distances(self, samples: Floats) -> dict[str, float]:
        """Distance to each word's template."""
        x = self._features(one_recording(samples))
        return {word: float(self._distance(x, y)) for word, y in self._templates.items()}

    def decide(self, samples: Floats) -> str:
        """The word, always one: stop unless another is strictly nearer."""
        found = self.distances(samples)
        word, least = self._stop, found.get(self._stop, np.inf)
        for other, distance in found.items():
            if distance < least:
                word, least = other, distance
        return word


def one_recording(samples: Floats) -> Floats:
    """Exactly 1.5 s: cut, or filled with a whisper of noise so that no frame is empty."""
    if len(samples) >= RECORDING:
        return samples[:RECORDING]
    quiet = float(np.sqrt(np.mean(np.square(samples[-SHIFT:])))) if len(samples) else 0.0
    fill = np.random.default_rng(0).normal(0.0, max(quiet, 1e-5), RECORDING - len(samples))
    return np.concatenate([samples, fill.astype(np.float32)])

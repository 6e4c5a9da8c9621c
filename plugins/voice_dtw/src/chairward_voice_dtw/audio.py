"""Sound in: wav files of any rate and width, and a causal streaming resampler to the working rate."""

from __future__ import annotations

from math import gcd
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from chairward_voice_dtw.jit import jit

Floats = npt.NDArray[np.float32]

RATE_HZ = 8000
"""The working rate: 16 kHz gave no gain on clean words and lost in noise (measured on the development speakers)."""
MIN_RATE_HZ, MAX_RATE_HZ = 8000, 48_000


class SoundError(ValueError):
    """A sound file that cannot be used: one sentence with its name and the reason."""


def read_wav(path: Path, rate_hz: int | None = None) -> tuple[Floats, int]:
    """Mono float32 in -1..1 and its rate; resampled to rate_hz when given.

    Takes whatever libsndfile reads: 8 to 32 bit and float, any number of channels (averaged), 8 kHz and up.
    Raises SoundError for a missing, broken or empty file, or a rate under 8 kHz.
    """
    import soundfile  # type: ignore[import-untyped,unused-ignore]

    if path.is_dir():
        raise SoundError(f"{path}: is a folder: name the sound files in it")
    if not path.is_file():
        raise SoundError(f"{path}: there is no such sound file")
    try:
        data, rate = soundfile.read(str(path), dtype="float32", always_2d=True)
    except (soundfile.LibsndfileError, RuntimeError) as error:
        raise SoundError(f"{path}: cannot be read as sound ({error}); record or export it as wav") from None
    if rate < MIN_RATE_HZ:
        raise SoundError(f"{path}: recorded at {rate} Hz, at least {MIN_RATE_HZ} Hz is needed: record it again")
    samples = np.asarray(data.mean(axis=1), np.float32)
    if not len(samples):
        raise SoundError(f"{path}: holds no sound at all: record it again")
    if not np.isfinite(samples).all():
        raise SoundError(f"{path}: holds values that are not numbers: record or export it again")
    if rate_hz is not None and rate != rate_hz:
        samples, rate = resample(samples, rate, rate_hz), rate_hz
    return samples, rate


def resample(samples: Floats, rate_hz: int, to_hz: int) -> Floats:
    """A whole recording at another rate (polyphase, linear phase)."""
    if rate_hz == to_hz:
        return samples
    from scipy.signal import resample_poly

    common = gcd(rate_hz, to_hz)
    return np.asarray(resample_poly(samples, to_hz // common, rate_hz // common), np.float32)


@jit
def _polyphase(
    data: npt.NDArray[np.float64],
    taps: npt.NDArray[np.float64],
    first: int,
    begin: int,
    up: int,
    down: int,
    out: Floats,
) -> None:
    """out[i]: the filter's phase for output begin+i over the newest inputs it may see; data[0] is input `first`."""
    count = taps.shape[1]
    for i in range(len(out)):
        position = (begin + i) * down
        oldest = position // up - first - (count - 1)
        phase = position % up
        total = 0.0
        for k in range(count):
            total += data[oldest + k] * taps[phase, k]
        out[i] = total


class Resampler:
    """Causal polyphase resampling of a stream, 8..48 kHz to the working rate; block sizes change nothing.

    Each output sample is one dot product summed in one order, so cutting the stream differently changes no bit.
    Delay: half the filter, 1.25 ms at any rate. Same filter as scipy.signal.resample_poly (Kaiser 5.0, 10 lobes).
    """

    def __init__(self, rate_hz: int) -> None:
        if not MIN_RATE_HZ <= rate_hz <= MAX_RATE_HZ:
            raise SoundError(f"a sound of {rate_hz} Hz: {MIN_RATE_HZ} to {MAX_RATE_HZ} Hz can be used")
        common = gcd(rate_hz, RATE_HZ)
        self.rate_hz = rate_hz
        self._up, self._down = RATE_HZ // common, rate_hz // common
        self._next = 0
        self._taps: npt.NDArray[np.float64] | None = None
        if rate_hz != RATE_HZ:
            from scipy.signal import firwin

            half = 10 * max(self._up, self._down)
            filter_: Any = firwin(2 * half + 1, 1.0 / max(self._up, self._down), window=("kaiser", 5.0)) * self._up
            count = -(-len(filter_) // self._up)
            taps = np.zeros((self._up, count))
            for phase in range(self._up):
                part = filter_[phase :: self._up]
                taps[phase, : len(part)] = part
            self._taps = np.ascontiguousarray(taps[:, ::-1])
            self._history = np.zeros(count - 1)
            self._seen = 0

    def push(self, samples: Floats) -> Floats:
        """The next output samples, as many as can be made without looking ahead."""
        if self._taps is None:
            return np.asarray(samples, np.float32)
        count = self._taps.shape[1]
        data = np.concatenate([self._history, samples])
        first = self._seen - (count - 1)
        self._seen += len(samples)
        self._history = data[len(data) - (count - 1) :]
        # output m sits at m*down in the upsampled stream and needs input (m*down)//up and older
        end = -((-self._seen * self._up) // self._down)
        out = np.empty(max(0, end - self._next), np.float32)
        _polyphase(data, self._taps, first, self._next, self._up, self._down, out)
        self._next += len(out)
        return out

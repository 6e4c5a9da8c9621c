"""The microphone's health, every 100 ms: level, the room's noise, clipping, muted, dead."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from chairward_voice_dtw.audio import Floats

SILENT_DBFS = -90.0
CLIP = 0.985
SHOUT_TENTHS = 2


@dataclass(frozen=True, slots=True)
class Health:
    """Levels in dB of full scale. reason: "" when well."""

    well: bool
    level_dbfs: float
    noise_dbfs: float
    clipping: bool
    reason: str


class LevelMeter:
    """Feed it every block; `health` tells the last 100 ms, and what has been wrong for a second."""

    def __init__(self, rate_hz: int, *, loudest_noise_dbfs: float = -20.0, shout_dbfs: float = 0.0) -> None:
        self._rate = rate_hz
        self._loudest_noise_dbfs = loudest_noise_dbfs
        self._shout_dbfs = shout_dbfs
        self._loud_tenths = 0
        self._tenth: list[Floats] = []
        self._size = 0
        self._tenths: list[tuple[float, float, float]] = []
        self._level_dbfs = -120.0

    def push(self, samples: Floats) -> None:
        """Samples in -1..1, any block size; counted in whole tenths of a second."""
        while len(samples):
            take = samples[: self._rate // 10 - self._size]
            samples = samples[len(take) :]
            self._tenth.append(take)
            self._size += len(take)
            if self._size == self._rate // 10:
                self._close_tenth(np.concatenate(self._tenth))
                self._tenth, self._size = [], 0

    def _close_tenth(self, x: Floats) -> None:
        alternating = float(np.sqrt(np.mean((x - x.mean()) ** 2)))
        self._level_dbfs = max(-120.0, 20.0 * float(np.log10(alternating + 1e-6)))
        shouted = self._shout_dbfs < 0.0 and self._level_dbfs >= self._shout_dbfs
        self._loud_tenths = self._loud_tenths + 1 if shouted else 0
        clipped = float(np.mean(np.abs(x) >= CLIP))
        self._tenths.append((self._level_dbfs, clipped, float(np.ptp(x))))
        del self._tenths[:-50]

    @property
    def shout(self) -> bool:
        """For SHOUT_TENTHS whole tenths of a second the sound has been as loud as a shout."""
        return self._loud_tenths >= SHOUT_TENTHS

    def health(self) -> Health:
        """As of the last whole tenth of a second. Noise: the quietest fifth of the last five seconds."""
        if not self._tenths:
            return Health(True, -120.0, -120.0, False, "")
        levels = np.array([t[0] for t in self._tenths])
        noise = float(np.percentile(levels, 20))
        last = self._tenths[-10:]
        clipping = float(np.mean([t[1] for t in last])) > 0.001
        reason = ""
        if len(last) == 10 and all(t[2] == 0.0 for t in last):
            reason = "the microphone gives no sound at all: it is muted, unplugged or dead"
        elif len(last) == 10 and max(t[0] for t in last) < SILENT_DBFS:
            reason = "the microphone is muted or far too quiet: raise its level"
        elif len(self._tenths) == 50 and noise > self._loudest_noise_dbfs:
            reason = (
                f"too noisy to hear 'stop' reliably ({noise:.0f} dBFS of noise, at most {self._loudest_noise_dbfs:.0f})"
            )
        return Health(not reason, self._level_dbfs, noise, clipping, reason)

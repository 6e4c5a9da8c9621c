"""Other ways of saying a recorded word: slowly, slurred, loudly, softly. Made from what there is, no substitute for it.

Time is stretched by a phase vocoder (Flanagan & Golden 1966; Laroche & Dolson 1999). Slurring lets the spectrum change
late: its magnitude is smeared over time and its upper formants are taken away.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from chairward_voice_dtw.audio import Floats
from chairward_voice_dtw.streams import STREAM_HZ

WINDOW = 512
HOP = 128
EDGE_HZ = 500.0


@dataclass(frozen=True, slots=True, kw_only=True)
class Variant:
    """stretch: of time. smear: frames of 8 ms over which the spectrum is averaged. up_to_hz: what is over it fades.

    gain_db: of the word over its usual level, while the noise stays.
    """

    stretch: float = 1.0
    smear: int = 1
    up_to_hz: float = STREAM_HZ / 2.0
    gain_db: float = 0.0


VARIANTS = {
    "usual": Variant(),
    "slow": Variant(stretch=1.5),
    "slurred": Variant(stretch=1.25, smear=9, up_to_hz=2500.0),
    "loud": Variant(gain_db=10.0),
    "soft": Variant(gain_db=-10.0),
}


def said(samples: Floats, variant: Variant) -> Floats:
    """The recording (at STREAM_HZ) said that way; its level is another matter (`streams.embed`)."""
    if variant.stretch == 1.0 and variant.smear == 1:
        return samples
    window = np.hanning(WINDOW + 1)[:WINDOW]
    padded = np.pad(np.asarray(samples, np.float64), (WINDOW, 2 * WINDOW))
    frames = np.lib.stride_tricks.sliding_window_view(padded, WINDOW)[::HOP] * window
    spectrum = np.fft.rfft(frames, axis=1)
    size, phase = np.abs(spectrum), np.angle(spectrum)
    kernel = np.ones(variant.smear) / variant.smear
    size = np.apply_along_axis(np.convolve, 0, size, kernel, "same")
    hz = np.fft.rfftfreq(WINDOW, 1.0 / STREAM_HZ)
    size *= 1.0 / (1.0 + np.exp((hz - variant.up_to_hz) / (EDGE_HZ / 4.0)))
    expected = 2.0 * np.pi * HOP * np.arange(size.shape[1]) / WINDOW
    steps = np.arange(0.0, len(size) - 1.0, 1.0 / variant.stretch)
    out, angle = np.zeros(len(steps) * HOP + WINDOW), phase[0].copy()
    for number, at in enumerate(steps):
        here = int(at)
        share = at - here
        magnitude = (1.0 - share) * size[here] + share * size[here + 1]
        out[number * HOP : number * HOP + WINDOW] += np.fft.irfft(magnitude * np.exp(1j * angle)) * window
        turned = phase[here + 1] - phase[here] - expected
        angle += expected + turned - 2.0 * np.pi * np.round(turned / (2.0 * np.pi))
    first = int(WINDOW * variant.stretch)
    wanted = round(len(samples) * variant.stretch)
    return np.asarray(out[first : first + wanted] / 1.5, np.float32)

"""What `chairward doctor` listens for: is there a microphone, and does it give sound that words can be heard in?"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from math import log10

import numpy as np

from chairward.doctor import Check, Finding, Site
from chairward.stages import AudioBlock, Floats
from chairward_microphone.settings import MicrophoneSettings

LISTEN_S = 1.0
BLOCKS = 100
MUTED_DBFS, NOISY_DBFS = -90.0, -38.0
CLIPPED, CLIPPED_SHARE = 0.985, 0.002
OFFSET = 0.05
LOST_SHARE = 0.02


def checks() -> Sequence[Check]:
    """One check: one second of listening."""
    return [Check(name="microphone", component="microphone", look=microphone, timeout_s=6.0)]


def microphone(site: Site) -> Iterator[Finding]:
    """One second of sound. Raises DeviceLost with what is missing, which is a finding too."""
    settings = site.settings
    assert isinstance(settings, MicrophoneSettings)
    blocks = site.take(AudioBlock, BLOCKS, LISTEN_S + 2.0)
    if not blocks:
        yield _wrong("it gives no sound", "unplug it and plug it in again, or correct microphone.device")
        return
    samples = np.concatenate([block.samples for block in blocks])
    lost = sum(block.lost_samples for block in blocks)
    yield from judge(samples, blocks[0].rate_hz, lost)


def judge(samples: Floats, rate_hz: int, lost_samples: int = 0) -> Iterator[Finding]:
    """What is wrong with a second of sound while nobody speaks."""
    ticks = np.array([_dbfs(tick) for tick in np.array_split(samples, max(1, len(samples) * 100 // rate_hz))])
    quiet = float(np.percentile(ticks, 20))
    if float(np.max(np.abs(samples), initial=0.0)) == 0.0 or float(np.median(ticks)) < MUTED_DBFS:
        yield _wrong("it is muted: no sound at all, not even noise", "unmute it (alsamixer, F4, M) and turn it up")
        return
    if float(np.mean(np.abs(samples) >= CLIPPED)) > CLIPPED_SHARE:
        yield _wrong("it clips: its loudest sounds are cut off", "turn the microphone down (alsamixer, F4)")
    elif quiet > NOISY_DBFS:
        yield _wrong(
            f"it is noisy: {quiet:.0f} dBFS while nobody speaks, words need less than {NOISY_DBFS:.0f}",
            "move it nearer to the mouth and away from the fan, then turn it down",
        )
    if abs(float(np.mean(samples))) > OFFSET:
        yield _wrong(
            f"its sound is shifted by {np.mean(samples):+.2f} of full scale",
            "try another sound card: this one is faulty",
        )
    if lost_samples > LOST_SHARE * len(samples):
        yield _wrong(
            f"{100 * lost_samples / len(samples):.0f} % of the sound is lost on its way",
            "give it a USB port of its own, and close programs that keep the processor busy",
        )


def _dbfs(samples: Floats) -> float:
    """Level about its own mean, dB of full scale."""
    power = float(np.var(samples)) if len(samples) else 0.0
    return 10.0 * log10(power) if power > 0.0 else -200.0


def _wrong(what: str, fix: str) -> Finding:
    return Finding("microphone", False, what, fix)

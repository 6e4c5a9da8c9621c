"""The last seconds of sound, for a screen that records a word through the chair's microphone."""

from __future__ import annotations

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from chairward.sound_pane import SECONDS, RecentSound, unpack
from chairward.stages import AudioBlock

RATE = 8_000


def block(at: int, size: int, lost: int = 0, rate_hz: int = RATE) -> AudioBlock:
    samples = (np.arange(at, at + size) % 1000).astype(np.float32) / 1000.0
    return AudioBlock(
        samples=samples, rate_hz=rate_hz, captured_ns=at * 1_000_000_000 // rate_hz, seq=at, lost_samples=lost
    )


@given(st.lists(st.integers(min_value=1, max_value=4_000), min_size=1, max_size=40))
def test_the_newest_seconds_come_back_as_they_were_with_the_time_of_their_first_sample(sizes: list[int]) -> None:
    recent, at = RecentSound(), 0
    for size in sizes:
        recent.push(block(at, size))
        at += size
    pane = recent.pane()
    assert pane is not None
    samples, rate_hz = unpack(pane)
    assert rate_hz == RATE
    assert min(at, SECONDS * RATE) <= len(samples) <= SECONDS * RATE + 4_000
    first = at - len(samples)
    assert np.abs(samples - block(first, len(samples)).samples).max() < 1e-4
    assert pane.captured_ns == first * 1_000_000_000 // RATE


def test_sound_with_a_gap_or_another_rate_begins_anew() -> None:
    recent = RecentSound()
    assert recent.pane() is None
    recent.push(block(0, 800))
    recent.push(block(1_600, 80, lost=800))
    pane = recent.pane()
    assert pane is not None
    assert len(unpack(pane)[0]) == 80
    recent.push(block(0, 160, rate_hz=16_000))
    pane = recent.pane()
    assert pane is not None
    assert (len(unpack(pane)[0]), unpack(pane)[1]) == (160, 16_000)

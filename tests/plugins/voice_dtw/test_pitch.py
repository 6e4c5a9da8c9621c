"""How high a voice is: found on known voices, unknown in noise, and no reason to miss a stop."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from chairward_voice_dtw import calibration
from chairward_voice_dtw.audio import RATE_HZ, Floats, read_wav
from chairward_voice_dtw.matcher import Matcher, Measures
from chairward_voice_dtw.pitch import FEWEST, PitchStream, pitch_of
from chairward_voice_dtw.spotter import Spotted
from chairward_voice_dtw.streams import STREAM_HZ
from chairward_voice_dtw.templates import cut_out, files_of_folder, from_files


def voice(hz: float, seconds: float = 0.4) -> Floats:
    """Harmonics of hz that fall by 6 dB an octave."""
    t = np.arange(int(seconds * RATE_HZ)) / RATE_HZ
    return np.sum([np.sin(2 * np.pi * k * hz * t + k) / k for k in range(1, 20) if k * hz < 3900], axis=0).astype(
        np.float32
    )


@given(hz=st.floats(80.0, 380.0), gain=st.sampled_from([1e-3, 0.1, 1.0]))
@settings(max_examples=30, deadline=None)
def test_the_pitch_of_a_voice_is_found_at_any_level(hz: float, gain: float) -> None:
    found, share = pitch_of(PitchStream().push(voice(hz) * np.float32(gain))[5:])
    assert abs(found - np.log2(hz)) < 0.05
    assert share == 1.0


def test_noise_has_no_pitch() -> None:
    noise = np.random.default_rng(3).normal(0.0, 0.1, 8 * RATE_HZ).astype(np.float32)
    _, share = pitch_of(PitchStream().push(noise))
    assert share < 0.05
    found, share = pitch_of(np.zeros((FEWEST - 1, 3), np.float32))
    assert np.isnan(found)
    assert share == 0.0


@given(cuts=st.lists(st.integers(0, RATE_HZ), max_size=8))
@settings(max_examples=20, deadline=None)
def test_how_sound_is_cut_changes_no_bit(cuts: list[int]) -> None:
    sound = voice(150.0, 1.0)
    whole = PitchStream().push(sound)
    stream = PitchStream()
    parts = [stream.push(part) for part in np.split(sound, sorted(cuts))]
    np.testing.assert_array_equal(np.concatenate(parts), whole)


@pytest.fixture(scope="module")
def matcher(word_folder: Path) -> Matcher:
    """Four made words of one voice of 120 Hz."""
    return Matcher(from_files(files_of_folder(word_folder)))


def measured(matcher: Matcher, word_folder: Path, octaves_up: float) -> Measures:
    """A take of "stop", said so much higher than it was enrolled."""
    segment = cut_out(read_wav(word_folder / "stop_0.wav", STREAM_HZ)[0])
    assert segment is not None
    count = len(matcher.words)
    like = np.where(np.array(matcher.words) == "stop", 0.9, 0.1)
    spotted = Spotted(
        first=segment.first,
        last=segment.last,
        known=segment.decided,
        best=like,
        usual=like,
        phrase=1.0 - like,
        usual_phrase=1.0 - like,
        spread=np.full(count, 0.1),
    )
    return matcher.measure(replace(segment, pitch=segment.pitch + octaves_up), spotted)


def test_what_is_measured_of_the_pitch_is_how_far_it_is_off(matcher: Matcher, word_folder: Path) -> None:
    for octaves in (0.0, 0.5, -1.0, float("nan")):
        word, evidence = matcher.evidence(measured(matcher, word_folder, octaves))
        assert word == "stop"
        expected = abs(octaves) if np.isfinite(octaves) else 0.0
        np.testing.assert_allclose(evidence[list(calibration.PITCH)], expected, atol=0.06)


def test_a_stop_counts_as_much_however_high_it_is_cried(matcher: Matcher, word_folder: Path) -> None:
    stop = frozenset({"stop"})
    usual, cried = (measured(matcher, word_folder, octaves) for octaves in (0.0, 1.0))
    assert matcher.weigh(cried, stop) == matcher.weigh(usual, stop)
    assert matcher.weigh(cried).score < matcher.weigh(usual).score

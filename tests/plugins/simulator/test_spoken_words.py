"""The recordings: small, 16 kHz 16 bit mono, and what is said is never what was enrolled."""

from __future__ import annotations

import wave

import numpy as np
import pytest

from chairward_simulator import speech

ALL = sorted(speech.FOLDER.rglob("*.wav"))


def test_every_word_has_templates_and_several_utterances_in_little_space() -> None:
    assert sum(path.stat().st_size for path in ALL) < 1_500_000
    for word in speech.WORDS:
        assert len(list(speech.TEMPLATES.glob(f"{word}_*.wav"))) >= 3
        assert len(list(speech.SAY.glob(f"{word}_*.wav"))) >= 3


@pytest.mark.parametrize("path", ALL, ids=lambda path: f"{path.parent.name}/{path.name}")
def test_recording_is_16_khz_mono_unclipped_and_starts_and_ends_quietly(path) -> None:
    samples = speech.sound(path)
    assert 0.25 < len(samples) / speech.RATE_HZ < 1.2
    assert 0.1 < np.abs(samples).max() < 0.99
    for edge in (samples[:320], samples[-320:]):
        assert np.abs(edge).max() < 0.05 * np.abs(samples).max()


def test_no_two_recordings_are_the_same() -> None:
    assert len({path.read_bytes() for path in ALL}) == len(ALL)


def test_utterances_take_turns_and_an_unknown_word_is_refused() -> None:
    assert len({speech.say_file("stop", n) for n in range(8)}) >= 3
    with pytest.raises(FileNotFoundError, match="no recording of 'sideways'"):
        speech.say_file("sideways", 1)


def test_a_wav_of_another_rate_is_refused_with_its_name(tmp_path) -> None:
    path = tmp_path / "front_1.wav"
    with wave.open(str(path), "wb") as file:
        file.setnchannels(1)
        file.setsampwidth(2)
        file.setframerate(8000)
        file.writeframes(bytes(1600))
    with pytest.raises(ValueError, match=r"front_1\.wav: 8000 Hz, 1 channels, 16 bit"):
        speech.sound(path)

"""What is said about a stream depends on its past only, and not on how it is cut into blocks."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from chairward_voice_dtw.audio import RATE_HZ, Resampler, SoundError
from chairward_voice_dtw.engine import SAME_SOUND_S, Acceptance, DtwEngine, Engine, Heard, Thresholds, Voice
from chairward_voice_dtw.frontend import MelStream
from chairward_voice_dtw.segmenter import LISTENERS
from chairward_voice_dtw.stage import EngineMaker
from chairward_voice_dtw.templates import files_of_folder, from_files

WORDS = ["left", "stop", "right", "front"]


@pytest.fixture(scope="module", params=[True, False], ids=["speech_embedding", "plain"])
def maker(word_folder: Path, request: pytest.FixtureRequest) -> EngineMaker:
    thresholds = Thresholds(stop_words=frozenset({"stop"}))
    return EngineMaker(files_of_folder(word_folder), thresholds, "default", embedding=request.param)


def run(engine: Engine, samples, block: int) -> list[Heard]:  # type: ignore[no-untyped-def]
    return [h for at in range(0, len(samples), block) for h in engine.push(samples[at : at + block])]


def test_words_are_heard_in_order_soon_after_their_end(maker: EngineMaker, sentence_of) -> None:  # type: ignore[no-untyped-def]
    heard = [h for h in run(maker.make(16_000), sentence_of(WORDS), 160) if h.accepted]
    assert [h.word for h in heard] == WORDS
    assert all(0.0 < h.decided_s - h.end_s <= 0.3 for h in heard)


@pytest.mark.parametrize("block", [37, 160, 441, 16_000])
def test_block_sizes_change_nothing(maker: EngineMaker, sentence_of, block: int) -> None:  # type: ignore[no-untyped-def]
    sound = sentence_of(WORDS)
    assert run(maker.make(16_000), sound, block) == run(maker.make(16_000), sound, 1600)


@pytest.mark.parametrize("hz", [8000, 11_025, 22_050, 44_100, 48_000])
def test_any_rate_hears_the_same_words(maker: EngineMaker, sentence_of, hz: int) -> None:  # type: ignore[no-untyped-def]
    heard = [h.word for h in run(maker.make(hz), sentence_of(WORDS, hz=hz), hz // 100) if h.accepted]
    assert heard == WORDS


@pytest.mark.parametrize("cut_s", [2.3, 2.9, 4.0, 5.5])
def test_another_future_changes_nothing_in_the_past(maker: EngineMaker, sentence_of, cut_s: float) -> None:  # type: ignore[no-untyped-def]
    sound = sentence_of(WORDS)
    other = sound.copy()
    cut = int(cut_s * 16_000)
    other[cut:] = np.random.default_rng(1).normal(0.0, 0.2, len(other) - cut)
    one = [h for h in run(maker.make(16_000), sound, 160) if h.decided_s <= cut_s]
    two = [h for h in run(maker.make(16_000), other, 160) if h.decided_s <= cut_s]
    assert one == two


def test_what_other_thresholds_accept_can_be_told_from_what_was_heard(word_folder: Path, sentence_of) -> None:  # type: ignore[no-untyped-def]
    voice, sound = Voice(from_files(files_of_folder(word_folder))), sentence_of([*WORDS, "left", "right"])
    heard = run(DtwEngine(voice, Thresholds(word=-5.0, stop_words=frozenset({"stop"})), 16_000), sound, 1600)
    tight = Thresholds(word=float(np.median([h.score for h in heard if h.accepted])), stop_words=frozenset({"stop"}))
    acceptance = Acceptance(tight)
    again = [acceptance.of(h) for h in heard]
    assert again == run(DtwEngine(voice, tight, 16_000), sound, 1600)
    assert 0 < sum(h.accepted for h in again) < sum(h.accepted for h in heard)


def test_one_sound_gives_one_word_and_at_most_a_stop_after_it() -> None:
    def heard(word: str, onset_s: float, end_s: float) -> Heard:
        return Heard(word=word, score=5.0, accepted=False, onset_s=onset_s, end_s=end_s, decided_s=end_s + 0.2)

    acceptance = Acceptance(Thresholds(stop_words=frozenset({"stop"})))
    words = (("left", 1.0, 1.5), ("right", 1.1, 1.6), ("stop", 1.2, 1.7), ("stop", 1.3, 1.8))
    assert [acceptance.of(heard(*word)).accepted for word in words] == [True, False, True, False]
    assert acceptance.of(heard("right", 1.71 - SAME_SOUND_S, 2.0)).accepted
    assert not acceptance.of(replace(heard("left", 3.0, 3.5), voiced=0.0)).accepted
    assert acceptance.of(replace(heard("stop", 4.0, 4.5), voiced=0.0)).accepted


@pytest.mark.parametrize("mode", ["thesis_text", "thesis_code"])
def test_thesis_engines_give_a_word_for_every_sound(word_folder: Path, sentence_of, mode: str) -> None:  # type: ignore[no-untyped-def]
    maker = EngineMaker(files_of_folder(word_folder), Thresholds(stop_words=frozenset({"stop"})), mode)  # type: ignore[arg-type]
    sound = sentence_of(WORDS, gap_s=1.6)
    heard = run(maker.make(16_000), sound, 160)
    assert [h.word for h in heard] == WORDS
    assert heard == run(maker.make(16_000), sound, 1111)


@settings(deadline=None, max_examples=25)
@given(st.sampled_from([8000, 11_025, 16_000, 44_100, 48_000]), st.lists(st.integers(1, 900), min_size=2, max_size=12))
def test_resampling_does_not_depend_on_blocks(hz: int, cuts: list[int]) -> None:
    x = np.random.default_rng(3).normal(0.0, 0.1, sum(cuts)).astype(np.float32)
    whole = Resampler(hz).push(x)
    parts, at, stream = [], 0, Resampler(hz)
    for cut in cuts:
        parts.append(stream.push(x[at : at + cut]))
        at += cut
    np.testing.assert_array_equal(np.concatenate(parts), whole)
    assert abs(len(whole) - len(x) * RATE_HZ / hz) <= 1


def test_resampling_keeps_a_tone_and_removes_what_would_fold() -> None:
    t = np.arange(48_000) / 48_000
    kept = Resampler(48_000).push(np.sin(2 * np.pi * 1000 * t).astype(np.float32))[400:]
    folded = Resampler(48_000).push(np.sin(2 * np.pi * 7000 * t).astype(np.float32))[400:]
    assert np.sqrt(np.mean(kept**2)) == pytest.approx(np.sqrt(0.5), rel=0.02)
    assert np.sqrt(np.mean(folded**2)) < 0.01


@pytest.mark.parametrize("hz", [4000, 96_000])
def test_a_rate_that_cannot_be_used_is_one_sentence(hz: int) -> None:
    with pytest.raises(SoundError, match="8000 to 48000 Hz"):
        Resampler(hz)


def test_mel_frames_do_not_depend_on_blocks() -> None:
    x = np.random.default_rng(3).normal(0.0, 0.1, 4000).astype(np.float32)
    whole, stream = MelStream().push(x), MelStream()
    np.testing.assert_array_equal(np.concatenate([stream.push(part) for part in np.split(x, 50)]), whole)


@pytest.mark.parametrize("level", [0.003, 0.02, 0.2])
def test_what_has_begun_ends_within_a_bound(word_folder: Path, level: float) -> None:
    """Talk or a machine that goes on for ever is given up as no word."""
    engine = DtwEngine(Voice(from_files(files_of_folder(word_folder)), embedding=False), Thresholds(), 16_000)
    rng = np.random.default_rng(2)
    quiet = rng.normal(0.0, 3e-4, 32_000)
    loud = rng.normal(0.0, level, 6 * 16_000) * (1.2 + np.sin(np.arange(6 * 16_000) / 1500.0))
    heard = run(engine, np.concatenate([quiet, loud]).astype(np.float32), 160)
    assert all(h.decided_s - h.onset_s <= 2.2 + max(p.hang for p in LISTENERS) / 100 for h in heard)
    assert any(not h.word for h in heard)
    assert not any(h.accepted for h in heard)

"""The stage on a lane's bench: intents, heartbeats, and what makes it say that it is not well."""

from __future__ import annotations

import subprocess
import sys
from collections.abc import Sequence
from pathlib import Path

import numpy as np
import pytest

from chairward.components import Bench, Context
from chairward.messages import Alive, Command, Intent, Message
from chairward.stages import AudioBlock
from chairward_voice_dtw.settings import VoiceSettings
from chairward_voice_dtw.stage import VoiceStage
from chairward_voice_dtw.store import enrol

WORDS = {"front": "front", "left": "left", "right": "right", "stop": "stop"}
START_NS = 5_000_000_000


def context(tmp_path: Path, words: dict[str, str] | None = None) -> Context:
    return Context(
        lane="voice", run_dir=tmp_path, chair_dir=tmp_path, person="asha", person_dir=tmp_path, words=words or WORDS
    )


def stage_with(tmp_path: Path, folder: Path, words: dict[str, str] | None = None, **settings: object) -> VoiceStage:
    return VoiceStage(VoiceSettings.model_validate({"templates_dir": folder, **settings}), context(tmp_path, words))


def play(stage: VoiceStage, samples, hz: int = 16_000, **block: object) -> list[Message]:  # type: ignore[no-untyped-def]
    """10 ms blocks at their true times."""
    out: list[Message] = []
    bench = Bench()
    size = hz // 100
    for seq, at in enumerate(range(0, len(samples) - size + 1, size)):
        bench.clear()
        captured = START_NS + at * 1_000_000_000 // hz
        bench.put(AudioBlock(samples=samples[at : at + size], rate_hz=hz, captured_ns=captured, seq=seq, **block))  # type: ignore[arg-type]
        out += stage.process(bench)
    return out


def intents(messages: Sequence[Message]) -> list[Intent]:
    return [m for m in messages if isinstance(m, Intent)]


def alive(messages: Sequence[Message]) -> list[Alive]:
    return [m for m in messages if isinstance(m, Alive)]


def test_words_become_intents_at_the_time_of_their_end(tmp_path: Path, word_folder: Path, sentence_of) -> None:  # type: ignore[no-untyped-def]
    messages = play(stage_with(tmp_path, word_folder), sentence_of(["left", "stop"]))
    heard = intents(messages)
    assert [(i.command, i.word) for i in heard] == [(Command.LEFT, "left"), (Command.STOP, "stop")]
    assert START_NS + 2.4e9 < heard[0].captured_ns < START_NS + 2.9e9
    numbers = [m.seq for m in messages]
    assert numbers == sorted(set(numbers))


def test_a_heartbeat_every_tenth_of_a_second(tmp_path: Path, word_folder: Path, sentence_of) -> None:  # type: ignore[no-untyped-def]
    sound = sentence_of(["left"])
    beats = alive(play(stage_with(tmp_path, word_folder), sound))
    assert len(beats) == pytest.approx(len(sound) / 1600, abs=2)
    assert all(b.well for b in beats)
    assert beats[5].noise_dbfs == pytest.approx(-70.0, abs=3.0)


def test_without_a_stop_word_nothing_moves_and_it_says_so(tmp_path: Path, sentence_of) -> None:  # type: ignore[no-untyped-def]
    messages = play(VoiceStage(VoiceSettings(), context(tmp_path)), sentence_of(["left"]))
    assert not intents(messages)
    assert {b.reason for b in alive(messages)} == {
        "asha has no enrolled stop word: record one with 'chairward words record'"
    }
    assert not any(b.well for b in alive(messages))


def test_words_from_the_persons_own_store(tmp_path: Path, word_folder: Path, sentence_of) -> None:  # type: ignore[no-untyped-def]
    for word in WORDS:
        enrol(tmp_path, word, sorted(word_folder.glob(f"{word}_*.wav")))
    assert [i.word for i in intents(play(VoiceStage(VoiceSettings(), context(tmp_path)), sentence_of(["right"])))] == [
        "right"
    ]


def test_a_broken_recording_is_one_sentence_not_a_crash(tmp_path: Path) -> None:
    (tmp_path / "stop_1.wav").write_bytes(b"RIFF not a wav")
    stage = stage_with(tmp_path, tmp_path)
    (beat,) = alive(stage.process(Bench()))
    assert not beat.well
    assert "stop_1.wav: cannot be read as sound" in beat.reason


def test_a_dead_microphone_is_not_well(tmp_path: Path, word_folder: Path) -> None:
    messages = play(stage_with(tmp_path, word_folder), np.zeros(3 * 16_000, np.float32))
    assert not alive(messages)[-1].well
    assert "muted, unplugged or dead" in alive(messages)[-1].reason


def test_a_source_that_gives_nothing_is_not_well(tmp_path: Path, word_folder: Path) -> None:
    (beat,) = alive(stage_with(tmp_path, word_folder).process(Bench()))
    assert not beat.well
    assert beat.reason == "no sound arrives from the microphone"


def test_clipping_is_told(tmp_path: Path, word_folder: Path) -> None:
    loud = np.clip(3.0 * np.sin(np.arange(32_000) / 10.0), -1.0, 1.0).astype(np.float32)
    assert alive(play(stage_with(tmp_path, word_folder), loud))[-1].clipping


@pytest.mark.parametrize("kind", ["silence", "tone", "noise", "clicks"])
def test_what_is_no_word_moves_nothing(tmp_path: Path, word_folder: Path, kind: str) -> None:
    rng = np.random.default_rng(8)
    n = 12 * 16_000
    floor = rng.normal(0.0, 1e-3, n)
    t = np.arange(n) / 16_000
    bursts = (t % 2.0 < 0.5) & (t > 2.0)
    sound = {
        "silence": floor,
        "tone": floor + 0.1 * np.sin(2 * np.pi * 440 * t) * bursts,
        "noise": floor + rng.normal(0.0, 0.05, n) * bursts,
        "clicks": floor + 0.5 * (rng.random(n) < 1e-4),
    }[kind]
    assert not intents(play(stage_with(tmp_path, word_folder), sound.astype(np.float32)))


def test_the_chairs_own_voice_moves_nothing_but_stop_is_heard(tmp_path: Path, word_folder: Path, sentence_of) -> None:  # type: ignore[no-untyped-def]
    messages = play(stage_with(tmp_path, word_folder), sentence_of(["left", "stop"]), chair_speaks=True)
    assert [i.word for i in intents(messages)] == ["stop"]


def test_a_word_with_a_hole_moves_nothing(tmp_path: Path, word_folder: Path, sentence_of) -> None:  # type: ignore[no-untyped-def]
    assert not intents(play(stage_with(tmp_path, word_folder), sentence_of(["left"]), lost_samples=160))


def test_armed_listening_waits_for_the_wake_word(tmp_path: Path, word_folder: Path, sentence_of) -> None:  # type: ignore[no-untyped-def]
    words = {"left": "left", "front": "front", "stop": "stop"}
    stage = stage_with(tmp_path, word_folder, words, listening="armed", wake_word="right", armed_s=3.0)
    heard = intents(play(stage, sentence_of(["left", "stop", "right", "left"])))
    assert [i.word for i in heard] == ["stop", "left"]


def test_a_shout_stops_once_where_the_profile_says_so(tmp_path: Path, word_folder: Path) -> None:
    rng = np.random.default_rng(3)
    shout = np.concatenate([rng.normal(0.0, 1e-3, 16_000), rng.normal(0.0, 0.4, 8_000), rng.normal(0.0, 1e-3, 16_000)])
    for shout_dbfs, expected in ((0.0, []), (-15.0, [Command.STOP])):
        stage = stage_with(tmp_path, word_folder, shout_dbfs=shout_dbfs)
        assert [i.command for i in intents(play(stage, shout.astype(np.float32)))] == expected


def test_noise_as_loud_as_the_recorded_stop_word_is_too_much(tmp_path: Path, word_folder: Path, sentence_of) -> None:  # type: ignore[no-untyped-def]
    stage = stage_with(tmp_path, word_folder, voice_over_noise_db=25.0)
    sound = sentence_of(["left"])
    noise = np.random.default_rng(6).normal(0.0, 0.01, 6 * 16_000)
    messages = play(stage, np.concatenate([noise, sound + noise[: len(sound)]]).astype(np.float32))
    assert "too noisy to hear 'stop' reliably" in alive(messages)[-1].reason
    assert not intents(messages)


def test_nothing_is_left_to_compile_when_the_first_sound_comes(tmp_path: Path, word_folder: Path) -> None:
    """A compiler at work in the middle of a word would hold the heartbeats up for seconds."""
    code = f"""
import sys
sys.path.insert(0, {str(Path(__file__).parent)!r})
from pathlib import Path
import conftest, test_voice_stage as t
from chairward_voice_dtw import audio, dtw, embedding, endpoint, frontend, pitch

modules = (audio, dtw, embedding, endpoint, frontend, pitch)
compiled = [f for module in modules for f in vars(module).values() if hasattr(f, "signatures")]
stage = t.stage_with(Path({str(tmp_path)!r}), Path({str(word_folder)!r}))
before = [len(f.signatures) for f in compiled]
heard = t.intents(t.play(stage, conftest.sentence(["left", "stop"])))
after = [len(f.signatures) for f in compiled]
assert sum(before) >= 6, before  # inner functions come along with those that call them
assert before == after, (before, after)
assert [i.word for i in heard] == ["left", "stop"]
"""
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr

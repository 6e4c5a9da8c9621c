"""What a screen's words page asks is answered, whatever it asks; and the stage tells it what the microphone heard."""

from __future__ import annotations

import json
import subprocess
import sys
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import soundfile

from chairward.components import Bench, Context
from chairward.messages import Intent
from chairward.sound_pane import NAME, unpack
from chairward.speaking import Speaker
from chairward.stages import AudioBlock
from chairward_voice_dtw.settings import ARMED_THRESHOLD, VoiceSettings
from chairward_voice_dtw.stage import VoiceStage
from chairward_voice_dtw.words_desk import WordsDesk

Ask = Callable[..., dict[str, Any]]


@pytest.fixture
def ask(tmp_path: Path) -> Ask:
    desk = WordsDesk(tmp_path / "people")

    def one(do: str, **more: Any) -> dict[str, Any]:
        answer = json.loads(desk.answer(json.dumps({"do": do, "person": "kim", **more})))
        assert isinstance(answer, dict)
        return answer

    return one


def takes(folder: Path, word: str) -> list[str]:
    return [str(path) for path in sorted(folder.glob(f"{word}_*.wav"))]


def test_a_word_is_kept_listed_recognised_and_forgotten(ask: Ask, word_folder: Path) -> None:
    assert ask("list") == {"words": [], "warnings": [], "fewest": 3, "most": 5}
    for word in ("left", "stop"):
        assert ask("save", word=word, paths=takes(word_folder, word), force=True)["stored"] == 3
    rows = {row["word"]: row for row in ask("list")["words"]}
    assert rows.keys() == {"left", "stop"}
    assert rows["left"]["nearest"] == "stop"
    assert all(Path(path).is_file() for path in rows["left"]["files"])
    tried = ask("try", path=takes(word_folder, "left")[0], stop_words=["stop"])
    assert (tried["heard"], tried["needed"]) == ("left", ARMED_THRESHOLD)
    assert [row["word"] for row in tried["scores"]] == ["left", "stop"]
    assert ask("try", path=takes(word_folder, "stop")[0], stop_words=["stop"])["needed"] == -2.0
    ask("remove", word="left")
    assert [row["word"] for row in ask("list")["words"]] == ["stop"]
    assert ask("try", path=takes(word_folder, "left")[0])["word"] == "stop", "what was forgotten is not heard"


def test_words_that_sound_alike_are_warned_of(ask: Ask, word_folder: Path) -> None:
    ask("save", word="left", paths=takes(word_folder, "left"), force=True)
    warnings = ask("save", word="links", paths=takes(word_folder, "left"), force=True)["warnings"]
    assert any("sound alike" in sentence for sentence in warnings)


def test_a_recording_that_is_not_good_enough_leaves_the_old_ones_alone(ask: Ask, word_folder: Path) -> None:
    ask("save", word="left", paths=takes(word_folder, "left"), force=True)
    before = ask("list")
    told = ask("save", word="left", paths=takes(word_folder, "left")[:1])
    assert told["stored"] == 0
    assert "at least 3" in told["problems"][0]
    assert ask("list") == before


def test_a_recording_is_shown_as_waveform_and_mel_bands(ask: Ask, word_folder: Path, tmp_path: Path) -> None:
    look = ask("look", path=takes(word_folder, "front")[0])
    assert look["problem"] == ""
    assert 0.5 < look["seconds"] < 1.5
    assert len(look["wave"]) == 240
    assert all(low <= high for low, high in look["wave"])
    assert {len(frame) for frame in look["mel"]} == {24}
    assert max(max(frame) for frame in look["mel"]) == 255
    soundfile.write(str(tmp_path / "still.wav"), np.zeros(16_000), 16_000)
    assert "too quiet" in ask("look", path=str(tmp_path / "still.wav"))["problem"]


def test_whatever_is_asked_is_answered_with_a_sentence(tmp_path: Path) -> None:
    desk = WordsDesk(tmp_path / "people")
    still = tmp_path / "still.wav"
    soundfile.write(str(still), np.zeros(16_000 * 11), 16_000)
    for request in (
        "",
        "[]",
        "nonsense",
        "{}",
        '{"do": "fly"}',
        "[" * 100_000,
        '{"do": "list"}',
        '{"do": "list", "person": "../kim"}',
        '{"do": "list", "person": ""}',
        '{"do": "try", "person": "kim", "path": "x.wav"}',
        '{"do": "look", "path": "nowhere.wav"}',
        json.dumps({"do": "look", "path": str(still)}),
        '{"do": "save", "person": "kim", "word": " ", "paths": []}',
        '{"do": "save", "person": "kim", "word": "go", "paths": 3}',
        '{"do": "remove", "person": "kim", "word": "go"}',
    ):
        assert json.loads(desk.answer(request))["error"], request
    assert not (tmp_path / "people").exists(), "nothing is written for a request that is refused"


def test_the_command_answers_line_by_line(tmp_path: Path) -> None:
    asked = '{"do": "list", "person": "kim"}\nnonsense\n'
    command = [sys.executable, "-m", "chairward", "words", "serve", "--people", str(tmp_path)]
    done = subprocess.run(command, input=asked, capture_output=True, text=True, timeout=100, check=True)
    first, second = (json.loads(line) for line in done.stdout.splitlines())
    assert first["words"] == []
    assert second["error"]


def blocks(sound: Any) -> Iterator[AudioBlock]:
    for seq, at in enumerate(range(0, len(sound) - 159, 160)):
        captured_ns = 5_000_000_000 + at * 1_000_000_000 // 16_000
        yield AudioBlock(samples=sound[at : at + 160], rate_hz=16_000, captured_ns=captured_ns, seq=seq)


def test_what_was_heard_last_is_there_for_a_screen(tmp_path: Path, word_folder: Path, sentence_of: Any) -> None:
    context = Context(lane="voice", run_dir=tmp_path, chair_dir=tmp_path, words={"stop": "stop"})
    stage = VoiceStage(VoiceSettings(templates_dir=word_folder), context)
    sound, pane = sentence_of(["left"]), None
    for block in blocks(sound):
        bench = Bench()
        bench.put(block)
        stage.process(bench)
        pane = bench.panes.get(NAME, pane)
    stage.close()
    assert pane is not None
    samples, rate_hz = unpack(pane)
    first = (pane.captured_ns - 5_000_000_000) * rate_hz // 1_000_000_000
    assert rate_hz == 16_000
    assert np.abs(samples - sound[first : first + len(samples)]).max() < 1e-4


def test_while_the_chair_speaks_only_stop_is_heard(tmp_path: Path, word_folder: Path, sentence_of: Any) -> None:
    words = {"left": "left", "stop": "stop"}
    context = Context(lane="voice", run_dir=tmp_path, chair_dir=tmp_path, words=words)
    stage = VoiceStage(VoiceSettings(templates_dir=word_folder), context)
    speaker = Speaker(tmp_path)
    speaker.say(5_000_000_000, 60_000_000_000)
    heard = []
    for block in blocks(sentence_of(["left", "stop"])):
        bench = Bench()
        bench.put(block)
        heard += [message.word for message in stage.process(bench) if isinstance(message, Intent)]
    stage.close()
    speaker.close()
    assert heard == ["stop"]

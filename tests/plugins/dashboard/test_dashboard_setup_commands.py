"""What set-up pages do through the command line: words kept and recognised, limits proved, people chosen, plugins told.

Each command is a process of its own, so these tests run alone.
"""

from __future__ import annotations

import io
import threading
import time
import tomllib
import wave
from collections.abc import Callable
from pathlib import Path
from typing import Any

import httpx
import numpy as np
import pytest

from chairward import next_run
from chairward.next_run import NextRun
from chairward.sound_pane import RecentSound
from chairward.stages import AudioBlock

pytestmark = [pytest.mark.processes, pytest.mark.timeout(600)]
SAID = Path(__file__).resolve().parents[3] / "plugins/simulator/src/chairward_simulator/words/templates"
Chair = Any
Call = Callable[..., httpx.Response]


def test_a_word_is_recorded_saved_recognised_and_forgotten(call: Call, home: Path) -> None:
    listed = call("words").json()
    assert listed["person"] == "demo"
    assert {row["name"] for row in listed["people"]} == {"demo", "careful"}
    assert {row["word"]: row["command"] for row in listed["words"]}["backward"] == "back"
    for word in ("left", "stop"):
        takes = []
        for nth in (1, 2, 3):
            look = call("words/take", (SAID / f"{word}_{nth}.wav").read_bytes()).json()
            assert look["problem"] == ""
            assert look["wave"]
            assert look["mel"]
            takes.append(look["take"])
        saved = call("words/save", {"person": "demo", "word": word, "takes": takes, "force": True}).json()
        assert saved["stored"] == 3
    assert len(list((home / "data/chairward/people/demo/words").glob("*.wav"))) == 6
    row = next(row for row in call("words").json()["words"] if row["word"] == "left")
    assert row["nearest"] == "stop"
    assert call(f"words/sound/{row['sounds'][0]}").content[:4] == b"RIFF"
    assert call(f"words/look/{row['sounds'][0]}").json()["wave"]
    take = call("words/take", (SAID / "left_4.wav").read_bytes()).json()["take"]
    tried = call("words/try", {"person": "demo", "take": take}).json()
    assert tried["heard"] == "left"
    assert call("words/remove", {"person": "demo", "word": "left"}).status_code == 200
    assert not next(row for row in call("words").json()["words"] if row["word"] == "left")["sounds"]


def test_what_a_word_means_is_written_only_if_the_loader_allows_it(call: Call, profiles: Path) -> None:
    file = profiles / "people" / "demo.toml"
    assert call("words/means", {"person": "demo", "word": "आगे", "command": "front"}).json()["ok"] is True
    assert tomllib.loads(file.read_text(encoding="utf-8"))["words"]["आगे"] == "front"
    before = file.read_bytes()
    refused = call("words/means", {"person": "demo", "word": "stop", "command": "front"})
    assert refused.status_code == 422
    assert "stop" in refused.json()["why"]
    assert file.read_bytes() == before


def test_a_word_is_recorded_through_the_chairs_own_microphone(planned_chair: Chair, call: Call) -> None:
    over = threading.Event()
    speech = np.sin(np.arange(160) / 3.0).astype(np.float32) * 0.2

    def hear() -> None:
        recent, seq = RecentSound(), 0
        while not over.wait(0.01):
            now_ns = time.monotonic_ns() - 10_000_000
            recent.push(AudioBlock(samples=speech, rate_hz=16_000, captured_ns=now_ns, seq=seq))
            seq += 1
            if seq % 10 == 0 and (pane := recent.pane()) is not None:
                planned_chair.pictures.write({"sound": pane})

    thread = threading.Thread(target=hear)
    thread.start()
    try:
        look = call("words/listen", {"seconds": 0.5}).json()
    finally:
        over.set()
        thread.join()
    with wave.open(io.BytesIO(call(f"words/sound/{look['take']}").content)) as wav:
        assert wav.getframerate() == 16_000
        samples = np.frombuffer(wav.readframes(wav.getnframes()), "<i2")
    assert len(samples) > 1_600
    assert np.abs(samples).max() > 0.15 * 32767


def test_a_limit_is_checked_by_the_loader_before_it_is_kept(call: Call, profiles: Path) -> None:
    file = profiles / "people" / "demo.toml"
    before = file.read_bytes()
    told = call("limits").json()
    assert {row["key"] for row in told["limits"]} >= {"stop_mm", "forward_mm_s"}
    refused = call("set", {"person": "demo", "changes": ["limits.stop_mm=500"], "keep": True})
    assert refused.status_code == 422
    assert "limits.stop_mm = 500" in refused.json()["why"]
    assert call("set", {"person": "demo", "changes": ["limits.stop_mm=700"]}).json()["ok"] is True
    option = call("set", {"person": "demo", "changes": ["--profiles", "/tmp"], "keep": True})
    assert option.status_code == 422, "a change is never taken for an option of the command"
    assert file.read_bytes() == before, "only asked whether it would be allowed"
    assert call("set", {"person": "demo", "changes": ["limits.stop_mm=700"], "keep": True}).status_code == 200
    assert tomllib.loads(file.read_text(encoding="utf-8"))["limits"]["stop_mm"] == 700


def test_another_persons_run_is_asked_for_only_when_the_chair_allows_that_person(
    planned_chair: Chair, call: Call, profiles: Path
) -> None:
    run_dir = planned_chair.context.run_dir
    assert call("choose", {"person": "nobody"}).status_code == 404
    careful = profiles / "people" / "careful.toml"
    right = careful.read_text(encoding="utf-8")
    careful.write_text(right.replace("stop_mm = 800", "stop_mm = 300"), encoding="utf-8")
    refused = call("choose", {"person": "careful"})
    assert refused.status_code == 422
    assert "stop_mm = 300" in refused.json()["why"]
    assert next_run.asked(run_dir) is None
    careful.write_text(right, encoding="utf-8")
    assert call("choose", {"person": "careful"}).status_code == 202
    end = time.monotonic() + 30.0
    while next_run.asked(run_dir) is None:
        assert time.monotonic() < end, "nothing was asked for within 30 s"
        time.sleep(0.02)
    assert next_run.asked(run_dir) == NextRun(person="careful")


def test_plugins_are_listed_with_their_settings_and_where_they_work(call: Call) -> None:
    told = call("plugins").json()
    rows = {(row["kind"], row["name"]): row for row in told["components"]}
    voice = rows["recognizer", "voice_dtw"]
    assert [place["where"] for place in voice["used"]] == ["voice/voice_dtw"]
    assert voice["settings"]["properties"]["threshold"]["description"]
    assert rows["source", "cameras"]["used"] == []
    assert ("voice_dtw", "threshold") in {(row["component"], row["key"]) for row in told["choices"]}

"""Recordings of a person: whole or not at all, and only good ones."""

from __future__ import annotations

import json
import sys
from pathlib import Path

import numpy as np
import pytest
from typer.testing import CliRunner

from chairward_voice_dtw.audio import SoundError, read_wav
from chairward_voice_dtw.cli import words as app
from chairward_voice_dtw.enrolment import check, separability
from chairward_voice_dtw.store import StoreError, WordStore, enrol, folder_of
from chairward_voice_dtw.templates import files_of_folder, files_of_manifest, from_files


def test_words_come_back_as_they_were_stored(tmp_path: Path, speak) -> None:  # type: ignore[no-untyped-def]
    takes = [speak("left", n) for n in range(3)]
    WordStore(tmp_path).replace("izquierda / links", takes)
    (paths,) = WordStore(tmp_path).files().values()
    for path, take in zip(paths, takes, strict=True):
        np.testing.assert_allclose(read_wav(path)[0], take, atol=1e-4)


def test_old_recordings_stay_until_new_ones_are_complete(tmp_path: Path, speak, monkeypatch) -> None:  # type: ignore[no-untyped-def]
    store = WordStore(tmp_path)
    before = store.replace("left", [speak("left", 0)])
    monkeypatch.setattr(Path, "replace", lambda *_: (_ for _ in ()).throw(OSError("the disk is full")))
    with pytest.raises(OSError, match="disk is full"):
        store.replace("left", [speak("left", 1)])
    monkeypatch.undo()
    assert WordStore(tmp_path).files() == {"left": before}
    assert all(path.is_file() for path in before)


def test_replaced_recordings_do_not_pile_up(tmp_path: Path, speak) -> None:  # type: ignore[no-untyped-def]
    store = WordStore(tmp_path)
    store.replace("left", [speak("left", 0)])
    store.replace("left", [speak("left", 1)])
    store.add("left", speak("left", 2))
    assert len(list(store.folder.glob("*.wav"))) == len(store.files()["left"]) == 2
    store.remove("left")
    assert store.files() == {}
    with pytest.raises(StoreError, match="there is no word 'left'"):
        store.remove("left")


@pytest.mark.parametrize("text", ["{", "[]", '{"version": 1}', '{"version": 1, "words": {"a": [{}]}}'])
def test_a_broken_index_is_one_sentence(tmp_path: Path, text: str) -> None:
    (tmp_path / "words").mkdir()
    (tmp_path / "words" / "words.json").write_text(text)
    with pytest.raises(StoreError, match=r"words\.json: cannot be read"):
        WordStore(tmp_path).files()


def test_another_version_is_refused(tmp_path: Path) -> None:
    (tmp_path / "words").mkdir()
    (tmp_path / "words" / "words.json").write_text(json.dumps({"version": 9, "words": {}}))
    with pytest.raises(StoreError, match="written by another version"):
        WordStore(tmp_path).files()


@pytest.mark.parametrize(
    ("width", "channels", "hz"), [("PCM_U8", 1, 8000), ("PCM_24", 2, 44_100), ("FLOAT", 1, 22_050)]
)
def test_wav_files_of_any_rate_and_width_are_taken(tmp_path: Path, speak, width: str, channels: int, hz: int) -> None:  # type: ignore[no-untyped-def]
    import soundfile

    path = tmp_path / "word.wav"
    soundfile.write(str(path), np.repeat(speak("left", 0, hz)[:, None], channels, axis=1), hz, subtype=width)
    samples, rate = read_wav(enrol(tmp_path, "left", [path])[0])
    assert rate == 16_000
    assert np.sqrt(np.mean(samples**2)) == pytest.approx(np.sqrt(np.mean(speak("left", 0, hz) ** 2)), rel=0.1)


@pytest.mark.parametrize("content", [b"", b"RIFF", b"\0" * 5000])
def test_a_corrupt_wav_is_one_sentence(tmp_path: Path, content: bytes) -> None:
    path = tmp_path / "left_1.wav"
    path.write_bytes(content)
    with pytest.raises(SoundError, match=r"left_1\.wav: cannot be read as sound"):
        read_wav(path)


def test_bad_repetitions_are_named_with_the_reason(speak) -> None:  # type: ignore[no-untyped-def]
    good = [(f"take {n}", speak("left", n)) for n in range(3)]
    assert check("left", good) == []
    (few,) = check("left", good[:2])
    assert "at least 3 are needed" in few
    (quiet,) = check("left", [*good, ("take 4", 0.01 * speak("left", 4))])
    assert quiet.startswith("take 4: too quiet")
    (clipped,) = check("left", [*good, ("take 4", np.clip(20.0 * speak("left", 4), -1.0, 1.0))])
    assert clipped.startswith("take 4: clipped")
    (odd,) = check("left", [*good, ("take 4", speak("right", 4))])
    assert odd.startswith("take 4: sounds unlike the other repetitions of 'left'")


def test_words_that_sound_alike_are_named(tmp_path: Path, speak) -> None:  # type: ignore[no-untyped-def]
    import soundfile

    for word, voice, first in (("left", "left", 0), ("lift", "left", 5), ("stop", "stop", 0)):
        for take in range(3):
            soundfile.write(str(tmp_path / f"{word}_{take}.wav"), speak(voice, first + take), 16_000)
    (warning,) = separability(from_files(files_of_folder(tmp_path))).warnings
    assert "'left' and 'lift' sound alike" in warning


def test_a_manifest_without_that_speaker_is_one_sentence(tmp_path: Path) -> None:
    path = tmp_path / "words.csv"
    path.write_text("path,word,speaker,role,source\na.wav,left,anna,template,x\n")
    with pytest.raises(SoundError, match=r"no template rows of speaker 'bo' \(there are: anna\)"):
        files_of_manifest(path, "bo")
    path.write_text("path,word\na.wav,left\n")
    with pytest.raises(SoundError, match=r"lacks the column\(s\) speaker, role, source"):
        files_of_manifest(path, "")


@pytest.mark.parametrize("person", ["..", ".", "", "../ev", "/etc", "a/b", "a\0b"])
def test_no_name_of_a_person_leads_out_of_the_people_s_folder(person: str, tmp_path: Path) -> None:
    with pytest.raises(StoreError, match="is not a person's name"):
        folder_of(tmp_path, person)
    assert folder_of(tmp_path, "Zoë K.") == tmp_path / "Zoë K."
    for command in (["list"], ["import", "left", "x.wav"], ["record", "left"], ["test", "x.wav"]):
        ended = CliRunner().invoke(app, [*command, "--person", person], env={"XDG_DATA_HOME": str(tmp_path)})
        assert ended.exit_code == 1
        assert "is not a person's name" in ended.output
    assert list(tmp_path.iterdir()) == []


def test_no_name_of_a_set_leads_out_of_the_person_s_folder(tmp_path: Path) -> None:
    ended = CliRunner().invoke(app, ["list", "--person", "kim", "--dir", str(tmp_path), "--set", "x/../../y"])
    assert ended.exit_code == 1
    assert "cannot be a set's name" in ended.output


def test_a_folder_that_cannot_be_written_is_one_sentence(tmp_path: Path, word_folder: Path) -> None:
    (tmp_path / "file").touch()
    takes = [str(path) for path in sorted(word_folder.glob("left_*.wav"))]
    for command in (["import", "left", *takes, "--force"], ["record", "left"]):
        ended = CliRunner().invoke(app, [*command, "--person", "kim", "--dir", str(tmp_path / "file")])
        assert ended.exit_code == 1
        assert "file/words cannot be written (Not a directory): choose another folder by --dir" in ended.output


def test_a_folder_is_no_sound_file(tmp_path: Path) -> None:
    with pytest.raises(SoundError, match="is a folder: name the sound files in it"):
        read_wav(tmp_path)


def test_without_a_microphone_nobody_is_asked_to_speak(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    class NoInputs:
        """A machine with a loudspeaker alone, as PortAudio tells it."""

        PortAudioError = RuntimeError

        @staticmethod
        def query_devices() -> list[dict[str, object]]:
            return [{"name": "HDMI", "max_input_channels": 0}]

    monkeypatch.setitem(sys.modules, "sounddevice", NoInputs)
    ended = CliRunner().invoke(app, ["record", "left", "--person", "kim", "--dir", str(tmp_path)], input="\n" * 9)
    assert ended.exit_code == 1
    assert "Enter" not in ended.output
    assert "this machine has no sound input at all: plug a microphone in" in ended.output


def test_import_list_and_test_at_the_command_line(tmp_path: Path, word_folder: Path) -> None:
    cli = CliRunner()
    person = ["--person", "asha", "--dir", str(tmp_path)]
    for word in ("left", "stop"):
        takes = [str(p) for p in sorted(word_folder.glob(f"{word}_*.wav"))]
        result = cli.invoke(app, ["import", word, *takes, *person])
        assert result.exit_code == 0, result.output
    assert "left: 3 recording(s), nearest word 'stop'" in cli.invoke(app, ["list", *person]).output
    tried = cli.invoke(app, ["test", str(word_folder / "left_0.wav"), *person])
    assert "heard 'left'" in tried.output
    refused = cli.invoke(app, ["import", "right", str(word_folder / "right_0.wav"), *person])
    assert refused.exit_code == 1
    assert "'right' was not stored" in refused.output
    assert set(WordStore(tmp_path).files()) == {"left", "stop"}

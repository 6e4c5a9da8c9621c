"""Recorded sound as a source: in order, on time, with the truth written down; a bad file is one sentence."""

from __future__ import annotations

import json
import time
from pathlib import Path

import numpy as np
import numpy.typing as npt
import pytest
import soundfile

from chairward.components import Context, DeviceLost, EndOfInput
from chairward.stages import AudioBlock
from chairward_microphone.recorded import RecordedSound
from chairward_microphone.settings import MicrophoneSettings


def source_of(context: Context, **settings: object) -> RecordedSound:
    return RecordedSound(MicrophoneSettings.model_validate(settings), context)


def all_blocks(source: RecordedSound, at_most: int = 100_000) -> list[AudioBlock]:
    source.open()
    out: list[AudioBlock] = []
    try:
        while len(out) < at_most:
            block = source.read(1.0)
            assert block is not None
            out.append(block)
    except EndOfInput:
        pass
    source.close()
    return out


def sound_of(blocks: list[AudioBlock]) -> npt.NDArray[np.float32]:
    return np.concatenate([b.samples for b in blocks])


def test_files_come_out_whole_and_in_order(tmp_path: Path, context: Context) -> None:
    first, second = np.linspace(-0.5, 0.5, 1000), np.linspace(0.5, -0.5, 777)
    for name, x in (("a.wav", first), ("b.wav", second)):
        soundfile.write(str(tmp_path / name), x, 16_000, subtype="FLOAT")
    blocks = all_blocks(source_of(context, kind="files", files=[tmp_path / "a.wav", tmp_path / "b.wav"], paced=False))
    whole = np.concatenate([first, second])
    np.testing.assert_allclose(sound_of(blocks)[: len(whole)], whole, atol=1e-6)
    assert [b.seq for b in blocks] == list(range(len(blocks)))
    assert {len(b.samples) for b in blocks} == {160}
    assert {np.diff([b.captured_ns for b in blocks]).min(), np.diff([b.captured_ns for b in blocks]).max()} == {10**7}


@pytest.mark.parametrize(
    ("subtype", "hz", "channels"), [("PCM_U8", 8000, 1), ("PCM_24", 44_100, 2), ("PCM_32", 48_000, 1)]
)
def test_any_rate_and_width_is_brought_to_the_rate_wanted(
    tmp_path: Path, context: Context, subtype: str, hz: int, channels: int
) -> None:
    tone = 0.5 * np.sin(2 * np.pi * 440 * np.arange(hz) / hz)
    soundfile.write(str(tmp_path / "a.wav"), np.repeat(tone[:, None], channels, axis=1), hz, subtype=subtype)
    found = sound_of(all_blocks(source_of(context, kind="files", files=[tmp_path / "a.wav"], paced=False)))
    assert len(found) == 16_000
    wanted = 0.5 * np.sin(2 * np.pi * 440 * np.arange(16_000) / 16_000)
    np.testing.assert_allclose(found[200:-200], wanted[200:-200], atol=0.02)


def test_paced_sound_is_there_when_its_clock_says(tmp_path: Path, context: Context) -> None:
    soundfile.write(str(tmp_path / "a.wav"), np.zeros(4800) + 0.1, 16_000)
    source = source_of(context, kind="files", files=[tmp_path / "a.wav"])
    source.open()
    for _ in range(30):
        block = source.read(1.0)
        assert block is not None
        late_ns = time.monotonic_ns() - (block.captured_ns + 10_000_000)
        assert 0 <= late_ns < 1_000_000_000  # never early; the upper bound only catches a wrong clock
    with pytest.raises(EndOfInput):
        source.read(1.0)
    source.close()


def test_a_short_timeout_gives_nothing_yet(tmp_path: Path, context: Context) -> None:
    soundfile.write(str(tmp_path / "a.wav"), np.zeros(4800) + 0.1, 8000)
    source = source_of(context, kind="files", files=[tmp_path / "a.wav"], rate_hz=8000)
    source.open()
    assert source.read(0.0) is None
    assert source.read(1.0) is not None
    source.close()


def test_words_are_played_as_the_playlist_says_and_written_down(manifest: Path, context: Context) -> None:
    source = source_of(
        context, kind="manifest", manifest=manifest, speaker="bo", playlist=["stop", "left", "stop"], paced=False
    )
    blocks = all_blocks(source)
    truth = [json.loads(line) for line in (context.run_dir / "voice-truth.jsonl").read_text().splitlines()]
    assert [line["word"] for line in truth] == ["stop", "left", "stop"]
    sound = sound_of(blocks)
    for line in truth:
        first, last = ((line[k] - blocks[0].captured_ns) * 16_000 // 10**9 for k in ("captured_ns", "end_ns"))
        assert last - first == pytest.approx(0.2 * 16_000, abs=480)
        assert np.sqrt(np.mean(sound[first:last] ** 2)) == pytest.approx(10 ** (-26 / 20), rel=0.15)
        assert 0 < np.sqrt(np.mean(sound[first - 3000 : first - 400] ** 2)) < 1e-2


def test_a_loop_never_ends(manifest: Path, context: Context) -> None:
    source = source_of(
        context, kind="manifest", manifest=manifest, playlist=["left"], loop=True, paced=False, gap_s=0.2
    )
    assert len(all_blocks(source, at_most=2000)) == 2000


@pytest.mark.parametrize(
    ("settings", "sentence"),
    [
        ({"kind": "files"}, "name at least one sound file"),
        ({"kind": "files", "files": ["nowhere.wav"]}, r"nowhere\.wav: there is no such sound file"),
        ({"kind": "manifest"}, r"microphone\.manifest is not set"),
        ({"kind": "manifest", "manifest": "nowhere.csv"}, r"nowhere\.csv: the manifest cannot be read"),
    ],
)
def test_what_is_missing_is_named(context: Context, settings: dict[str, object], sentence: str) -> None:
    with pytest.raises(DeviceLost, match=sentence):
        source_of(context, **settings).open()


def test_an_unknown_speaker_or_word_is_named(manifest: Path, context: Context) -> None:
    with pytest.raises(DeviceLost, match=r"no test words of speaker 'cy' \(there are: anna, bo\)"):
        source_of(context, kind="manifest", manifest=manifest, speaker="cy").open()
    with pytest.raises(DeviceLost, match=r"'anna' never says 'jump' \(says: left, stop\)"):
        source_of(context, kind="manifest", manifest=manifest, playlist=["jump"]).open()


@pytest.mark.parametrize("content", [b"", b"RIFF\0\0\0\0WAVE", b"hello" * 200])
def test_a_broken_file_is_one_sentence(tmp_path: Path, context: Context, content: bytes) -> None:
    (tmp_path / "bad.wav").write_bytes(content)
    with pytest.raises(DeviceLost, match=r"bad\.wav: cannot be read as sound"):
        source_of(context, kind="files", files=[tmp_path / "bad.wav"]).open()


def test_a_rate_too_low_for_words_is_refused(tmp_path: Path, context: Context) -> None:
    soundfile.write(str(tmp_path / "low.wav"), np.zeros(4000) + 0.1, 4000)
    with pytest.raises(DeviceLost, match="recorded at 4000 Hz, words need at least 8000 Hz"):
        source_of(context, kind="files", files=[tmp_path / "low.wav"]).open()

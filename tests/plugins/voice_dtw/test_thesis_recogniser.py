"""The thesis' recogniser against slow loops written from its description, and its tie rule."""

from __future__ import annotations

import math

import numpy as np
import numpy.typing as npt
import pytest

from chairward_voice_dtw import thesis

Array = npt.NDArray[np.float64]


def slow_filters() -> Array:
    """22 triangles with centres equally spaced in mel up to 4000 Hz over bins 0..127, each of sum 1."""
    top = 2595 * math.log10(1 + 4000 / 700)
    centres = [round(700 * (10 ** (k * top / 23 / 2595) - 1) / 4000 * 127) for k in range(24)]
    out = np.zeros((22, 128))
    for b in range(22):
        low, mid, high = centres[b], centres[b + 1], centres[b + 2]
        for k in range(128):
            if k == mid:
                out[b, k] = 1.0
            elif low <= k < mid:
                out[b, k] = (k - low) / (mid - low)
            elif mid < k <= high:
                out[b, k] = (high - k) / (high - mid)
        out[b] /= sum(out[b])
    return out


def slow_power(x: Array, start: int) -> Array:
    """|DFT|^2 of one Hamming-windowed frame, bins 0..127, by the definition."""
    n = np.arange(256)
    frame = x[start : start + 256] * (0.54 - 0.46 * np.cos(2 * np.pi * n / 255))
    return np.array([abs(np.sum(frame * np.exp(-2j * np.pi * k * n / 256))) ** 2 for k in range(128)])


def sound(seed: int, n: int = 1600) -> Array:
    t = np.arange(n) / 8000
    rng = np.random.default_rng(seed)
    return 0.1 * np.sin(2 * np.pi * rng.uniform(300, 2000) * t) + rng.normal(0.0, 0.01, n)


def test_filters_are_those_of_the_description() -> None:
    np.testing.assert_allclose(thesis.filters(), slow_filters(), atol=1e-12)


def test_code_features_equal_a_slow_loop() -> None:
    x = sound(1)
    found = thesis.code_features(x.astype(np.float32))
    weights = slow_filters()
    assert found.shape == (17, 22)
    for frame in (0, 8, 16):
        power = slow_power(x.astype(np.float32).astype(float), 80 * frame)
        energy = sum(power)
        wanted = [math.log(max(float(weights[b] @ power) / energy, 1e-4)) for b in range(22)]
        np.testing.assert_allclose(found[frame], wanted, rtol=1e-9)


def test_text_features_equal_a_slow_loop() -> None:
    x = sound(2).astype(np.float32).astype(float)
    found = thesis.text_features(x.astype(np.float32))
    emphasised = np.array([x[0]] + [x[k] - 0.97 * x[k - 1] for k in range(1, len(x))])
    weights = slow_filters()

    def static(frame: int) -> list[float]:
        power = slow_power(emphasised, 80 * frame)
        logs = [math.log(max(float(weights[b] @ power), 1e-10)) for b in range(22)]
        cepstra = [sum(logs[k] * math.cos(math.pi * q * (2 * k + 1) / 44) for k in range(22)) for q in range(14)]
        return [*cepstra, math.log(sum(power) + 1e-10)]

    assert found.shape == (17, 30)
    for frame in (1, 9):
        slope = (np.array(static(frame + 1)) - np.array(static(frame - 1))) / 2
        np.testing.assert_allclose(found[frame], [*static(frame), *slope], rtol=1e-6, atol=1e-8)


def slow_asymmetric(x: Array, y: Array) -> float:
    table = np.full((len(x), len(y)), np.inf)
    table[0, 0] = np.linalg.norm(x[0] - y[0])
    for j in range(1, len(x)):
        for i in range(len(y)):
            before = [table[j - 1, i - step] for step in (0, 1, 2) if i - step >= 0]
            table[j, i] = min(before) + np.linalg.norm(x[j] - y[i])
    return float(table[-1, -1])


def slow_symmetric(x: Array, y: Array) -> float:
    table = {(-1, -1): 0.0}
    for j in range(len(x)):
        for i in range(len(y)):
            if abs(i - j) <= max(thesis.BAND_FRAMES, abs(len(x) - len(y)) + 1):
                cost = float(np.linalg.norm(x[j] - y[i]))
                table[j, i] = min(
                    table.get((j, i - 1), np.inf) + cost,
                    table.get((j - 1, i - 1), np.inf) + 2 * cost,
                    table.get((j - 1, i), np.inf) + cost,
                )
    return table.get((len(x) - 1, len(y) - 1), np.inf)


@pytest.mark.parametrize(("n", "m"), [(20, 20), (31, 20), (20, 31), (45, 60), (60, 20), (10, 40)])
def test_warping_equals_slow_loops(n: int, m: int) -> None:
    rng = np.random.default_rng(n * m)
    x, y = rng.normal(size=(n, 4)), rng.normal(size=(m, 4))
    assert thesis.text_distance(x, y) == pytest.approx(slow_symmetric(x, y), rel=1e-9)
    found, wanted = thesis.code_distance(x, y), slow_asymmetric(x, y)
    assert found == pytest.approx(wanted, rel=1e-9)


def test_a_tie_stops_and_every_sound_gets_a_word() -> None:
    same = sound(5, 12_000).astype(np.float32)
    tied = thesis.ThesisMatcher({"left": same, "stop": same}, "stop", "code")
    assert tied.decide(same) == "stop"
    assert tied.decide(sound(6, 12_000).astype(np.float32)) in {"left", "stop"}


@pytest.mark.parametrize("mode", ["text", "code"])
def test_it_knows_its_own_templates(mode: thesis.Mode, speak) -> None:  # type: ignore[no-untyped-def]
    recordings = {word: speak(word, 0, 8000) for word in ("left", "right", "stop")}
    matcher = thesis.ThesisMatcher(recordings, "stop", mode)
    assert [matcher.decide(sound) for sound in recordings.values()] == list(recordings)

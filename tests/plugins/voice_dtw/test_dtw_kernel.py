"""The warping kernel, its fallback and the obvious loop agree; so do the helpers beside it."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from chairward_voice_dtw import dtw

Array = npt.NDArray[np.float32]


def obvious(x: Array, y: Array, band: float) -> float:
    """The recursion over the whole table, in float64."""
    n, m = len(x), len(y)
    reach = max(band * max(n, m), 2.0)
    table = {(-1, -1): 0.0}
    for i in range(n):
        centre = (i + 0.5) * m / n
        for j in range(max(0, int(centre - reach)), min(m, int(centre + reach) + 1)):
            cost = float(np.linalg.norm(x[i].astype(float) - y[j].astype(float)))
            table[i, j] = min(
                table.get((i - 1, j - 1), np.inf) + 2 * cost,
                table.get((i - 1, j), np.inf) + cost,
                table.get((i, j - 1), np.inf) + cost,
            )
    return table.get((n - 1, m - 1), np.inf) / (n + m)


def made(seed: int, n: int, d: int = 5) -> Array:
    return np.random.default_rng(seed).normal(size=(n, d)).astype(np.float32)


@settings(deadline=None, max_examples=60)
@given(st.integers(0, 10_000), st.integers(1, 40), st.integers(1, 40), st.sampled_from([0.1, 0.35, 1.0]))
def test_kernel_fallback_and_the_obvious_loop_agree(seed: int, n: int, m: int, band: float) -> None:
    x, y = made(seed, n), made(seed + 1, m)
    wanted = obvious(x, y, band)
    packed, lengths = dtw.pack([y, y[: max(1, m // 2)]])
    kernel = dtw.distances(x, packed, lengths, band)[0]
    fallback = dtw.distance_numpy(x, y, band)
    if np.isinf(wanted):
        assert np.isinf(kernel)
        assert np.isinf(fallback)
    else:
        assert kernel == pytest.approx(wanted, rel=1e-4)
        assert fallback == pytest.approx(wanted, rel=1e-4)


@settings(deadline=None, max_examples=30)
@given(st.integers(0, 10_000), st.integers(2, 40), st.integers(2, 40))
def test_distance_is_symmetric_and_nothing_to_itself(seed: int, n: int, m: int) -> None:
    x, y = made(seed, n), made(seed + 1, m)
    a = dtw.distances(x, *dtw.pack([y, x]), 1.0)
    b = dtw.distances(y, *dtw.pack([x]), 1.0)
    assert a[0] == pytest.approx(b[0], rel=1e-4)
    assert a[1] == pytest.approx(0.0, abs=1e-6)


def test_nearest_frames_are_the_nearest() -> None:
    x, y = made(1, 12), made(2, 17)
    found = dtw.both_ways(x, *dtw.pack([y]))[2][0]
    wanted = np.linalg.norm(x[:, None] - y[None], axis=2).min(axis=1)
    np.testing.assert_allclose(found, wanted, rtol=1e-4)

"""Pairing of two free-running cameras, as laws."""

from __future__ import annotations

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from chairward_cameras.pairing import Picture, captured_ns, newest_pair

BLANK = np.zeros((2, 2, 3), np.uint8)
times = st.lists(st.integers(0, 1000), max_size=4).map(sorted)


def pictures(stamps: list[int]) -> list[Picture]:
    return [Picture(image=BLANK, captured_ns=t, number=i + 1) for i, t in enumerate(stamps)]


@given(times, times, st.integers(0, 300))
def test_a_pair_is_never_farther_apart_than_allowed_and_none_only_when_there_is_none(
    left: list[int], right: list[int], skew: int
) -> None:
    allowed = [(a, b) for a in left for b in right if abs(a - b) <= skew]
    found = newest_pair(pictures(left), pictures(right), skew)
    assert (found is None) == (not allowed)
    if found is not None:
        got = found[0].captured_ns, found[1].captured_ns
        assert got in allowed
        assert min(got) == max(min(p) for p in allowed)
        assert abs(got[0] - got[1]) == min(abs(a - b) for a, b in allowed if min(a, b) == min(got))


@given(st.integers(10**9, 10**15), st.integers(0, 2_000_000_000))
def test_the_drivers_stamp_is_used_when_it_is_a_plausible_time(now_ns: int, age_ns: int) -> None:
    stamp_ms = (now_ns - age_ns) / 1e6
    got = captured_ns(stamp_ms, now_ns, 33_000_000)
    assert got <= now_ns
    assert abs(got - (now_ns - age_ns)) <= 1000 or got == now_ns - 33_000_000


def test_no_stamp_a_stamp_of_another_clock_and_one_of_the_future_make_a_picture_one_period_old() -> None:
    now_ns, period_ns = 5_000_000_000_000, 33_000_000
    for position_ms in (-1.0, 0.0, 33.3, 1.7e12, now_ns / 1e6 + 1):
        assert captured_ns(position_ms, now_ns, period_ns) == now_ns - period_ns
    assert captured_ns(now_ns / 1e6 - 20, now_ns, period_ns) == now_ns - 20_000_000

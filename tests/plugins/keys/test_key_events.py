"""What terminals type and input devices report, as keys going down and up."""

from __future__ import annotations

import struct

import pytest
from hypothesis import given
from hypothesis import strategies as st
from pydantic import ValidationError

from chairward_keys.events import DeviceKeys, KeyEvent, Stroke, TypedKeys, is_key_name
from chairward_keys.settings import DEFAULT_KEYS, KeysSettings

MS = 1_000_000
GAP = 150 * MS


def strokes(keys: TypedKeys, *typed: tuple[int, bytes]) -> list[tuple[int, str, str]]:
    """(time in ms, key, stroke) of everything that (time in ms, bytes) means."""
    return [(at, e.key, e.stroke.value) for at, data in typed for e in keys.feed(data, at * MS)]


def test_a_tap_goes_down_and_up_at_once() -> None:
    assert strokes(TypedKeys(GAP), (0, b"w"), (1000, b"")) == [(0, "w", "down"), (0, "w", "up")]


def test_a_key_is_held_from_its_second_close_repeat_until_the_repeats_stop() -> None:
    typed = [(0, b"w"), (600, b"w"), *((600 + 40 * i, b"w") for i in range(1, 6)), (850, b""), (951, b"")]
    assert strokes(TypedKeys(GAP), *typed) == [
        (0, "w", "down"),
        (0, "w", "up"),
        (600, "w", "down"),
        (600, "w", "up"),
        (640, "w", "down"),
        (951, "w", "up"),
    ]


def test_another_key_lets_go_of_the_held_one() -> None:
    got = strokes(TypedKeys(GAP), (0, b"w"), (40, b"w"), (60, b" "))
    assert got[-3:] == [(60, "w", "up"), (60, "space", "down"), (60, "space", "up")]


@pytest.mark.parametrize(
    ("data", "key"),
    [
        (b" ", "space"),
        (b"\r", "enter"),
        (b"\n", "enter"),
        (b"R", "r"),
        (b"\x1b[A", "up"),
        (b"\x1b[B", "down"),
        (b"\x1bOC", "right"),
        (b"\x1b[1;5D", "left"),
        (b"\x1b[15~", "other"),
        (b"\x03", "other"),
        (b"\xc3", "ã"),
    ],
)
def test_bytes_have_names(data: bytes, key: str) -> None:
    assert [e.key for e in TypedKeys(GAP).feed(data, 0)] == [key, key]


def test_an_arrow_cut_in_two_is_one_arrow_and_a_lone_escape_is_the_escape_key() -> None:
    keys = TypedKeys(GAP)
    assert strokes(keys, (0, b"\x1b"), (10, b"[A")) == [(10, "up", "down"), (10, "up", "up")]
    due_ns = None
    assert strokes(keys, (1000, b"\x1b")) == []
    due_ns = keys.next_due_ns()
    assert due_ns is not None
    assert [e.key for e in keys.feed(b"", due_ns)] == ["escape", "escape"]


@given(st.lists(st.tuples(st.integers(0, 300), st.binary(max_size=6)), max_size=30))
def test_whatever_is_typed_every_down_has_its_up_and_silence_lets_go(typed: list[tuple[int, bytes]]) -> None:
    keys, now_ms, down = TypedKeys(GAP), 0, set[str]()
    for wait_ms, data in [*typed, (1000, b""), (1000, b"")]:
        now_ms += wait_ms
        for event in keys.feed(data, now_ms * MS):
            assert (event.stroke is Stroke.UP) == (event.key in down), "downs and ups take turns"
            down ^= {event.key}
    assert down == set()
    assert keys.next_due_ns() is None


def event(kind: int, code: int, value: int) -> bytes:
    return struct.pack("<qqHHi", 1, 2, kind, code, value)


def test_an_input_device_tells_down_and_up_and_repeats_mean_nothing() -> None:
    data = event(1, 57, 1) + event(0, 0, 0) + event(1, 57, 2) + event(1, 57, 0) + event(2, 0, 5)
    assert list(DeviceKeys().feed(data, 0)) == [KeyEvent("space", Stroke.DOWN), KeyEvent("space", Stroke.UP)]


def test_a_key_that_was_down_before_we_looked_does_not_count() -> None:
    assert list(DeviceKeys().feed(event(1, 17, 2) + event(1, 17, 0), 0)) == []


def test_dropped_events_say_that_nothing_is_known() -> None:
    assert list(DeviceKeys().feed(event(0, 3, 0), 0)) == [KeyEvent("", Stroke.LOST)]


@given(st.data())
def test_events_may_come_in_any_pieces(data: st.DataObject) -> None:
    codes = data.draw(st.lists(st.tuples(st.integers(0, 400), st.integers(0, 2)), max_size=8))
    stream = b"".join(event(1, code, value) for code, value in codes)
    cuts = sorted(data.draw(st.lists(st.integers(0, len(stream)), max_size=5)))
    whole, pieces = DeviceKeys(), DeviceKeys()
    got = [e for a, b in zip([0, *cuts], [*cuts, len(stream)], strict=True) for e in pieces.feed(stream[a:b], 0)]
    assert got == list(whole.feed(stream, 0))


@pytest.mark.parametrize(
    ("code", "key"), [(16, "q"), (30, "a"), (19, "r"), (11, "0"), (103, "up"), (272, "mouse_left"), (288, "code_288")]
)
def test_codes_have_the_names_of_linux_input(code: int, key: str) -> None:
    assert [e.key for e in DeviceKeys().feed(event(1, code, 1), 0)] == [key]
    assert is_key_name(key)


def test_the_default_keys_exist_and_a_wrong_name_or_a_device_that_cannot_stop_is_refused() -> None:
    assert all(is_key_name(key) for key in DEFAULT_KEYS)
    with pytest.raises(ValidationError, match="no key is called 'spcae'"):
        KeysSettings(keys={"spcae": "stop"})
    with pytest.raises(ValidationError, match="no key stops the chair"):
        KeysSettings(keys={"w": "front"}, other_keys="ignore")
    with pytest.raises(ValidationError):
        KeysSettings(keys={"w": "fly"})

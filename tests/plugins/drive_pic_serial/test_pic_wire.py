"""The bytes: what is broken is never taken, what is sound always is."""

from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from chairward_drive_pic_serial import wire
from chairward_drive_pic_serial.describe import describe
from chairward_drive_pic_serial.wire import Ask, Fault, Hello, Input, Nak, Reason, State, Status, Why

payloads = st.binary(min_size=2, max_size=10)


def crc_slowly(data: bytes) -> int:
    """CRC-16/IBM-3740 bit by bit, as the catalogue defines it: poly 0x1021, init 0xFFFF, nothing reflected."""
    crc = 0xFFFF
    for byte in data:
        crc ^= byte << 8
        for _ in range(8):
            crc = (crc << 1 ^ (0x1021 if crc & 0x8000 else 0)) & 0xFFFF
    return crc


@given(payloads)
def test_what_is_encoded_comes_back(payload: bytes) -> None:
    frame = wire.encode(payload)
    assert frame.count(0) == 1
    assert wire.payload(frame[:-1]) == payload


@given(payloads)
def test_the_checksum_is_the_catalogues(payload: bytes) -> None:
    from cobs import cobs

    data = cobs.decode(wire.encode(payload)[:-1])
    assert int.from_bytes(data[-2:], "big") == crc_slowly(payload)


@given(payloads, st.data())
def test_one_to_three_flipped_bits_are_always_noticed(payload: bytes, data: st.DataObject) -> None:
    frame = bytearray(wire.encode(payload)[:-1])
    bits = data.draw(st.sets(st.integers(0, 8 * len(frame) - 1), min_size=1, max_size=3))
    for bit in bits:
        frame[bit // 8] ^= 1 << bit % 8
    heard = list(wire.Splitter().feed(bytes(frame) + b"\0"))
    assert payload not in heard


@given(st.lists(st.one_of(payloads.map(wire.encode), st.binary(max_size=30)), max_size=8), st.data())
def test_the_cuts_of_a_stream_do_not_matter(parts: list[bytes], data: st.DataObject) -> None:
    stream = b"".join(parts)
    whole = list(wire.Splitter().feed(stream))
    splitter, heard, at = wire.Splitter(), [], 0
    while at < len(stream):
        step = data.draw(st.integers(1, 7))
        heard += splitter.feed(stream[at : at + step])
        at += step
    assert heard == whole


@given(st.binary(max_size=200), payloads)
def test_after_any_garbage_and_a_delimiter_the_next_good_frame_is_taken(garbage: bytes, payload: bytes) -> None:
    splitter = wire.Splitter()
    list(splitter.feed(garbage + b"\0"))
    assert list(splitter.feed(wire.encode(payload))) == [payload]


@given(st.binary(max_size=12))
def test_any_payload_is_read_or_refused_but_never_raises(data: bytes) -> None:
    answer = wire.answer(data)
    assert answer is None or isinstance(answer, Status | Hello | Nak)
    assert describe(data)


def test_a_frame_without_end_does_not_grow() -> None:
    splitter = wire.Splitter(limit=64)
    for _ in range(1000):
        assert list(splitter.feed(b"\x55" * 50)) == []
    assert splitter.broken > 0
    assert len(splitter._part) <= 64


@pytest.mark.parametrize(
    ("data", "meant"),
    [
        (
            bytes([0x81, 7, 2, 1, 0x9C, 100, 200, 0b1001]),
            Status(7, State.ARMED, Fault.SILENCE, -100, 100, 200, Input.STOP | Input.STANDING),
        ),
        (bytes([0x82, 9, 1, 0, 0x12, 0x34, 2, 195]), Hello(9, 1, State.BOOT, 0x1234, Reason.WATCHDOG, 195)),
        (bytes([0xFF, 0, 1, 1, 0, 5, 0, 0]), Nak(0, Why.CRC, State.NEUTRAL, Fault(0), 5)),
        (bytes([0x81, 7, 9, 0, 0, 0, 0, 0]), None),
        (bytes([0x81, 7, 2, 8, 0, 0, 0, 0]), None),
        (bytes([0x77, 7, 2, 0, 0, 0, 0, 0]), None),
        (bytes([0x81, 7, 2]), None),
    ],
)
def test_replies_mean_what_the_readme_says(data: bytes, meant: wire.Answer | None) -> None:
    assert wire.answer(data) == meant


@pytest.mark.parametrize(
    ("payload", "line"),
    [
        (wire.payload(wire.ask(Ask.DRIVE, 3, -5, 60)[:-1]), "->   3 DRIVE steer -5 drive +60"),
        (wire.payload(wire.ask(Ask.BRAKE, 4, 1)[:-1]), "->   4 BRAKE 1"),
        (wire.payload(wire.ask(Ask.ESTOP, 5)[:-1]), "->   5 ESTOP"),
        (bytes([0xFF, 0, 1, 1, 0, 5, 0, 0]), "<-   0 NAK CRC NEUTRAL last 5"),
        (b"\x99\x01", "?? 99 01"),
    ],
)
def test_the_monitor_prints_frames_readably(payload: bytes, line: str) -> None:
    assert describe(payload) == line

"""The wire: whole messages or none, never waiting; a closed peer reads as closed."""

from __future__ import annotations

import os

import pytest

from chairward import wire
from chairward.messages import Alive, Parcel


def test_a_parcel_survives_the_way() -> None:
    a, b = wire.pair()
    parcel = Parcel(stage="voice_dtw", body=Alive(seq=3, captured_ns=5, well=False, reason="muted"))
    with a, b:
        assert wire.send(a, wire.encode_parcel(parcel))
        data = wire.receive(b)
        assert data is not None
        assert wire.decode_parcel(data) == parcel


def test_reading_an_empty_line_does_not_wait() -> None:
    a, b = wire.pair()
    with a, b:
        assert wire.receive(b) is None


def test_a_closed_peer_reads_as_empty_bytes_and_cannot_be_sent_to() -> None:
    a, b = wire.pair()
    a.close()
    with b:
        assert wire.receive(b) == b""
        with pytest.raises(ConnectionError):
            wire.send(b, b"x")


def test_a_control_message_that_is_none_is_told_not_raised() -> None:
    a, b = wire.pair()
    with a, b:
        a.send(b"\xff\x00 nonsense")
        received = wire.receive_control(b)
        assert received is not None
        assert isinstance(received[0], wire.Note)


def test_sending_to_a_reader_that_does_not_read_is_refused_not_waited_for() -> None:
    a, b = wire.pair()
    with a, b:
        sent = 0
        while wire.send(a, b"x" * 1000):
            sent += 1
            assert sent < 100_000
        assert sent > 0


def test_control_messages_carry_descriptors() -> None:
    a, b = wire.pair()
    reader, writer = os.pipe()
    with a, b:
        assert wire.send_control(a, wire.Attach("front"), [writer])
        os.close(writer)
        received = wire.receive_control(b)
        assert received is not None
        message, fds = received
        assert message == wire.Attach("front")
        os.write(fds[0], b"through")
        os.close(fds[0])
        assert os.read(reader, 10) == b"through"
    os.close(reader)


def test_control_of_a_closed_peer_is_end_of_file() -> None:
    a, b = wire.pair()
    a.close()
    with b, pytest.raises(EOFError):
        wire.receive_control(b)

"""Shared values: one writer, any reader, never a mixture of two writes."""

from __future__ import annotations

import struct
import threading
from pathlib import Path

import pytest

from chairward.shared_state import SharedState


def test_values_are_read_as_written(tmp_path: Path) -> None:
    writer = SharedState.create(tmp_path / "pins", ("duty", "brake"))
    reader = SharedState.attach(tmp_path / "pins")
    writer.write(duty=0.25)
    writer.write(brake=1)
    assert reader.read() == {"duty": 0.25, "brake": 1.0}


def test_an_unknown_name_is_refused_by_name(tmp_path: Path) -> None:
    writer = SharedState.create(tmp_path / "pins", ("duty",))
    with pytest.raises(KeyError, match="no value named 'dutty'"):
        writer.write(dutty=1.0)


def test_a_reader_cannot_write(tmp_path: Path) -> None:
    SharedState.create(tmp_path / "pins", ("duty",))
    with pytest.raises(TypeError):
        SharedState.attach(tmp_path / "pins").write(duty=1.0)


def test_a_file_that_does_not_appear_is_named(tmp_path: Path) -> None:
    with pytest.raises(FileNotFoundError, match="nowhere"):
        SharedState.attach(tmp_path / "nowhere", timeout_s=0.02)


def test_a_writer_that_died_in_mid_write_is_told_not_waited_for(tmp_path: Path) -> None:
    writer = SharedState.create(tmp_path / "pins", ("duty",))
    struct.pack_into("<Q", writer._map, 0, 3)
    with pytest.raises(TimeoutError, match="stopped in the middle"):
        SharedState.attach(tmp_path / "pins").read()


def test_no_read_mixes_two_writes(tmp_path: Path) -> None:
    writer = SharedState.create(tmp_path / "pins", ("a", "b"))
    reader = SharedState.attach(tmp_path / "pins")
    stop = threading.Event()

    def write() -> None:
        value = 0.0
        while not stop.is_set():
            value += 1.0
            writer.write(a=value, b=-value)

    thread = threading.Thread(target=write)
    thread.start()
    try:
        reads = [reader.read() for _ in range(3000)]
    finally:
        stop.set()
        thread.join()
    assert all(r["a"] == -r["b"] for r in reads)

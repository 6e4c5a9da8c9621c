"""What a screen may ask of the run as a whole."""

from __future__ import annotations

from pathlib import Path

from chairward import next_run
from chairward.next_run import NextRun


def test_what_was_asked_is_read_and_can_be_forgotten(tmp_path: Path) -> None:
    assert next_run.asked(tmp_path) is None
    next_run.ask(tmp_path, NextRun(person="asha"))
    assert next_run.asked(tmp_path) == NextRun(person="asha")
    next_run.forget(tmp_path)
    assert next_run.asked(tmp_path) is None


def test_nonsense_asks_for_nothing(tmp_path: Path) -> None:
    for nonsense in (b"", b"{}", b'{"person": 7}', b"\xff", b'{"person": "a", "speed": 9}'):
        (tmp_path / next_run.FILE).write_bytes(nonsense)
        assert next_run.asked(tmp_path) is None
        assert not (tmp_path / next_run.FILE).exists()

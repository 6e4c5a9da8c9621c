"""What a process says is kept in a log that does not grow for ever, with one older piece of it."""

from __future__ import annotations

import time
from pathlib import Path

import pytest

from chairward.options import GuardOptions
from chairward.processes import LOG_BYTES, bound_log, last_words, spawn

TALKER = """
import pathlib, time
for batch in range(3):
    while not pathlib.Path(f"batch-{batch}").exists():
        time.sleep(0.01)
    for line in range(15_000):
        print(f"batch {batch}: something went wrong in the camera's driver, once more: line {line:5d}")
    print(f"end of batch {batch}", flush=True)
"""
NOTHING = GuardOptions(plan="", run_dir="", control=0, lanes={}, observers=[])


def test_a_log_that_grows_is_cut_and_its_process_goes_on_writing(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    (tmp_path / "talker.py").write_text(TALKER)
    log, old = tmp_path / "front.log", tmp_path / "front.old.log"
    process = spawn(tmp_path, "talker", NOTHING, "front", [])
    try:
        for batch in range(3):
            (tmp_path / f"batch-{batch}").touch()
            end = time.monotonic() + 60.0
            while last_words(tmp_path, "front") != f"end of batch {batch}":
                assert time.monotonic() < end, f"waited for batch {batch}"
                time.sleep(0.01)
            said = log.read_bytes()
            assert said.startswith(f"batch {batch}:".encode()), "it begins anew after each cut"
            assert len(said) > LOG_BYTES
            bound_log(tmp_path, "front")
            assert old.read_bytes() == said[-LOG_BYTES:], "and the newest that was cut is kept, once"
            assert log.stat().st_size == 0
        assert process.wait(30.0) == 0
    finally:
        process.kill()
        process.wait(10.0)
    assert sorted(path.name for path in tmp_path.glob("*.log")) == ["front.log", "front.old.log"]


def test_a_log_of_usual_length_is_left_alone(tmp_path: Path) -> None:
    (tmp_path / "front.log").write_bytes(b"." * LOG_BYTES)
    bound_log(tmp_path, "front")
    bound_log(tmp_path, "nobody")
    assert [path.name for path in tmp_path.iterdir()] == ["front.log"]
    assert (tmp_path / "front.log").stat().st_size == LOG_BYTES


def test_a_log_that_cannot_be_cut_ends_nothing(tmp_path: Path) -> None:
    (tmp_path / "front.log").write_bytes(b"." * (LOG_BYTES + 1))
    (tmp_path / "front.old.log").mkdir()
    bound_log(tmp_path, "front")
    assert (tmp_path / "front.log").stat().st_size == 0

"""What was measured goes into the chair file; everything a person wrote there stays."""

from __future__ import annotations

import tomllib
from datetime import date
from pathlib import Path

import pytest

from chairward.check.chair_file import write_drive

CHAIR = """\
# My chair.
name = "mine"           # as the file

[drive.wheels]          # two motors
port = "/dev/ttyUSB0"   # by-id would be better
full_speed_mm_s = 500   # at full duty, measure
full_turn_deg_s = "@home.full_turn_deg_s"
# silence_stop_ms = 180

[drive.other]
channel = "can0"
"""
NOTE = "measured 2026-11-22: by eye"


@pytest.fixture
def chair(tmp_path: Path) -> Path:
    path = tmp_path / "mine.toml"
    path.write_text(CHAIR, encoding="utf-8")
    return path


def test_values_are_set_with_date_and_method_and_nothing_else_changes(chair: Path) -> None:
    values = {"full_speed_mm_s": 480.5, "silence_stop_ms": 180, "silence_stop_measured": date(2026, 11, 22)}
    assert write_drive(chair, "wheels", values, NOTE) == list(values)
    table = tomllib.loads(chair.read_text(encoding="utf-8"))
    assert table["drive"]["wheels"] == {"port": "/dev/ttyUSB0", "full_turn_deg_s": "@home.full_turn_deg_s", **values}
    assert table["drive"]["other"] == {"channel": "can0"}
    lines = chair.read_text(encoding="utf-8").splitlines()
    for line in CHAIR.splitlines():
        assert line in lines or line.startswith("full_speed_mm_s")
    assert f"full_speed_mm_s = 480.5 # at full duty; {NOTE}" in lines
    assert f"silence_stop_ms = 180 # {NOTE}" in lines


def test_measuring_again_replaces_the_old_note_and_keeps_the_persons(chair: Path) -> None:
    write_drive(chair, "wheels", {"full_speed_mm_s": 480}, NOTE)
    write_drive(chair, "wheels", {"full_speed_mm_s": 490}, "measured 2027-01-01: encoders")
    text = chair.read_text(encoding="utf-8")
    assert "full_speed_mm_s = 490 # at full duty; measured 2027-01-01: encoders" in text
    assert NOTE not in text


def test_a_reference_to_another_setting_stays(chair: Path) -> None:
    assert write_drive(chair, "wheels", {"full_turn_deg_s": 44.0}, NOTE) == []
    assert chair.read_text(encoding="utf-8") == CHAIR

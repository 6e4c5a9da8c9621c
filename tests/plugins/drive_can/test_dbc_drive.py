"""DBC: whatever the file says is found or refused by name; counter, checksum, cycle and rounding are kept."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from chairward.components import DriveError, Motion
from chairward_drive_can.checksum import crc8_j1850
from chairward_drive_can.dbc import DbcDialect, load, read
from chairward_drive_can.example import EXAMPLE_DBC, EXAMPLE_TABLE
from chairward_drive_can.frames import Frame
from chairward_drive_can.make import make
from chairward_drive_can.settings import CanSettings

HEARD = bytes((0, 0, 0, 0, 0, 0b010, 80, 0))


def dialect(**changes: Any) -> DbcDialect:
    table = {**EXAMPLE_TABLE, **changes}
    made = CanSettings.model_validate({"dialect": "dbc", "dbc": table})
    return DbcDialect(made, load(made.dbc, Path()))


def decoded(frame: Frame) -> dict[str, Any]:
    return dict(read(EXAMPLE_DBC).decode_message(frame.id, frame.data, decode_choices=False))


@pytest.mark.parametrize(
    ("change", "sentence"),
    [
        ({"file": "none.dbc"}, r"none\.dbc cannot be read as a DBC file"),
        (
            {"forward": "Nope.Forward"},
            r"dbc\.forward = 'Nope\.Forward': the file has no message 'Nope' \(Drive, Status\)",
        ),
        ({"turn": "Drive.Left"}, r"dbc\.turn = 'Drive\.Left': message Drive has no signal 'Left' \(Forward, Turn,"),
        ({"battery": "Status.Volts"}, r"dbc\.battery = 'Status\.Volts'"),
        ({"checksum": "Drive.Counter"}, r"dbc\.checksum = 'Drive\.Counter' is not one whole byte"),
    ],
)
def test_a_table_that_does_not_fit_the_file_is_refused_by_key(change: dict[str, Any], sentence: str) -> None:
    made = CanSettings.model_validate({"dialect": "dbc", "dbc": {**EXAMPLE_TABLE, **change}})
    with pytest.raises(DriveError, match=sentence):
        make(made)


def test_a_controller_that_cannot_be_heard_is_refused() -> None:
    silent = dict.fromkeys(["speed", "turning", "fault", "stopped_by_user", "armed", "battery", "charging"])
    with pytest.raises(DriveError, match="without a status signal"):
        dialect(**silent)


def test_a_file_that_is_no_dbc_file_is_refused_in_one_line(tmp_path: Path) -> None:
    broken = tmp_path / "broken.dbc"
    broken.write_text("BO_ what: 8 is this")
    with pytest.raises(DriveError) as caught:
        read(broken)
    assert "\n" not in str(caught.value)
    assert "broken.dbc" in str(caught.value)


def test_the_cycle_time_comes_from_the_file_unless_the_chair_file_gives_one() -> None:
    assert dialect().period_ns == 20_000_000
    assert dialect(cycle_ms=10).period_ns == 10_000_000


def test_counter_rises_and_wraps_and_the_checksum_covers_all_other_bytes() -> None:
    drive = dialect()
    frames = [drive.command(0, Motion(0.0, 0.0), False)[0] for _ in range(20)]
    assert [decoded(frame)["Counter"] for frame in frames] == [n % 16 for n in range(20)]
    assert all(frame.data[7] == crc8_j1850(frame.data[:7]) for frame in frames)


@settings(max_examples=200, suppress_health_check=[HealthCheck.too_slow])
@given(st.floats(-500, 500), st.floats(-45, 45))
def test_rounding_to_the_signals_steps_never_makes_the_chair_faster(drive_mm_s: float, turn_deg_s: float) -> None:
    frame = armed_dialect.command(0, Motion(drive_mm_s, turn_deg_s), False)[0]
    values = decoded(frame)
    for value, asked in ((values["Forward"], drive_mm_s * 0.001), (values["Turn"], turn_deg_s * 0.017453292519943295)):
        assert abs(value) <= abs(asked) + 1e-9
        assert abs(asked - value) <= 0.001 + 1e-9
        assert value * asked >= 0.0


armed_dialect = dialect()
armed_dialect.hear(Frame(513, HEARD), 1, None)
armed_dialect.arm(1)


def test_a_value_beyond_the_files_range_is_refused_in_the_files_words() -> None:
    drive = dialect(forward_per_mm_s=0.01)
    drive.hear(Frame(513, HEARD), 1, None)
    drive.arm(1)
    with pytest.raises(DriveError, match=r"Drive cannot carry this command: .*Forward"):
        drive.command(1, Motion(500.0, 0.0), False)


@pytest.mark.parametrize(
    ("data", "sentence"),
    [
        (bytes((0, 0, 0, 0, 7, 0, 80, 0)), r"fault 7 \(Status\.Fault\)"),
        (bytes((0, 0, 0, 0, 0, 1, 80, 0)), r"Status\.UserStop is active"),
        (bytes((0, 0, 0, 0, 0, 4, 80, 0)), "charger is connected"),
    ],
)
def test_arming_is_refused_with_what_the_controller_says(data: bytes, sentence: str) -> None:
    drive = dialect()
    drive.hear(Frame(513, data), 1, None)
    with pytest.raises(DriveError, match=sentence):
        drive.arm(1)


@pytest.mark.parametrize(("hard_stop", "mode"), [(False, 1), (True, 2)])
def test_enable_brake_and_idle_are_the_values_of_the_table(hard_stop: bool, mode: int) -> None:
    assert decoded(armed_dialect.command(0, Motion(0.0, 0.0), hard_stop)[0])["Mode"] == mode
    assert decoded(dialect().command(0, Motion(0.0, 0.0), False)[0])["Mode"] == 0


def test_a_status_of_the_wrong_length_counts_as_unheard() -> None:
    drive = dialect()
    drive.hear(Frame(513, b"\0\0"), 99, None)
    assert drive.report(100).heard_ns == 0


def test_a_controller_that_was_armed_and_says_it_no_longer_is_gets_no_motion() -> None:
    drive = dialect()
    drive.hear(Frame(513, HEARD), 1, None)
    drive.arm(1)
    drive.hear(Frame(513, HEARD), 2, None)
    assert decoded(drive.command(2, Motion(200.0, 0.0), False)[0])["Forward"] > 0
    drive.hear(Frame(513, bytes((0, 0, 0, 0, 0, 0, 80, 0))), 3, None)
    assert not drive.report(3).armed
    assert decoded(drive.command(3, Motion(200.0, 0.0), False)[0])["Forward"] == 0


def test_a_mapping_must_be_message_dot_signal() -> None:
    with pytest.raises(ValueError, match=re.escape("dbc.forward")):
        CanSettings.model_validate({"dialect": "dbc", "dbc": {**EXAMPLE_TABLE, "forward": "Forward"}})

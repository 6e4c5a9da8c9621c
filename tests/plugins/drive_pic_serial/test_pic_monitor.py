"""The exchange is readable, live and from a recording, and the monitor changes nothing on the wire."""

from __future__ import annotations

from pathlib import Path

import pytest
from typer.testing import CliRunner

from chairward_drive_pic_serial.commands import pic
from chairward_drive_pic_serial.drive import PicSerialDrive
from chairward_drive_pic_serial.engine import ModelEngine
from chairward_drive_pic_serial.monitor import Reader, Relay, recorded
from chairward_drive_pic_serial.port import Port
from chairward_drive_pic_serial.rig import PicRig
from chairward_drive_pic_serial.settings import PicSerialSettings
from chairward_drive_pic_serial.sim_pic import PtyEnd


class _MonitoredRig(PicRig):
    """The drive talks to the monitor's pty, the monitor to the controller's."""

    relay: Relay | None = None

    def step(self, microseconds: int) -> None:
        if self.relay is not None:
            self.relay.carry()
        super().step(microseconds)


def test_the_monitor_shows_and_records_both_ways_and_lets_the_chair_drive(tmp_path: Path) -> None:
    rig, record, lines = _MonitoredRig(ModelEngine(), tmp_path), tmp_path / "exchange.txt", []
    end, port = PtyEnd(tmp_path / "watched"), Port(rig.port)
    rig.drive = PicSerialDrive(PicSerialSettings(port=str(end.link)))
    with record.open("w", encoding="ascii") as file:
        rig.relay = Relay(port, end, lines.append, file)
        assert rig.go().drive_mm_s > 0
    rig.close()
    end.close()
    port.close()
    text = "\n".join(lines)
    for part in ("-> ", "HELLO protocol 1", "DRIVE steer +0 drive +50", "STATUS ARMED"):
        assert part in text
    assert [line.split(maxsplit=1)[1] for line in recorded(record)] == [line.split(maxsplit=1)[1] for line in lines]
    shown = CliRunner().invoke(pic, ["monitor", str(record)])
    assert shown.exit_code == 0
    assert shown.output.splitlines() == list(recorded(record))


def test_broken_bytes_are_shown_as_broken() -> None:
    lines = list(Reader().lines(1.5, "<", b"\x05\x01\x02\x00"))
    assert lines == ["    1.5000  <- 1 broken: 05 01 02 00"]


@pytest.mark.parametrize("text", ["nonsense", "1.0 ! 00", "1.0 > zz", "x > 00"])
def test_a_file_that_is_no_recording_is_refused_by_line(tmp_path: Path, text: str) -> None:
    path = tmp_path / "file"
    path.write_text(f"0.1 > 00\n{text}\n")
    shown = CliRunner().invoke(pic, ["monitor", str(path)])
    assert shown.exit_code == 1
    assert "line 2 is not" in shown.output


def test_monitoring_a_port_that_is_not_there_is_one_sentence(tmp_path: Path) -> None:
    shown = CliRunner().invoke(pic, ["monitor", str(tmp_path / "none")])
    assert shown.exit_code == 1
    assert "there is no such port" in shown.output


def test_flash_help_names_the_file_to_program() -> None:
    shown = CliRunner().invoke(pic, ["flash-help"])
    assert shown.exit_code == 0
    assert "drive.hex" in shown.output

"""The firmware as built: what is committed is what the source gives, it fits, and a hung loop is reset."""

from __future__ import annotations

import re
import shutil
from collections.abc import Callable
from pathlib import Path

import pytest

from chairward_drive_pic_serial import firmware, gpsim, wire
from chairward_drive_pic_serial.gpsim import Gpsim
from chairward_drive_pic_serial.wire import Ask, Hello, Reason, State

pytestmark = pytest.mark.needs_gpsim


@pytest.fixture
def built(tmp_path: Path) -> firmware.Built:
    if not shutil.which("gpasm"):
        pytest.skip("needs gpasm: sudo apt-get install gputils")
    return firmware.assemble(tmp_path)


def test_the_committed_hex_is_what_the_source_assembles_to(built: firmware.Built) -> None:
    assert firmware.PREBUILT.read_bytes() == built.hex.read_bytes()


def test_the_firmware_stays_below_two_thousand_words(built: firmware.Built) -> None:
    assert 0 < built.words < 2000


def test_gpsim_reads_state_and_fault_where_the_listing_puts_them(built: firmware.Built) -> None:
    listing = (built.hex.parent / "drive.lst").read_text(encoding="latin-1")
    symbols = dict(re.findall(r"^(state|fault)\s+([0-9A-F]{8})", listing, re.MULTILINE))
    assert {name: int(value, 16) for name, value in symbols.items()} == {"state": gpsim.STATE, "fault": gpsim.FAULT}


def test_a_source_that_gpasm_refuses_is_an_error_with_its_words(
    built: firmware.Built, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "other").mkdir()
    wrong = tmp_path / "other" / "wrong.asm"
    wrong.write_text(" nonsense\n")
    monkeypatch.setattr(firmware, "SOURCE", wrong)
    with pytest.raises(firmware.FirmwareError, match=r"gpasm refuses .*wrong\.asm"):
        firmware.assemble(built.hex.parent)


def test_without_gputils_the_error_says_what_to_install(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("PATH", str(tmp_path))
    with pytest.raises(firmware.FirmwareError, match="apt-get install gputils"):
        firmware.assemble(tmp_path)
    with pytest.raises(firmware.FirmwareError, match="apt-get install gpsim gputils"):
        Gpsim()


def _drive(pic: Gpsim) -> None:
    pic.advance(20_000)
    pic.feed(wire.ask(Ask.HELLO, 1, 1, 1) + wire.ask(Ask.DRIVE, 2, 0, 0) + wire.ask(Ask.DRIVE, 3, 60, 80))
    pic.advance(120_000)
    assert pic.pins().armed
    assert pic.pins().drive_duty == pytest.approx(0.8)


def test_a_hung_firmware_is_reset_by_its_watchdog_and_stays_off(new_gpsim: Callable[..., Gpsim]) -> None:
    pic = new_gpsim("HANGTEST")
    _drive(pic)
    pic.take()
    pic.feed(wire.encode(bytes([0x7E, 9])))
    pic.advance(50_000)
    assert pic.pins().drive_duty == pytest.approx(0.8)  # it does hang, with the motor on
    off_after_us = 50_000
    while pic.pins().armed and off_after_us < 300_000:
        pic.advance(5_000)
        off_after_us += 5_000
    assert off_after_us < 300_000
    pins = pic.pins()
    assert (pins.drive_in1, pins.drive_in2, pins.steer_in1, pins.steer_in2, pins.brake) == (0, 0, 0, 0, 1)
    pic.advance(20_000)
    hellos = [wire.answer(payload) for payload in wire.Splitter().feed(pic.take())]
    assert any(isinstance(h, Hello) and h.reason == Reason.WATCHDOG and h.state == State.BOOT for h in hellos)
    pic.feed(wire.ask(Ask.DRIVE, 10, 0, 50))
    pic.advance(20_000)
    assert pic.registers()[0] == State.BOOT
    assert not pic.pins().drive_in1


def test_each_boot_has_another_nonce(new_gpsim: Callable[..., Gpsim]) -> None:
    pic = new_gpsim()
    nonces = []
    for _ in range(4):
        pic.advance(20_000)
        for payload in wire.Splitter().feed(pic.take()):
            answer = wire.answer(payload)
            if isinstance(answer, Hello):
                nonces.append(answer.nonce)
        pic.restart()
    assert len(nonces) == 4
    assert len(set(nonces)) == 4


def test_no_bridge_input_is_ever_set_during_a_reset(new_gpsim: Callable[..., Gpsim]) -> None:
    pic = new_gpsim()
    _drive(pic)
    pic.restart()
    pic.advance(2)  # ten instructions: ports are cleared before anything else
    for _ in range(60):
        pins = pic.pins()
        assert (pins.drive_in1, pins.drive_in2, pins.steer_in1, pins.steer_in2, pins.brake) == (0, 0, 0, 0, 1)
        pic.advance(20)

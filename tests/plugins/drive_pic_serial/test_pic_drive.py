"""The host's side: what it says when, how it takes answers, and what it tells people."""

from __future__ import annotations

import math
import os
import select
import termios
from collections.abc import Iterator
from itertools import pairwise
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from chairward.components import STILL, DriveError, Motion
from chairward_drive_pic_serial import port as port_module
from chairward_drive_pic_serial import wire
from chairward_drive_pic_serial.drive import PicSerialDrive
from chairward_drive_pic_serial.engine import ModelEngine
from chairward_drive_pic_serial.rig import PicRig
from chairward_drive_pic_serial.settings import PicSerialSettings
from chairward_drive_pic_serial.wire import Ask


class Recorder:
    """Keeps every frame that comes out of the pty, and passes it on."""

    def __init__(self) -> None:
        self.frames: list[bytes] = []
        self.deaf = False
        self._splitter = wire.Splitter()

    def __call__(self, data: bytes) -> bytes:
        self.frames += self._splitter.feed(data)
        return b"" if self.deaf else data

    def kinds(self) -> list[int]:
        return [frame[0] for frame in self.frames]


@pytest.fixture
def tap() -> Recorder:
    return Recorder()


@pytest.fixture
def rig(tmp_path: Path, tap: Recorder) -> Iterator[PicRig]:
    rig = PicRig(ModelEngine(), tmp_path, tap=tap)
    yield rig
    rig.close()


def test_the_way_to_motion_is_hello_brake_neutral_drive(rig: PicRig, tap: Recorder) -> None:
    rig.go()
    kinds = [kind for i, kind in enumerate(tap.kinds()) if i == 0 or kind != tap.kinds()[i - 1]]
    assert kinds == [Ask.HELLO, Ask.BRAKE, Ask.DRIVE]
    first_drive = next(frame for frame in tap.frames if frame[0] == Ask.DRIVE)
    assert first_drive[2:] == bytes([0, 0])


def test_a_change_goes_out_at_once_and_not_at_the_next_tick(rig: PicRig, tap: Recorder) -> None:
    rig.go()
    rig.run(0.008)
    rig.poll()
    before = len(tap.frames)
    rig.drive.command(rig.now_ns(), STILL)
    rig.run(0.001)
    assert [frame[2:] for frame in tap.frames[before:]] == [bytes([0, 0])]


def test_without_answers_only_neutral_goes_out_after_sixty_milliseconds(rig: PicRig, tap: Recorder) -> None:
    rig.go()
    tap.deaf = True
    before, start_ns, late = len(tap.frames), rig.now_ns(), 0
    for _ in range(9):
        seen = len(tap.frames)
        rig.attempt(lambda: rig.drive.command(rig.now_ns(), rig.half))
        rig.run(0.001)
        if rig.now_ns() - start_ns > 62_000_000:
            late += sum(any(frame[2:]) for frame in tap.frames[seen:] if frame[0] == Ask.DRIVE)
        rig.run(0.019)
        rig.poll()
    assert late == 0
    moving = [frame for frame in tap.frames[before:] if frame[0] == Ask.DRIVE and any(frame[2:])]
    assert len(moving) <= 2
    assert [frame[2:] for frame in tap.frames if frame[0] == Ask.DRIVE][-1] == bytes([0, 0])


def test_a_guard_that_was_silent_must_arm_again_even_if_the_firmware_did_not_notice(rig: PicRig) -> None:
    rig.go()
    rig.run(0.16)
    status = rig.ticks(0.1, rig.half)
    assert (status.linked, status.armed) == (True, False)
    assert rig.braked()


def test_the_drivers_buffer_is_emptied_when_answers_are_overdue(rig: PicRig, monkeypatch: pytest.MonkeyPatch) -> None:
    """What a real UART's driver holds is dropped by that call; a pty passes everything on at once."""
    rig.go()
    flushed: list[tuple[int, int]] = []
    real = termios.tcflush

    def spy(fd: int, queue: int) -> None:
        flushed.append((fd, queue))
        real(fd, queue)

    monkeypatch.setattr(port_module.termios, "tcflush", spy)
    fd = rig.drive.fileno()
    rig.freeze()
    rig.ticks(0.05, rig.half)
    assert flushed == []
    rig.ticks(0.05, rig.half)
    assert flushed == [(fd, termios.TCOFLUSH)]


def test_a_hard_stop_goes_out_at_once_even_when_answers_are_overdue(rig: PicRig, tap: Recorder) -> None:
    rig.go()
    tap.deaf = True
    rig.ticks(0.08, rig.half)
    before = len(tap.frames)
    rig.drive.command(rig.now_ns(), STILL, hard_stop=True)
    rig.run(0.001)
    assert [frame[0] for frame in tap.frames[before:]] == [Ask.BRAKE]


def test_the_link_is_lost_two_hundred_milliseconds_after_the_last_answer(rig: PicRig) -> None:
    rig.go()
    rig.freeze()
    start_ns = rig.now_ns()
    while rig.tick(rig.half).linked:
        assert rig.now_ns() - start_ns < 400_000_000
    assert 180_000_000 <= rig.now_ns() - start_ns <= 240_000_000
    assert "has not answered for 200 ms" in rig.errors[-1]


def test_a_controller_that_hears_nothing_but_still_speaks_says_that_it_has_stopped(rig: PicRig, tap: Recorder) -> None:
    rig.go()
    tap.deaf = True
    rig.ticks(0.22, rig.half)
    assert any("heard no command for 195 ms" in sentence for sentence in rig.errors)
    assert rig.braked()


def test_a_single_lost_frame_costs_nothing(rig: PicRig, tap: Recorder) -> None:
    rig.go()
    tap.deaf = True
    rig.tick(rig.half)
    tap.deaf = False
    status = rig.ticks(0.2, rig.half)
    assert (status.linked, status.armed) == (True, True)
    assert rig.wheels().drive_mm_s == pytest.approx(rig.half.drive_mm_s)
    assert not rig.errors


def test_noise_between_the_frames_costs_nothing(rig: PicRig) -> None:
    rig.go()
    for _ in range(20):
        rig.engine.feed(b"\x11\x22\x33")
        assert rig.tick(rig.half).armed
    assert not rig.errors


def test_reopening_backs_off_up_to_a_second(tmp_path: Path) -> None:
    drive = PicSerialDrive(PicSerialSettings(port=str(tmp_path / "none")))
    said, tries, now_ns = set(), [], 1_000_000_000
    for _ in range(6000):
        try:
            drive.connect(now_ns)
        except DriveError as error:
            said.add(str(error))
            tries.append(now_ns)
        now_ns += 1_000_000
    assert len(said) == 1
    assert "there is no such port" in said.pop()
    gaps = [(b - a) / 1e6 for a, b in pairwise(tries)]
    assert gaps[:6] == [20, 40, 80, 160, 320, 640]
    assert max(gaps) == 1000


def test_a_latch_is_lifted_only_with_the_nonce_of_this_boot(rig: PicRig, tap: Recorder) -> None:
    rig.go()
    rig.drive.disarm(rig.now_ns())
    rig.ticks(0.1)
    assert rig.engine.registers()[0] == wire.State.ESTOP
    rig.engine.feed(wire.ask(Ask.CLEAR, 250, 0x77, 0x77))
    rig.ticks(0.1)
    assert rig.engine.registers()[0] == wire.State.ESTOP
    rig.arm()
    clears = [frame for frame in tap.frames if frame[0] == Ask.CLEAR]
    assert isinstance(rig.engine, ModelEngine)
    assert clears
    assert all(frame[2:] == rig.engine.nonce.to_bytes(2, "big") for frame in clears)


def test_a_restart_is_told_with_its_reason(rig: PicRig) -> None:
    rig.go()
    assert isinstance(rig.engine, ModelEngine)
    rig.engine.reset(wire.Reason.BROWN_OUT)
    rig.ticks(0.1, rig.half)
    assert any("restarted by itself (reason: brown out)" in sentence for sentence in rig.errors)


@pytest.mark.parametrize(
    "error", [OSError(5, "Input/output error"), OSError(19, "No such device"), OSError(9, "Bad file descriptor")]
)
@pytest.mark.parametrize("where", ["read", "write"])
def test_every_form_of_an_unplugged_port_is_one_sentence_with_its_name(
    rig: PicRig, monkeypatch: pytest.MonkeyPatch, error: OSError, where: str
) -> None:
    rig.go()
    fd = rig.drive.fileno()
    real = getattr(os, where)

    def gone(which: int, what: object) -> object:
        if which == fd:
            raise error
        return real(which, what)

    monkeypatch.setattr(port_module.os, where, gone)
    rig.errors.clear()
    rig.tick(rig.half)
    monkeypatch.undo()
    assert rig.errors
    assert rig.errors[0].startswith(f"{rig.port}: the port is gone")


def test_a_terminal_error_of_a_lost_port_is_taken_like_the_others(
    rig: PicRig, tap: Recorder, monkeypatch: pytest.MonkeyPatch
) -> None:
    rig.go()
    tap.deaf = True

    def gone(fd: int, queue: int) -> None:
        raise termios.error(5, "Input/output error")

    monkeypatch.setattr(port_module.termios, "tcflush", gone)
    rig.errors.clear()
    rig.ticks(0.1, rig.half)
    assert rig.errors[0].startswith(f"{rig.port}: the port is gone")


def test_a_full_wire_drops_frames_and_counts_them_instead_of_waiting(rig: PicRig) -> None:
    rig.connect()
    drive = rig.drive
    assert isinstance(drive, PicSerialDrive)
    assert drive._port is not None
    while select.select([], [drive._port.fd], [], 0.3)[1]:  # the kernel moves bytes on a little later than they come
        for size in (1000, 1):
            while drive._port.write(b"x" * size):
                pass
    dropped = drive._port.dropped
    drive.command(rig.now_ns(), STILL)
    assert drive._port.dropped == dropped + 1


SETTINGS = PicSerialSettings(port="/dev/test", full_speed_mm_s=700.0, full_turn_deg_s=60.0)


@given(st.floats(-700, 700), st.floats(-60, 60))
def test_hundredths_are_never_faster_than_asked(drive_mm_s: float, turn_deg_s: float) -> None:
    steer, drive = SETTINGS.hundredths(Motion(drive_mm_s, turn_deg_s))
    back = SETTINGS.motion(steer, drive)
    for got, asked, full in zip(back, (drive_mm_s, turn_deg_s), (700.0, 60.0), strict=True):
        assert abs(got) <= abs(asked) + full * 1e-6
        assert abs(got - asked) < full / 100 + 1e-6
        assert got * asked >= 0


@given(st.integers(-100, 100), st.integers(-100, 100))
def test_hundredths_come_back_exactly(steer: int, drive: int) -> None:
    assert SETTINGS.hundredths(SETTINGS.motion(steer, drive)) == (steer, drive)


@given(st.sampled_from([math.nan, math.inf, -math.inf, 700.1, -1e9]))
def test_what_is_not_a_speed_of_this_drive_is_refused_with_its_range(bad: float) -> None:
    with pytest.raises(DriveError, match=r"/dev/test: drive_mm_s = .* takes -700 to 700 mm/s"):
        SETTINGS.hundredths(Motion(bad, 0.0))


@pytest.mark.parametrize(("sign", "turn"), [(1, 1), (-1, 1), (1, -1), (-1, -1)])
def test_signs_turn_both_commands_and_reports_round(sign: int, turn: int) -> None:
    settings = PicSerialSettings.model_validate({"drive_sign": sign, "turn_sign": turn})
    assert settings.hundredths(Motion(250.0, 22.5)) == (50 * turn, 50 * sign)
    assert settings.motion(50 * turn, 50 * sign) == Motion(250.0, 22.5)


@given(st.floats(50, 5000), st.floats(100, 20000), st.floats(50, 3000))
def test_the_firmware_never_speeds_up_faster_nor_brakes_slower_than_set(
    accel: float, decel: float, full: float
) -> None:
    settings = PicSerialSettings(full_speed_mm_s=full, accel_mm_s2=accel, decel_mm_s2=decel)
    rise_ms, fall_ms = settings.rates_ms()
    assert 1 <= fall_ms <= 50
    assert 1 <= rise_ms <= 50
    if rise_ms < 50:
        assert full / 100 / (rise_ms / 1000) <= accel * 1.001
    if fall_ms > 1:
        assert full / 100 / (fall_ms / 1000) >= decel * 0.999


def test_a_battery_without_a_divider_is_unknown() -> None:
    settings = PicSerialSettings(battery_full_v=0.0)
    assert settings.battery(200) is None

"""Takeover `emulate`: says again what this chair's own joystick module said, and nothing while a real one is there."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import can
import pytest

from chairward.components import DriveError, Motion
from chairward_drive_can import rnet
from chairward_drive_can.frames import Frame
from chairward_drive_can.make import make
from chairward_drive_can.partners.body import Body
from chairward_drive_can.partners.rnet import SERIAL, RnetChair
from chairward_drive_can.partners.rnet_startup import PowerModule, conversation
from chairward_drive_can.settings import CanSettings
from chairward_drive_can.startup import steps
from chairward_drive_can.takeover import MODES


def record(path: Path, frames: list[Frame]) -> None:
    with can.Logger(path) as writer:
        for number, frame in enumerate(frames):
            writer(
                can.Message(
                    timestamp=1000.0 + number / 1000,
                    arbitration_id=frame.id,
                    data=frame.data,
                    is_extended_id=frame.extended,
                    is_remote_frame=frame.remote,
                )
            )


def seen_at_power_on(challenge: int) -> list[Frame]:
    """What a recording holds: the exchange among periodic frames, then joystick frames."""
    mixed: list[Frame] = []
    for frame in conversation(SERIAL, challenge):
        mixed += [frame, Frame(0x00E, SERIAL), Frame(0x0C140000, b"\xc0", True)]
    return [*mixed, *[rnet.joystick(1, 0, 0)] * 5]


@pytest.fixture
def emulate_settings(rnet_settings: CanSettings, tmp_path: Path) -> CanSettings:
    record(tmp_path / "startup.log", seen_at_power_on(challenge=7))
    changes = {
        "takeover": "emulate",
        "hazard_accepted": MODES["emulate"].accept,
        "serial": SERIAL.hex(),
        "startup": str(tmp_path / "startup.log"),
    }
    mine = rnet_settings.rnet.model_copy(update=changes)
    return rnet_settings.model_copy(update={"rnet": mine, "watchdog_relay": "K1"})


@pytest.fixture
def emulate_rig(emulate_settings: CanSettings, rnet_rig_type: Any) -> Iterator[Callable[[Any], Any]]:
    made: list[Any] = []

    def build(chair: RnetChair) -> Any:
        class Rig(rnet_rig_type):  # type: ignore[misc]
            def new_partner(self) -> RnetChair:
                return chair

        made.append(Rig(emulate_settings))
        return made[-1]

    yield build
    for rig in made:
        rig.close()


def headless_chair(serial: bytes = SERIAL, challenge: int = 99) -> RnetChair:
    """A chair whose joystick module is unplugged; its challenges differ from those in the recording."""
    return RnetChair(joystick_module=False, power=PowerModule(serial, challenge), body=Body(0.8, 0.9))


def test_the_exchange_is_found_among_everything_else_in_a_recording() -> None:
    assert steps(seen_at_power_on(3)) == conversation(SERIAL, 3)


def test_it_starts_the_chair_up_and_drives_it(emulate_rig: Callable[[Any], Any]) -> None:
    rig = emulate_rig(headless_chair())
    assert rig.connect().linked
    assert rig.partner.power.running
    assert rig.partner.power.wrong == 0
    assert rig.go(Motion(250.0, 0.0)).drive_mm_s > 200


def test_a_joystick_module_never_falls_silent_while_the_guard_lives_and_does_when_it_does_not(
    emulate_rig: Callable[[Any], Any],
) -> None:
    rig = emulate_rig(headless_chair())
    rig.connect()
    before = len(rig.sent)
    rig.ticks(1.0)
    heard = [frame.id for _, frame in rig.sent[before:]]
    assert heard.count(0x02000100) == 100
    assert 18 <= heard.count(0x00E) <= 21
    assert 9 <= heard.count(0x03C30F0F) <= 11
    rig.run(0.05)
    before = len(rig.sent)
    rig.run(1.0)
    assert len(rig.sent) == before


def test_while_a_real_joystick_module_speaks_it_says_nothing(emulate_rig: Callable[[Any], Any]) -> None:
    rig = emulate_rig(RnetChair())
    for _ in range(20):
        rig.attempt(lambda: rig.drive.connect(rig.now_ns()))
        rig.ticks(0.1)
    assert rig.sent == []
    with pytest.raises(DriveError, match="a joystick module speaks on the bus"):
        rig.drive.arm(rig.now_ns())


def test_another_chairs_power_module_is_never_driven_and_told(emulate_rig: Callable[[Any], Any]) -> None:
    rig = emulate_rig(headless_chair(serial=bytes(8)))
    faults = set()
    for _ in range(30):
        rig.attempt(lambda: rig.drive.connect(rig.now_ns()))
        faults.add(rig.ticks(0.1).fault)
    assert rig.partner.power.wrong > 0
    assert not rig.poll().linked
    assert any("as in the recording of this chair's start-up" in fault for fault in faults)


def test_a_recording_without_the_exchange_is_refused_with_how_to_make_one(emulate_settings: CanSettings) -> None:
    record(Path(emulate_settings.rnet.startup), [rnet.joystick(1, 0, 0)])
    with pytest.raises(DriveError, match="has no serial number exchange: record while the chair is switched on"):
        make(emulate_settings)


def test_a_missing_recording_is_refused_by_key(emulate_settings: CanSettings) -> None:
    Path(emulate_settings.rnet.startup).unlink()
    with pytest.raises(DriveError, match=r"drive\.can\.rnet\.startup: .*startup\.log cannot be read"):
        make(emulate_settings)


def test_without_serial_and_recording_it_is_refused(rnet_settings: CanSettings) -> None:
    mine = rnet_settings.rnet.model_copy(update={"takeover": "emulate", "hazard_accepted": MODES["emulate"].accept})
    place = {"interface": "virtual", "channel": "nobody-else", "watchdog_relay": "K1"}
    drive = make(rnet_settings.model_copy(update={"rnet": mine, **place}))
    drive.connect(1)
    with pytest.raises(DriveError, match=r"needs drive\.can\.rnet\.serial and drive\.can\.rnet\.startup"):
        drive.arm(1)
    drive.close()

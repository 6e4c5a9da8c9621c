"""Interfaces, settings and the companion: every failure is one sentence; what is offered is what is promised."""

from __future__ import annotations

import os
import re
import subprocess
import sys
import threading
import time
from itertools import pairwise
from pathlib import Path
from typing import Any

import pytest
from pydantic import ValidationError

from chairward.components import Context, DriveError, Motion
from chairward.plugins import discover
from chairward.shared_state import PIN_NAMES, SharedState
from chairward_drive_can import plugin
from chairward_drive_can.bus import Claim, LibraryBus, open_bus
from chairward_drive_can.companion import SimCan
from chairward_drive_can.frames import Frame
from chairward_drive_can.make import make
from chairward_drive_can.partners.body import Body
from chairward_drive_can.partners.run import AdapterPty, publish, serve
from chairward_drive_can.scale import checked, ramped, signed
from chairward_drive_can.settings import CanSettings, SimCanSettings


def settings(**values: Any) -> CanSettings:
    return CanSettings.model_validate({"dialect": "rnet", **values})


@pytest.mark.parametrize(
    ("place", "sentence"),
    [
        ({"interface": "slcan", "channel": "/dev/none"}, r"slcan /dev/none cannot be opened: .*plugged in"),
        ({"interface": "slcan", "channel": "/dev/null", "bitrate": 33_333}, r"an slcan adapter knows no 33333 bit/s"),
        ({"interface": "magic", "channel": "x"}, r"magic x cannot be opened: .*drive\.can\.interface"),
    ],
)
def test_an_interface_that_cannot_be_opened_is_one_sentence_with_what_to_do(
    place: dict[str, Any], sentence: str
) -> None:
    with pytest.raises(DriveError, match=sentence) as caught:
        open_bus(settings(**place))
    assert "\n" not in str(caught.value)


def test_no_retry_comes_sooner_than_the_back_off_and_the_last_is_a_second(tmp_path: Path) -> None:
    drive = make(settings(interface="slcan", channel=str(tmp_path / "none")))
    tried = []
    for now_ms in range(0, 6000, 10):
        try:
            drive.connect(now_ms * 1_000_000 + 1)
        except DriveError:
            tried.append(now_ms)
    waits = [then - now for now, then in pairwise(tried)]
    assert waits == sorted(waits)
    assert (waits[0], waits[-1]) == (20, 1000)
    assert "cannot be opened" in drive.poll(7_000_000_000).fault
    drive.close()


def test_frames_go_both_ways_over_a_library_bus_with_their_kind() -> None:
    place = settings(interface="virtual", channel="both-ways")
    here, there = LibraryBus(place), LibraryBus(place)
    frames = [Frame(0x02000100, b"\x01\xff", True), Frame(0x7FF, bytes(8)), Frame(0x12, b"", False, True)]
    for frame in frames:
        here.send(frame)
    assert there.receive() == frames
    assert here.receive() == []
    here.close()
    here.close()
    there.close()


def test_a_lost_answer_is_made_up_for_by_the_next(tmp_path: Path) -> None:
    bus = LibraryBus(settings(interface="virtual", channel="echoes", options={"receive_own_messages": True}))
    bus._echoes = True
    for number in (1, 2, 3):
        bus.send(Frame(number))
    assert bus.unanswered == 3
    assert bus._bus.recv(timeout=0).arbitration_id == 1
    assert bus.receive() == []
    assert bus.unanswered == 0
    bus.close()


def test_a_flooded_bus_is_read_in_bounded_portions() -> None:
    place = settings(interface="virtual", channel="flooded")
    here, there = LibraryBus(place), LibraryBus(place)
    for number in range(200):
        here.send(Frame(number))
    assert len(there.receive()) == 64
    here.close()
    there.close()


def test_an_interface_that_blocks_when_sending_is_given_up() -> None:
    bus = LibraryBus(settings(interface="virtual", channel="slow"))

    def slow(message: object, timeout: float) -> None:
        time.sleep(0.006)

    bus._bus.send = slow
    for _ in range(4):
        bus.send(Frame(1))
    with pytest.raises(OSError, match="it blocks, so it cannot drive"):
        bus.send(Frame(1))
    bus.close()


def test_a_claim_is_free_again_once_its_owner_lets_go() -> None:
    first = Claim("virtual", "mine")
    with pytest.raises(DriveError, match="virtual mine: another program of Chairward already drives"):
        Claim("virtual", "mine")
    first.release()
    Claim("virtual", "mine").release()


# settings -----------------------------------------------------------------------------------------------------------
@pytest.mark.parametrize(
    ("values", "said"),
    [
        ({"dialect": "dbc"}, "needs dbc.file"),
        ({"silence_stop_ms": 100}, "belong together"),
        ({"stale_ms": 51}, "stale_ms"),
        ({"full_turn_deg_s": float("nan")}, "full_turn_deg_s"),
        ({"drive_sign": 0}, "drive_sign"),
        ({"rnet": {"takeover": "yes"}}, "takeover"),
        ({"rnet": {"serial": "12"}}, "serial"),
        ({"cia402": {"rpdo_timeout_ms": 300}}, "rpdo_timeout_ms"),
        ({"speed": 1}, "speed"),
    ],
)
def test_a_wrong_setting_is_refused_by_key(values: dict[str, Any], said: str) -> None:
    with pytest.raises(ValidationError, match=re.escape(said)):
        CanSettings.model_validate({"dialect": "rnet", **values})


def test_a_measured_stop_on_silence_or_a_relay_proves_the_drive_and_nothing_else_does() -> None:
    measured = {"silence_stop_measured": "2026-11-22"}
    assert settings().silence_unproved()
    assert settings(silence_stop_ms=251, **measured).silence_unproved()
    assert not settings(silence_stop_ms=250, **measured).silence_unproved()
    assert not settings(watchdog_relay="K1").silence_unproved()


# scale --------------------------------------------------------------------------------------------------------------
def test_each_way_has_its_own_full_deflection() -> None:
    mine = settings(full_forward_mm_s=500, full_backward_mm_s=300)
    assert checked(Motion(500.0, 0.0), mine) == Motion(500.0, 0.0)
    with pytest.raises(DriveError, match=r"400 mm/s backward was asked, but full deflection is 300"):
        checked(Motion(-400.0, 0.0), mine)


def test_the_signs_of_the_chair_file_turn_each_axis_round() -> None:
    assert signed(Motion(100.0, 10.0), settings(drive_sign=-1)) == Motion(-100.0, 10.0)
    assert signed(Motion(100.0, 10.0), settings(turn_sign=-1)) == Motion(100.0, -10.0)


def test_speed_rises_and_falls_at_its_rates_and_starts_at_half_of_them() -> None:
    made = settings(accel_mm_s2=500, decel_mm_s2=1000, turn_accel_deg_s2=30)
    assert ramped(Motion(0.0, 0.0), Motion(300.0, 5.0), made, 0.1) == Motion(25.0, 1.5)
    assert ramped(Motion(100.0, 10.0), Motion(300.0, 20.0), made, 0.1) == Motion(150.0, 13.0)
    assert ramped(Motion(300.0, 5.0), Motion(0.0, 0.0), made, 0.1) == Motion(200.0, 0.0)


def test_a_ramp_of_0_leaves_the_ramp_to_the_controller() -> None:
    made = settings(accel_mm_s2=0, turn_accel_deg_s2=0)
    assert ramped(Motion(0.0, 0.0), Motion(300.0, 5.0), made, 0.1) == Motion(300.0, 5.0)


# what is offered ----------------------------------------------------------------------------------------------------
def test_the_plugin_offers_a_drive_and_a_companion() -> None:
    registry = discover(points=[], extra={"drive_can": plugin})
    assert not registry.refused
    assert registry.get("drive", "can").settings is CanSettings
    assert registry.get("companion", "sim_can").settings is SimCanSettings


def test_registering_imports_no_can_library() -> None:
    code = "import sys, chairward_drive_can.plugin; print(*{'can', 'cantools', 'canopen', 'serial'} & set(sys.modules))"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.split() == []


def test_every_setting_is_described() -> None:
    def described(schema: dict[str, Any]) -> bool:
        return all("description" in field or "$ref" in field for field in schema.get("properties", {}).values())

    schema = CanSettings.model_json_schema()
    assert all(described(part) for part in [schema, *schema["$defs"].values()])


@pytest.mark.parametrize("dialect", ["rnet", "cia402"])
def test_the_companion_makes_its_port_says_ready_and_publishes_its_pins(tmp_path: Path, dialect: str) -> None:
    mine = SimCanSettings(dialect=dialect, channel=str(tmp_path / "can"), startup_ms=0)
    companion = SimCan(mine, Context(lane="sim", run_dir=tmp_path, chair_dir=tmp_path))
    ready, stop = threading.Event(), threading.Event()
    thread = threading.Thread(target=companion.run, args=(ready.set, stop.is_set))
    thread.start()
    try:
        assert ready.wait(10)
        assert os.path.lexists(tmp_path / "can")
        pins = SharedState.attach(tmp_path / "pins")
        deadline = time.monotonic() + 10
        while pins.read()["time_ns"] == 0:
            assert time.monotonic() < deadline
        assert pins.read()["brake"] == 1.0
        pins.close()
    finally:
        stop.set()
        thread.join()
    assert not os.path.lexists(tmp_path / "can")


def test_pins_say_which_way_each_motor_turns(tmp_path: Path) -> None:
    pins = SharedState.create(tmp_path / "pins", PIN_NAMES)
    body = Body()
    body.drive.value, body.steer.value = -0.5, 0.25
    publish(pins, body, 7)
    values = pins.read()
    assert (values["drive_in1"], values["drive_in2"], values["drive_duty"]) == (0, 1, 0.5)
    assert (values["steer_in1"], values["steer_in2"], values["steer_duty"]) == (1, 0, 0.25)
    assert (values["brake"], values["time_ns"]) == (0, 7)
    pins.close()


def test_an_adapter_whose_host_does_not_read_goes_on(tmp_path: Path) -> None:
    from chairward_drive_can.partners.rnet import RnetChair

    end = AdapterPty(tmp_path / "can")
    port = open_bus(settings(interface="slcan", channel=str(tmp_path / "can")))
    deadline = time.monotonic() + 1.0
    serve(RnetChair(), end, lambda: time.monotonic() > deadline)
    for _ in range(2000):
        end.send(Frame(0x02000100, b"\0\0", True))
    port.close()
    end.close()

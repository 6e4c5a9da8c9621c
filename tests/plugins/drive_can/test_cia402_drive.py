"""CiA 402: what is configured so that silence stops, set-up that never waits, two wheels that only go together."""

from __future__ import annotations

import time

import canopen
import pytest
from canopen.objectdictionary import ObjectDictionary, ODRecord, ODVariable, datatypes

from chairward.components import DriveError, Motion
from chairward_drive_can.cia402 import next_control_word, state_of
from chairward_drive_can.make import make
from chairward_drive_can.partners.cia402 import DEFAULTS, Cia402Chair, MotorNode
from chairward_drive_can.settings import CanSettings

S = 1_000_000_000


def nodes(rig: object) -> tuple[MotorNode, MotorNode]:
    chair = rig.partner  # type: ignore[attr-defined]
    assert isinstance(chair, Cia402Chair)
    return chair.left, chair.right


def test_every_guard_against_silence_is_configured_before_the_link_is_told(cia402_rig) -> None:  # type: ignore[no-untyped-def]
    cia402_rig.connect()
    for node in nodes(cia402_rig):
        assert node.value(0x1400, 5) == 100, "RPDO time-out"
        assert node.value(0x1016, 1) == 127 << 16 | 150, "consumer heartbeat: three of ours missed"
        assert node.value(0x6007) == 3, "abort connection: quick stop"
        assert node.value(0x605A) == 2, "quick stop: on its ramp, then off"
        assert node.value(0x6060) == 3, "profile velocity"
        assert (node.value(0x1600, 1), node.value(0x1600, 2)) == (0x60400010, 0x60FF0020)
        assert node.value(0x6085) == 1500


def test_set_up_takes_one_answer_at_a_time_and_no_call_waits_for_it(cia402_rig) -> None:  # type: ignore[no-untyped-def]
    rig = cia402_rig
    rig.freeze()
    rig.drive.connect(rig.now_ns())
    for _ in range(20):
        rig.drive.poll(rig.now_ns())
        rig.clock_ns += 1_000_000
    rig.thaw()
    rig.run(0.001)
    asked = [frame for _, frame in rig.sent if frame.id & 0x780 == 0x600]
    assert len(asked) == 2, "one request to each node until it answers"


def test_a_node_that_refuses_a_guard_against_silence_is_never_driven(cia402_rig) -> None:  # type: ignore[no-untyped-def]
    rig = cia402_rig
    del nodes(rig)[1].objects[0x1400, 5]
    for _ in range(20):
        rig.attempt(lambda: rig.drive.connect(rig.now_ns()))
        status = rig.ticks(0.1)
    assert not status.linked
    assert "node 2 refuses 0x1400:05 (RPDO time-out): no such object (abort 0x06020000)" in status.fault
    with pytest.raises(DriveError, match="node 2 refuses"):
        rig.drive.arm(rig.now_ns())


def test_a_missing_node_is_named_with_its_wheel(cia402_rig) -> None:  # type: ignore[no-untyped-def]
    rig = cia402_rig
    nodes(rig)[0].id = 9
    for _ in range(20):
        rig.attempt(lambda: rig.drive.connect(rig.now_ns()))
        status = rig.ticks(0.1)
    assert not status.linked
    assert "node 1 (left wheel) does not answer" in status.fault


def test_a_wheel_that_falls_silent_is_named(cia402_rig) -> None:  # type: ignore[no-untyped-def]
    rig = cia402_rig
    rig.go()
    nodes(rig)[1].nmt = 0x04  # stopped: no PDO any more
    status = rig.ticks(0.2, rig.half)
    assert not status.linked
    assert "node 2 (right wheel)" in status.fault


@pytest.mark.parametrize("side", [0, 1])
def test_one_wheel_in_fault_stops_both(cia402_rig, side: int) -> None:  # type: ignore[no-untyped-def]
    rig = cia402_rig
    rig.go()
    rig.end.send(nodes(rig)[side].fail(0x2310))
    status = rig.ticks(0.5, rig.half)
    assert not status.armed
    assert "emergency 0x2310" in status.fault or "is in fault" in status.fault or "left operation" in status.fault
    assert (nodes(rig)[0].speed, nodes(rig)[1].speed) == (0.0, 0.0)


def test_arming_again_resets_the_fault_and_drives(cia402_rig) -> None:  # type: ignore[no-untyped-def]
    rig = cia402_rig
    rig.go()
    rig.end.send(nodes(rig)[0].fail(0x2310))
    rig.ticks(0.5)
    assert rig.go().drive_mm_s > 0


def test_both_time_outs_stop_a_node_by_itself(cia402_rig) -> None:  # type: ignore[no-untyped-def]
    rig = cia402_rig
    rig.go()
    rig.run(0.12)
    assert all(node.timeouts == 1 for node in nodes(rig))


def test_once_set_up_no_sdo_is_sent_again_whatever_happens(cia402_rig) -> None:  # type: ignore[no-untyped-def]
    rig = cia402_rig
    rig.connect()
    assert any(0x600 < frame.id < 0x680 for _, frame in rig.sent)
    before = len(rig.sent)
    rig.go()
    rig.ticks(0.3, rig.half, hard_stop=True)
    rig.run(0.5)
    rig.ticks(0.3)
    rig.drive.disarm(rig.now_ns())
    rig.ticks(0.3)
    rig.go()
    assert not [frame for _, frame in rig.sent[before:] if 0x580 < frame.id < 0x680]


def test_a_left_turn_turns_the_right_wheel_forward_and_the_left_backward(cia402_rig) -> None:  # type: ignore[no-untyped-def]
    rig = cia402_rig
    rig.go(Motion(0.0, 20.0))
    left, right = nodes(rig)
    assert left.speed < 0.0
    assert right.speed * -1 > 0.0
    assert rig.tick(Motion(0.0, 20.0)).turn_deg_s == pytest.approx(20.0, abs=0.3)


def test_silence_of_the_guard_silences_the_heartbeat_too(cia402_rig) -> None:  # type: ignore[no-untyped-def]
    rig = cia402_rig
    rig.go()
    rig.run(0.05)
    before = len(rig.sent)
    end = rig.now_ns() + S
    while rig.now_ns() < end:
        rig.drive.poll(rig.now_ns())
        rig.run(0.01)
    assert len(rig.sent) == before


@pytest.mark.parametrize(
    ("word", "state"),
    [
        (0x0000, "not ready"),
        (0x0240, "switch on disabled"),
        (0x0221, "ready to switch on"),
        (0x0233, "switched on"),
        (0x0637, "operation enabled"),
        (0x0217, "quick stop active"),
        (0x021F, "fault"),
        (0x0218, "fault"),
    ],
)
def test_status_words_are_read_as_the_standard_has_them(word: int, state: str) -> None:
    assert state_of(word) == state


def test_no_state_but_switched_on_leads_to_enable() -> None:
    states = ["not ready", "switch on disabled", "ready to switch on", "switched on", "quick stop active", "fault"]
    assert [state for state in states if next_control_word(state) == 0x0F] == ["switched on"]


def test_two_nodes_on_one_side_are_refused_by_the_settings() -> None:
    same = {"nodes": [{"id": 1, "side": "left"}, {"id": 2, "side": "left"}]}
    with pytest.raises(ValueError, match="one node for the left wheel and one for the right"):
        CanSettings.model_validate({"dialect": "cia402", "cia402": same})


def test_the_guard_ticks_at_the_period_of_the_chair_file() -> None:
    settings = CanSettings.model_validate({"dialect": "cia402", "cia402": {"period_ms": 10}})
    assert make(settings).period_ns == 10_000_000


def dictionary() -> ObjectDictionary:
    """What a controller of another make would have: the objects of our set-up, as the canopen package keeps them."""
    kinds = {1: datatypes.UNSIGNED8, 2: datatypes.UNSIGNED16, 4: datatypes.UNSIGNED32}
    made, parts = ObjectDictionary(), {index: sub for index, sub in DEFAULTS if sub}
    for (index, sub), (value, size) in DEFAULTS.items():
        variable = ODVariable(f"{index:04X}.{sub}", index, sub)
        variable.data_type, variable.access_type, variable.default = kinds[size], "rw", value
        if index not in parts:
            made.add_object(variable)
            continue
        if index not in made:
            made.add_object(ODRecord(f"{index:04X}", index))
        made[index].add_member(variable)
    return made


def test_a_node_of_the_canopen_package_understands_our_set_up(cia402_settings: CanSettings) -> None:
    place = {"interface": "virtual", "channel": "foreign-nodes"}
    network = canopen.Network()
    network.connect(**place)
    network.NOTIFIER_SHUTDOWN_TIMEOUT = 1.0
    foreign = [canopen.LocalNode(number, dictionary()) for number in (1, 2)]
    for node in foreign:
        network.add_node(node)
    drive = make(cia402_settings.model_copy(update=place))
    try:
        end = time.monotonic() + 60.0
        while any(node.nmt.state != "OPERATIONAL" for node in foreign):
            assert time.monotonic() < end, drive.poll(time.monotonic_ns()).fault
            drive.connect(time.monotonic_ns())
            drive.poll(time.monotonic_ns())
        for number, node in enumerate(foreign, start=1):
            assert node.sdo[0x1400][5].raw == 100
            assert node.sdo[0x1016][1].raw == 127 << 16 | 150
            assert node.sdo[0x1400][1].raw == 0x200 + number
            assert node.sdo[0x6007].raw == 3
            assert node.sdo[0x1A00][2].raw == 0x606C0020
    finally:
        drive.close()
        network.disconnect()

"""R-Net frames in words: one line for each kind of frame that is known."""

from __future__ import annotations

import pytest

from chairward_drive_can import rnet
from chairward_drive_can.describe import describe_canopen, describe_rnet
from chairward_drive_can.frames import Frame

KNOWN = [
    ("02000100#0064", "joystick 1: forward 100, right 0"),
    ("02000200#9C9C", "joystick 2: backward 100, left 100"),
    ("00E#08901C8A00000000", "joystick module alive, serial 08901c8a00000000"),
    ("03C30F0F#8787878787878787", "modules alive"),
    ("0C140000#C0", "power module 0 alive (0xC0)"),
    ("0A040100#32", "speed setting 50 %"),
    ("0C040100#", "horn on"),
    ("0C040101#", "horn off"),
    ("0C000401#", "light key: left"),
    ("0C000402#", "light key: right"),
    ("0C000403#", "light key: hazard"),
    ("0C000404#", "light key: flood"),
    ("0C000E00#9585", "lights: left, right, flood"),
    ("0C000E00#9500", "lights: none"),
    ("1C0C0000#64", "battery 100 %"),
    ("14300000#E802", "motor current 744 (raw)"),
    ("1C300104#0A00000014000000", "odometer left 10, right 20 (raw)"),
    ("0C000005#", "motors: standing"),
    ("0C000006#", "motors: slowing down"),
    ("0C180000#0101", "motors: output enabled"),
    ("051#00020000", "profile 2"),
    ("061#40010000", "mode suspended 1"),
    ("061#00010000", "mode 1"),
    ("1C200100#001E030000", "error 0x1E03: charging: the chair will not drive"),
    ("1C200100#2F01", "error 0x2F01: centre the joystick"),
    ("1C200100#0481000003", "error shown by module 1: 0481000003"),
    ("000#R", "sleep for all modules"),
    ("004#", "joystick module goes to sleep"),
    ("1C240300#", "module 3 powers down"),
    ("0C000000#", "network error: joystick modules stop"),
    ("00C#", "start-up: is anybody there"),
    ("7B3#R", "start-up: serial numbers"),
    ("1F00315A#R", "start-up: serial number asked"),
    ("1F01315A#", "start-up: serial number"),
    ("781#2081000001000000", "start-up: parameters"),
    ("12345678#00", ""),
    ("123#00", ""),
]

CANOPEN = [
    ("000#0105", "NMT start node 5"),
    ("000#8000", "NMT pre-operational all nodes"),
    ("705#05", "node 5 operational"),
    ("705#00", "node 5 boot-up"),
    ("085#3081000000000000", "node 5 emergency 0x8130"),
    ("185#27020A000000", "node 5 operation enabled, velocity 10"),
    ("205#0F00F6FFFFFF", "to node 5: enable, velocity -10"),
    ("605#2B00140564000000", "to node 5: SDO 0x1400:05 write 0x64"),
    ("585#6000140500000000", "node 5 SDO 0x1400:05 written"),
    ("585#8000140511000906", "node 5 SDO 0x1400:05 no such sub-index (abort 0x06090011)"),
    ("080#", "SYNC"),
]


def parsed(text: str) -> Frame:
    """A frame as `cansend` writes it."""
    name, _, data = text.partition("#")
    remote = data == "R"
    return Frame(int(name, 16), b"" if remote else bytes.fromhex(data), extended=len(name) == 8, remote=remote)


@pytest.mark.parametrize(("frame", "words"), KNOWN)
def test_an_rnet_frame_is_put_into_words(frame: str, words: str) -> None:
    assert str(parsed(frame)) == frame
    assert describe_rnet(parsed(frame)) == words


@pytest.mark.parametrize(("frame", "words"), CANOPEN)
def test_a_canopen_frame_is_put_into_words(frame: str, words: str) -> None:
    assert describe_canopen(parsed(frame)) == words


def test_a_joystick_frame_has_the_bytes_seen_on_real_chairs() -> None:
    assert str(rnet.joystick(1, -100, 100)) == "02000100#9C64"

"""Laws of the frames: what is encoded is decoded, nothing asks for more than was asked, noise never raises."""

from __future__ import annotations

import random
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from chairward.components import Motion
from chairward_drive_can import rnet, slcan
from chairward_drive_can.canopen_frames import Entry, sdo_answer, sdo_write
from chairward_drive_can.checksum import crc8_autosar, crc8_j1850, sum8, xor8
from chairward_drive_can.dbc import read
from chairward_drive_can.describe import describe_canopen, describe_dbc, describe_rnet
from chairward_drive_can.example import EXAMPLE_DBC
from chairward_drive_can.frames import Frame
from chairward_drive_can.make import make
from chairward_drive_can.scale import deflection, ramp
from chairward_drive_can.settings import CanSettings

FUZZ = 20_000
NOW = 1_000_000_000


@st.composite
def any_frame(draw: st.DrawFn) -> Frame:
    extended, remote = draw(st.booleans()), draw(st.booleans())
    identity = draw(st.integers(0, (1 << 29 if extended else 1 << 11) - 1))
    return Frame(identity, b"" if remote else draw(st.binary(max_size=8)), extended, remote)


def random_frames(seed: int, count: int = FUZZ) -> list[Frame]:
    """Frames of every kind, half of them with identities that the dialects know."""
    chance = random.Random(seed)
    known = [0x02000100, 0x0C140000, 0x0A040100, 0x1C0C0100, 0x0C000E00, 0x1C200100, 0x14300000, 0x1C300004, 0x0C180000]
    short = [0x000, 0x00C, 0x00E, 0x051, 0x061, 0x081, 0x181, 0x182, 0x201, 0x581, 0x582, 0x601, 0x701, 0x702, 512, 513]
    frames = []
    for _ in range(count):
        extended, remote = chance.random() < 0.5, chance.random() < 0.1
        if chance.random() < 0.5:
            identity = chance.choice(known if extended else short)
        else:
            identity = chance.randrange(1 << 29 if extended else 1 << 11)
        frames.append(Frame(identity, b"" if remote else chance.randbytes(chance.randrange(9)), extended, remote))
    return frames


@given(any_frame())
def test_an_slcan_line_gives_back_the_frame_it_was_made_of(frame: Frame) -> None:
    line = slcan.encode(frame)
    assert line.endswith(b"\r")
    assert len(line) <= 27
    assert slcan.decode(line[:-1]) == frame


@given(st.binary(max_size=80))
def test_noise_on_the_serial_line_is_no_frame_or_a_lawful_one_and_never_an_error(noise: bytes) -> None:
    for line in slcan.LineSplitter().feed(noise):
        frame = slcan.decode(line)
        assert frame is None or (len(frame.data) <= 8 and 0 <= frame.id < 1 << 29)


@given(st.lists(any_frame(), max_size=6), st.lists(st.integers(1, 9), min_size=1), st.binary(max_size=20))
def test_frames_survive_any_cutting_of_the_line_and_the_one_after_noise_is_found(
    frames: list[Frame], cuts: list[int], noise: bytes
) -> None:
    stream = noise + b"\r" + b"".join(map(slcan.encode, frames))
    splitter, found, at = slcan.LineSplitter(), [], 0
    while at < len(stream):
        size = cuts[at % len(cuts)]
        found += [slcan.decode(line) for line in splitter.feed(stream[at : at + size])]
        at += size
    assert [frame for frame in found if frame][-len(frames) :] == frames or not frames


@given(st.integers(0, 15), st.integers(-100, 100), st.integers(-100, 100))
def test_a_joystick_frame_says_what_it_was_asked_to(device: int, x: int, y: int) -> None:
    assert rnet.decode(rnet.joystick(device, x, y)) == rnet.Joystick(device, x, y)


@pytest.mark.parametrize(("x", "y"), [(101, 0), (0, -101), (-128, 0), (0, 127)])
def test_a_joystick_frame_beyond_full_deflection_is_refused(x: int, y: int) -> None:
    with pytest.raises(ValueError, match=r"-100\.\.100"):
        rnet.joystick(0, x, y)


@given(
    st.floats(-500, 500),
    st.floats(1, 500),
    st.floats(0, 0.3),
    st.integers(10, 1000),
)
def test_deflection_never_makes_the_chair_faster_than_asked(
    value: float, full: float, deadband: float, steps: int
) -> None:
    count = deflection(value, full, deadband, steps)
    assert abs(count) <= steps
    assert count * value >= 0
    reached = max(0.0, abs(count) / steps - deadband) / (1.0 - deadband) * full
    assert reached <= min(abs(value), full) + full * 1e-5


@given(st.floats(-1, 1), st.floats(-1, 1), st.floats(0.1, 9), st.floats(0.1, 9), st.floats(0.0001, 0.1))
def test_a_ramp_comes_nearer_never_overshoots_and_never_jumps_through_zero(
    now: float, wanted: float, rise: float, fall: float, dt_s: float
) -> None:
    then = ramp(now, wanted, rise, fall, dt_s)
    assert abs(then - wanted) <= abs(now - wanted) + 1e-12
    assert then * now >= 0.0
    assert abs(then - now) <= max(rise, fall) * dt_s + 1e-12


def test_the_checksums_have_their_catalogued_check_values() -> None:
    nine = b"123456789"
    assert (crc8_j1850(nine), crc8_autosar(nine)) == (0x4B, 0xDF)
    assert (sum8(nine), xor8(nine)) == (0xDD, 0x31)


@given(st.integers(0, 0xFFFF), st.integers(0, 255), st.sampled_from([1, 2, 4]), st.integers(0, 2**32 - 1))
def test_an_sdo_write_is_eight_bytes_that_say_index_sub_size_and_value(
    index: int, sub: int, size: int, value: int
) -> None:
    data = sdo_write(5, Entry(index, sub, size, value, "x")).data
    assert len(data) == 8
    assert (data[0] & 0xE3, 4 - (data[0] >> 2 & 3)) == (0x23, size)
    assert (data[1] | data[2] << 8, data[3]) == (index, sub)
    assert int.from_bytes(data[4 : 4 + size], "little") == value % (1 << 8 * size)


@given(st.binary(max_size=10))
def test_an_sdo_answer_of_any_bytes_is_read_or_ignored(data: bytes) -> None:
    answer = sdo_answer(data)
    assert answer is None or len(data) == 8


@pytest.mark.parametrize("describe", [describe_rnet, describe_canopen, None])
def test_no_decoder_raises_on_twenty_thousand_random_frames(describe: object) -> None:
    words = describe if callable(describe) else describe_dbc(read(EXAMPLE_DBC))
    said = [words(frame) for frame in random_frames(1)]
    assert all(isinstance(sentence, str) for sentence in said)
    assert any(said)


@pytest.mark.parametrize("which", ["rnet_settings", "dbc_settings", "cia402_settings"])
def test_no_dialect_raises_on_random_frames_nor_moves_unarmed(which: str, request: pytest.FixtureRequest) -> None:
    settings: CanSettings = request.getfixturevalue(which)
    dialect = make(settings, Path())._dialect
    go = Motion(200.0, 10.0)
    for number, frame in enumerate(random_frames(2)):
        now_ns = NOW + number * 100_000
        replies = [*dialect.hear(frame, now_ns, go), *dialect.command(now_ns, go, False), *dialect.setup(now_ns)]
        for reply in replies:
            if dialect.is_command(reply) and reply.id != 0x77F:
                assert _stands(reply), f"{frame} brought about {reply}"
        dialect.report(now_ns)


def _stands(frame: Frame) -> bool:
    if frame.id == 512:
        return frame.data[:4] == bytes(4) and frame.data[4] & 0xF != 1
    return frame.data[2:] == bytes(len(frame.data) - 2) if len(frame.data) == 6 else frame.data == b"\0\0"

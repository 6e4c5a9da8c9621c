"""R-Net: who may drive when, and that nothing stale ever gets on the bus."""

from __future__ import annotations

import random
from collections.abc import Callable
from itertools import pairwise
from typing import Any

import pytest

from chairward.components import STILL, DriveError, Motion
from chairward_drive_can import rnet
from chairward_drive_can.drive import CanDrive
from chairward_drive_can.frames import MS, Frame
from chairward_drive_can.rnet_dialect import RnetDialect
from chairward_drive_can.settings import CanSettings
from chairward_drive_can.takeover import MODES

GO = Motion(250.0, 0.0)


class WireBus:
    """Both directions as lists: what the drive sent with the true time it did, what it is to hear."""

    def __init__(self, clock: Callable[[], int]) -> None:
        self.clock = clock
        self.sent: list[tuple[int, Frame]] = []
        self.to_hear: list[Frame] = []
        self.unanswered = 0

    def fileno(self) -> int:
        return -1

    def send(self, frame: Frame) -> None:
        self.sent.append((self.clock(), frame))

    def receive(self) -> list[Frame]:
        heard, self.to_hear = self.to_hear, []
        return heard

    def close(self) -> None:
        pass


class Bench:
    """A drive, the wire, and the chair's own modules spoken by hand."""

    def __init__(self, rnet_settings: CanSettings, **changes: Any) -> None:
        mine = rnet_settings.rnet.model_copy(update=changes.pop("rnet", {}))
        self.settings = rnet_settings.model_copy(update={"interface": "virtual", "rnet": mine, **changes})
        self.now_ns = 5_000_000_000
        self.bus = WireBus(lambda: self.now_ns)
        self.drive = CanDrive(
            self.settings, lambda: RnetDialect(self.settings), opener=lambda _: self.bus, clock=lambda: self.now_ns
        )
        self.drive.connect(self.now_ns)

    def hear(self, *frames: Frame) -> Any:
        self.bus.to_hear += frames
        return self.drive.poll(self.now_ns)

    def rest(self, seconds: float, stick: tuple[int, int] | None = (0, 0), motion: Motion = STILL) -> None:
        """The chair lives for a while: joystick every 10 ms, motor current every 200, the guard's ticks."""
        for step in range(round(seconds * 100)):
            self.now_ns += 10 * MS
            if stick is not None:
                self.hear(rnet.joystick(1, *stick))
            if step % 20 == 0:
                self.hear(Frame(0x14300000, b"\0\0", True), Frame(0x0C140000, b"\xc0", True))
            self.drive.command(self.now_ns, motion)

    def joystick_frames(self) -> list[tuple[int, rnet.Joystick]]:
        events = [(at, rnet.decode(frame)) for at, frame in self.bus.sent]
        return [(at, event) for at, event in events if isinstance(event, rnet.Joystick)]

    def close(self) -> None:
        self.drive.close()


@pytest.fixture
def bench(rnet_settings: CanSettings, request: pytest.FixtureRequest) -> Any:
    made = Bench(rnet_settings)
    yield made
    made.close()


def armed(bench: Bench) -> Bench:
    bench.rest(0.5)
    bench.drive.arm(bench.now_ns)
    bench.rest(0.05)
    assert bench.drive.poll(bench.now_ns).armed
    return bench


def refusal(bench: Bench) -> str:
    with pytest.raises(DriveError) as caught:
        bench.drive.arm(bench.now_ns)
    assert not bench.drive.poll(bench.now_ns).armed
    return str(caught.value)


# listening ----------------------------------------------------------------------------------------------------------
def test_by_default_it_only_listens_whatever_is_asked(rnet_settings: CanSettings) -> None:
    bench = Bench(rnet_settings, rnet={"takeover": "listen", "hazard_accepted": ""})
    bench.rest(0.5)
    assert "'listen' never sends" in refusal(bench)
    bench.rest(0.5, motion=GO)
    bench.close()
    assert bench.bus.sent == []


def test_listen_is_the_default_takeover() -> None:
    assert CanSettings(dialect="rnet").rnet.takeover == "listen"


# refusals -----------------------------------------------------------------------------------------------------------
@pytest.mark.parametrize("mode", ["follow", "jsm_error", "emulate"])
def test_a_takeover_whose_hazard_was_not_accepted_word_for_word_is_refused_with_the_hazard(
    rnet_settings: CanSettings, mode: str
) -> None:
    bench = Bench(rnet_settings, rnet={"takeover": mode, "hazard_accepted": "yes"})
    bench.rest(0.5)
    sentence = refusal(bench)
    assert MODES[mode].hazard in sentence
    assert f"hazard_accepted = '{MODES[mode].accept}'" in sentence
    bench.close()


@pytest.mark.parametrize("mode", ["jsm_error", "emulate"])
def test_a_takeover_without_joystick_needs_a_relay_in_the_motor_supply(rnet_settings: CanSettings, mode: str) -> None:
    bench = Bench(rnet_settings, rnet={"takeover": mode, "hazard_accepted": MODES[mode].accept})
    bench.rest(0.5)
    assert "watchdog_relay names a relay" in refusal(bench)
    bench.close()


def test_an_unmeasured_stop_on_silence_is_refused(rnet_settings: CanSettings) -> None:
    bench = Bench(rnet_settings, silence_stop_ms=None, silence_stop_measured=None)
    bench.rest(0.5)
    assert "nobody has measured that this controller stops" in refusal(bench)
    bench.close()


def test_a_stop_on_silence_that_takes_too_long_is_refused_with_both_figures(rnet_settings: CanSettings) -> None:
    bench = Bench(rnet_settings, silence_stop_ms=251)
    bench.rest(0.5)
    assert "only 251 ms after the last command, at most 250 ms" in refusal(bench)
    bench.close()


def test_a_watchdog_relay_stands_in_for_the_measurement(rnet_settings: CanSettings) -> None:
    relay = {"silence_stop_ms": None, "silence_stop_measured": None, "watchdog_relay": "K1 in the motor supply"}
    bench = Bench(rnet_settings, **relay)
    armed(bench)
    bench.close()


def test_a_silent_power_module_is_refused(bench: Bench) -> None:
    for _ in range(50):
        bench.now_ns += 10 * MS
        bench.hear(rnet.joystick(1, 0, 0))
    assert "power module is silent" in refusal(bench)


def test_a_silent_joystick_is_refused(bench: Bench) -> None:
    bench.rest(0.5, stick=None)
    assert "no joystick frame of device 1" in refusal(bench)


def test_a_joystick_held_over_is_refused(bench: Bench) -> None:
    bench.rest(0.5, stick=(0, 20))
    assert "joystick is not centred" in refusal(bench)


def test_a_joystick_that_has_only_just_come_to_rest_is_refused(bench: Bench) -> None:
    bench.rest(0.5, stick=(0, 20))
    bench.rest(0.1)
    assert "rest centred for 300 ms" in refusal(bench)


def test_a_power_module_in_trouble_is_refused(bench: Bench) -> None:
    bench.rest(0.5)
    bench.hear(Frame(0x0C140000, b"\x01", True))
    assert "trouble (heartbeat 0x01)" in refusal(bench)


def test_a_shown_error_is_refused_in_words_until_the_chair_is_switched_on_again(bench: Bench) -> None:
    bench.rest(0.5)
    bench.hear(Frame(0x1C200100, b"\x00\x1e\x03\x00\x00", True))
    assert "charging" in refusal(bench)
    assert bench.drive.poll(bench.now_ns).charging
    bench.hear(Frame(0x7B0))
    armed(bench)


def test_arming_before_connecting_is_refused_with_the_port(rnet_settings: CanSettings) -> None:
    drive = CanDrive(rnet_settings, lambda: RnetDialect(rnet_settings))
    with pytest.raises(DriveError, match=rnet_settings.channel):
        drive.arm(1)


# the user's own hand ------------------------------------------------------------------------------------------------
@pytest.mark.parametrize("stick", [b"\x00\x01", b"\x00\xff", b"\x01\x00", b"\x9c\x00", b"\x00\x7f", b"\x80\x80"])
def test_a_touched_joystick_ends_our_motion_with_that_very_frame(bench: Bench, stick: bytes) -> None:
    armed(bench).rest(0.2, motion=GO)
    assert bench.joystick_frames()
    before = len(bench.bus.sent)
    bench.now_ns += 10 * MS
    status = bench.hear(Frame(0x02000100, stick, True))
    assert (status.armed, status.stopped_by_user) == (False, True)
    assert "own joystick was touched" in status.fault
    bench.rest(1.0, stick=(0, 1), motion=GO)
    bench.rest(1.0, motion=GO)
    assert len(bench.bus.sent) == before


def test_after_a_touch_arming_again_needs_the_stick_at_rest_and_then_works(bench: Bench) -> None:
    armed(bench).rest(0.1, stick=(5, 5))
    assert "not centred" in refusal(bench)
    armed(bench).rest(0.1, motion=GO)
    assert bench.joystick_frames()


def test_another_joysticks_touch_counts_too(bench: Bench) -> None:
    armed(bench)
    assert not bench.hear(rnet.joystick(3, 0, 40)).armed


def test_following_sends_one_frame_for_each_centred_one_and_none_by_itself(bench: Bench) -> None:
    armed(bench).rest(0.1, motion=GO)
    before = len(bench.joystick_frames())
    bench.hear(*[rnet.joystick(1, 0, 0)] * 3)
    assert len(bench.joystick_frames()) == before + 3
    assert {(event.x, event.y) for _, event in bench.joystick_frames()} == {(0, 50)}
    for _ in range(5):
        bench.drive.command(bench.now_ns, GO)
    assert len(bench.joystick_frames()) == before + 3


def test_a_joystick_that_falls_silent_ends_following(bench: Bench) -> None:
    armed(bench).rest(0.1, motion=GO)
    bench.rest(0.1, stick=None, motion=GO)
    status = bench.drive.poll(bench.now_ns)
    assert not status.armed
    assert "fallen silent" in status.fault


# what the chair says while we drive ---------------------------------------------------------------------------------
@pytest.mark.parametrize(
    ("frame", "sentence"),
    [
        (Frame(0x0A040100, b"\x32", True), "speed setting is now 50 %"),
        (Frame(0x051, b"\x00\x02\x00\x00"), "profile 2 was selected"),
        (Frame(0x0C140000, b"\x01", True), "reports trouble"),
        (Frame(0x1C200100, b"\x2c\x00\x00\x00\x00", True), "battery low"),
        (Frame(0x1C240101, b"", True), ""),
        (Frame(0x1C240100, b"", True), "powers down"),
        (Frame(0x000, b"", False, True), "sleep for all"),
        (Frame(0x00C), "switched on again"),
    ],
)
def test_what_ends_a_drive_is_told_in_words(bench: Bench, frame: Frame, sentence: str) -> None:
    armed(bench)
    status = bench.hear(frame)
    assert status.armed == (not sentence)
    assert sentence in status.fault


def test_a_lower_speed_setting_is_slower_and_so_allowed(bench: Bench) -> None:
    armed(bench)
    assert bench.hear(Frame(0x0A040100, b"\x0a", True)).armed


def test_battery_is_told_as_a_fraction(bench: Bench) -> None:
    assert bench.hear(Frame(0x1C0C0100, b"\x37", True)).battery == pytest.approx(0.55)


# the joystick locked out --------------------------------------------------------------------------------------------
@pytest.fixture
def locked(rnet_settings: CanSettings) -> Any:
    accepted = {"takeover": "jsm_error", "hazard_accepted": MODES["jsm_error"].accept}
    made = Bench(rnet_settings, rnet=accepted, watchdog_relay="K1")
    yield made
    made.close()


def test_jsm_error_sends_the_calibrated_speed_and_three_errors_then_a_frame_every_tick(locked: Bench) -> None:
    locked.rest(0.5)
    locked.drive.arm(locked.now_ns)
    assert [frame for _, frame in locked.bus.sent] == [rnet.speed_setting(1, 20), *[rnet.network_error()] * 3]
    locked.rest(0.2, stick=None)
    locked.rest(0.5, stick=None, motion=GO)
    frames = locked.joystick_frames()
    gaps = [then - now for (now, _), (then, _) in pairwise(frames)]
    assert set(gaps) == {10 * MS}
    assert frames[-1][1] == rnet.Joystick(1, 0, 50)


def test_a_joystick_that_comes_back_ends_the_takeover(locked: Bench) -> None:
    locked.rest(0.5)
    locked.drive.arm(locked.now_ns)
    locked.rest(0.3, stick=None, motion=STILL)
    locked.rest(0.1, stick=None, motion=GO)
    before = len(locked.bus.sent)
    status = locked.hear(rnet.joystick(1, 0, 0))
    assert not status.armed
    assert "back on the bus" in status.fault
    locked.rest(0.3, stick=None, motion=GO)
    assert len(locked.bus.sent) == before


def test_closing_while_driving_leaves_a_centred_frame_last(locked: Bench) -> None:
    locked.rest(0.5)
    locked.drive.arm(locked.now_ns)
    locked.rest(0.2, stick=None)
    locked.rest(0.2, stick=None, motion=GO)
    locked.drive.close()
    assert locked.bus.sent[-1][1] == rnet.joystick(1, 0, 0)


# nothing stale ------------------------------------------------------------------------------------------------------
@pytest.mark.parametrize("mode", ["follow", "jsm_error"])
def test_no_joystick_frame_is_ever_sent_later_than_50_ms_after_the_command_it_carries(mode: str) -> None:
    carried = [late_guard(mode, seed) for seed in range(40)]
    assert sum(carried) > 400


def late_guard(mode: str, seed: int) -> int:
    """A guard that is held up at random between reading its clock and calling; how many motion frames it sent."""
    chance = random.Random(seed)
    accepted = {"takeover": mode, "hazard_accepted": MODES[mode].accept, "settle_ms": 300}
    base = CanSettings.model_validate(
        {"dialect": "rnet", "channel": f"{mode}{seed}", "rnet": accepted, "watchdog_relay": "K1"}
    )
    bench = Bench(base)
    bench.rest(0.5)
    bench.drive.arm(bench.now_ns)
    bench.rest(0.2, stick=(0, 0) if mode == "follow" else None)
    commanded: dict[int, int] = {}
    carried = 0
    chair = [rnet.joystick(1, 0, 0)] if mode == "follow" else [Frame(0x14300000, b"\0\0", True)]
    for number in range(120):
        if not bench.drive.poll(bench.now_ns).armed:
            bench.rest(0.5)
            bench.drive.arm(bench.now_ns)
            bench.rest(0.1, stick=(0, 0) if mode == "follow" else None)
            carried = len(bench.joystick_frames())
        taken_ns = bench.now_ns
        bench.now_ns += chance.choice([0, 0, 0, 0, 0, 30, 51, 70]) * MS
        bench.bus.to_hear += chair
        bench.drive.poll(taken_ns)
        if chance.random() < 0.5:
            y = 1 + number % 99
            commanded[y] = taken_ns
            bench.drive.command(taken_ns, Motion(y * 5.0 + 0.1, 0.0))
        for at_ns, event in bench.joystick_frames()[carried:]:
            carried += 1
            assert event.y == 0 or at_ns - commanded[event.y] <= 50 * MS
        bench.now_ns += chance.choice([1, 5]) * MS
    moving = sum(event.y != 0 for _, event in bench.joystick_frames())
    bench.close()
    return moving


def test_a_guard_that_only_polls_sends_nothing_after_50_ms(bench: Bench) -> None:
    armed(bench).rest(0.2, motion=GO)
    last_ns = bench.now_ns
    for _ in range(100):
        bench.now_ns += 10 * MS
        bench.hear(rnet.joystick(1, 0, 0))
    assert bench.joystick_frames()[-1][0] <= last_ns + 50 * MS


def test_a_guard_held_up_between_its_clock_and_its_call_sends_nothing(locked: Bench) -> None:
    locked.rest(0.5)
    locked.drive.arm(locked.now_ns)
    locked.rest(0.2, stick=None)
    before = len(locked.bus.sent)
    taken_ns, locked.now_ns = locked.now_ns, locked.now_ns + 51 * MS
    locked.drive.command(taken_ns, GO)
    assert len(locked.bus.sent) == before


def test_a_guard_that_comes_back_after_silence_must_arm_again(locked: Bench) -> None:
    locked.rest(0.5)
    locked.drive.arm(locked.now_ns)
    locked.rest(0.2, stick=None)
    locked.rest(0.2, stick=None, motion=GO)
    locked.now_ns += 300 * MS
    before = len(locked.bus.sent)
    locked.rest(0.3, stick=None, motion=GO)
    assert {frame.data for _, frame in locked.bus.sent[before:]} <= {b"\0\0"}
    assert not locked.drive.poll(locked.now_ns).armed


def test_arming_in_the_middle_of_a_wish_moves_nothing_before_neutral(bench: Bench) -> None:
    bench.rest(0.5, motion=GO)
    bench.drive.arm(bench.now_ns)
    bench.rest(0.5, motion=GO)
    assert bench.joystick_frames() == []
    assert not bench.drive.poll(bench.now_ns).armed
    bench.rest(0.02)
    bench.rest(0.1, motion=GO)
    assert bench.joystick_frames()


def test_behind_two_unanswered_frames_motion_waits_and_only_a_stop_may_queue(locked: Bench) -> None:
    locked.rest(0.5)
    locked.drive.arm(locked.now_ns)
    locked.rest(0.2, stick=None)
    locked.rest(0.1, stick=None, motion=GO)
    locked.bus.unanswered = 2
    before = len(locked.bus.sent)
    locked.rest(0.1, stick=None, motion=GO)
    assert len(locked.bus.sent) == before
    locked.rest(0.01, stick=None)
    assert [frame for _, frame in locked.bus.sent[before:]] == [rnet.joystick(1, 0, 0)]


def test_frames_that_nobody_acknowledges_are_told_after_200_ms(locked: Bench) -> None:
    locked.rest(0.5)
    locked.drive.arm(locked.now_ns)
    locked.rest(0.2, stick=None)
    locked.bus.unanswered = 4
    locked.rest(0.3, stick=None, motion=GO)
    assert "nothing acknowledges them" in locked.drive.poll(locked.now_ns).fault


def test_an_interface_that_acknowledges_nothing_for_a_second_is_opened_anew(locked: Bench) -> None:
    locked.rest(0.5)
    locked.drive.arm(locked.now_ns)
    locked.rest(0.2, stick=None)
    locked.bus.unanswered = 4
    with pytest.raises(DriveError, match="was lost: no frame was acknowledged for 1000 ms"):
        locked.rest(1.5, stick=None, motion=GO)
    assert not locked.drive.poll(locked.now_ns).linked
    locked.bus.unanswered = 0
    locked.drive.connect(locked.now_ns + 20 * MS)
    locked.rest(0.5)
    assert locked.drive.poll(locked.now_ns).linked

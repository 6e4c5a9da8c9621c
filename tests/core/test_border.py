"""The border: what fails is counted, named and treated as silence; what passes becomes exactly one fact."""

from __future__ import annotations

import math
import os
from typing import Any

import msgspec
import pytest
from hypothesis import given
from hypothesis import strategies as st

from chairward.border import HEARD_LIMIT, Border
from chairward.facts import MS, Facts, Limits, SourceLimits
from chairward.messages import (
    Alive,
    Button,
    Command,
    DriveStatus,
    Ended,
    Intent,
    Lost,
    Message,
    Parcel,
    Press,
    RangeReading,
    Stick,
    Veto,
)
from chairward.plan import LanePlan, Part
from chairward.wire import MAX_MESSAGE_BYTES, encode_parcel

NOW = 10_000 * MS
SONAR = "front/sonar"


def border() -> Border:
    return Border(
        {
            "front": LanePlan(name="front", source=Part(component="sonar"), stages=(Part(component="extra"),)),
            "panel": LanePlan(name="panel", source=Part(component="keys"), may=frozenset({Button.STOP, Button.ARM})),
        },
        Limits(
            sensors={SONAR: SourceLimits(freshness_ns=200 * MS)},
            recognizers={"front/extra": SourceLimits(freshness_ns=200 * MS)},
        ),
    )


def take(b: Border, message: Message, lane: str = "front", stage: str = "sonar", now: int = NOW) -> Facts:
    b.take(lane, encode_parcel(Parcel(stage=stage, body=message)), now)
    return facts(b, now)


def facts(b: Border, now: int = NOW) -> Facts:
    return b.facts(now, DriveStatus(at_ns=now, linked=True, armed=True), now, 0)


def reading(seq: int = 1, captured_ns: int = NOW, **values: int) -> RangeReading:
    return RangeReading(seq=seq, captured_ns=captured_ns, can_see=True, **values)  # type: ignore[arg-type]


def test_a_valid_reading_becomes_a_fact_under_lane_and_stage() -> None:
    assert take(border(), reading(ahead_mm=700)).ranges[SONAR][-1].ahead_mm == 700


def test_only_the_last_three_readings_are_kept_oldest_first() -> None:
    b = border()
    for seq in range(1, 6):
        take(b, reading(seq, ahead_mm=seq))
    assert [r.ahead_mm for r in facts(b).ranges[SONAR]] == [3, 4, 5]


@pytest.mark.parametrize(
    ("raw", "says"),
    [
        (b"\xff\x00garbage", "not a valid message"),
        (b"\x91" * 3000, "not a valid message"),
        (b"x" * (MAX_MESSAGE_BYTES + 1), "more than"),
        (b"", "not a valid message"),
        (msgspec.msgpack.encode({"stage": "sonar", "body": {"type": "range"}}), "not a valid message"),
    ],
)
def test_a_malformed_message_is_named_and_refreshes_nothing(raw: bytes, says: str) -> None:
    b = border()
    b.take("front", raw, NOW)
    f = facts(b)
    assert not f.ranges
    assert says in next(iter(f.refused.values()))


@pytest.mark.parametrize(
    ("message", "at_once"),
    [
        (Alive(seq=1, captured_ns=NOW), False),
        (Alive(seq=1, captured_ns=NOW, well=False), True),
        (Veto(seq=1, captured_ns=NOW, stop=False), False),
        (Veto(seq=1, captured_ns=NOW, stop=True), True),
        (RangeReading(seq=1, captured_ns=NOW, can_see=True, ahead_mm=4000), True),
        (Lost(seq=1, captured_ns=NOW, reason="unplugged"), True),
        (Press(seq=1, captured_ns=NOW, button=Button.RESET), False),  # refused: it may not
    ],
)
def test_only_what_may_take_something_away_is_decided_at_once(message: Message, at_once: bool) -> None:
    raw = encode_parcel(Parcel(stage="sonar", body=message))
    assert border().take("front", raw, NOW) is at_once


@pytest.mark.parametrize(
    ("changes", "at_once"),
    [
        ({}, False),
        ({"ahead_mm": 901, "left_mm": 1500}, False),
        ({"ahead_mm": 899}, True),
        ({"left_mm": 1499}, True),
        ({"left_mm": None}, True),
        ({"right_mm": 3000}, True),  # not told before, so it may be news
        ({"closing_mm_s": 41}, True),
        ({"closing_mm_s": 0}, False),
        ({"can_see": False}, True),
    ],
)
def test_a_reading_in_which_nothing_is_nearer_waits_for_the_tick(changes: dict[str, Any], at_once: bool) -> None:
    b = border()
    before = RangeReading(seq=1, captured_ns=NOW, can_see=True, ahead_mm=900, left_mm=1500, closing_mm_s=40)
    after = msgspec.structs.replace(before, seq=2, **changes)
    raws = [encode_parcel(Parcel(stage="sonar", body=body)) for body in (before, after)]
    assert [b.take("front", raw, NOW) for raw in raws] == [True, at_once]
    assert facts(b).ranges[SONAR] == (before, after), "what waits is known all the same"


def test_every_refused_message_is_counted_however_many_come_between_two_decisions() -> None:
    b = border()
    for nth in range(5):
        b.take("front", b"rubbish %d" % nth, NOW)
    f = take(b, reading(captured_ns=NOW + 6 * MS))
    assert f.refusals == {"front": 5, SONAR: 1}
    assert f.refused.keys() == f.refusals.keys()
    assert facts(b).refusals == {}, "each is told once"


@pytest.mark.parametrize("value", [-1, 20_001, math.nan, math.inf, "near", 1.5, True])
def test_an_impossible_distance_is_refused(value: object) -> None:
    b = border()
    body = {"type": "range", "seq": 1, "captured_ns": NOW, "can_see": True, "ahead_mm": value}
    b.take("front", msgspec.msgpack.encode({"stage": "sonar", "body": body}), NOW)
    assert not facts(b).ranges


def test_a_reading_from_the_future_is_refused_and_a_slightly_early_clock_is_not_rewarded() -> None:
    b = border()
    assert "future" in take(b, reading(captured_ns=NOW + 6 * MS)).refused[SONAR]
    assert take(b, reading(captured_ns=NOW + 4 * MS)).ranges[SONAR][-1].captured_ns == NOW


def test_a_sequence_that_does_not_rise_is_refused() -> None:
    b = border()
    take(b, reading(7, ahead_mm=900))
    assert "sequence 7 after 7" in take(b, reading(7, ahead_mm=5000)).refused[SONAR]
    assert "sequence 6 after 7" in take(b, reading(6, ahead_mm=5000)).refused[SONAR]
    assert [r.ahead_mm for r in facts(b).ranges[SONAR]] == [900]


def test_a_replaced_process_counts_from_the_beginning_and_is_lost_until_all_its_votes_have_spoken() -> None:
    b = border()
    take(b, reading(7))
    b.lane_lost("front", "its process was killed")
    assert "killed" in facts(b).lost["front"]
    b.lane_attached("front")
    assert "said nothing yet" in facts(b).lost["front"], "what the dead process said last must not count"
    f = take(b, reading(1, ahead_mm=800))
    assert f.ranges[SONAR][-1].ahead_mm == 800
    assert "front" in f.lost
    assert not take(b, Alive(seq=1, captured_ns=NOW), stage="extra").lost


@pytest.mark.parametrize("stray", [reading(1, ahead_mm=300), Veto(seq=1, captured_ns=NOW, stop=True, reason="tilt")])
def test_what_a_stage_said_without_a_vote_is_forgotten_with_its_process(stray: Message) -> None:
    b = border()
    f = take(b, stray, "panel", "keys")
    assert {**f.ranges, **f.vetoes}, "while that process lives it closes all ways (rule 1)"
    take(b, reading(1))
    b.lane_attached("front")
    assert {**facts(b).ranges, **facts(b).vetoes}.keys() == {"panel/keys", SONAR}, "of the other lanes all is kept"
    b.lane_attached("panel")
    assert {**facts(b).ranges, **facts(b).vetoes}.keys() == {SONAR}


def test_a_stage_that_the_chair_file_does_not_name_is_not_heard() -> None:
    f = take(border(), reading(), stage="impostor")
    assert not f.ranges
    assert "no stage 'impostor'" in f.refused["front"]


def test_a_lane_may_press_only_what_the_chair_file_says() -> None:
    b = border()
    assert take(b, Press(seq=1, captured_ns=NOW, button=Button.ARM), "panel", "keys").pressed[0].button == Button.ARM
    f = take(b, Press(seq=2, captured_ns=NOW, button=Button.RESET), "panel", "keys")
    assert not f.pressed
    assert "may not press RESET" in f.refused["panel/keys"]
    assert not take(b, Press(seq=1, captured_ns=NOW, button=Button.STOP)).pressed


@pytest.mark.parametrize(("captured_ns", "at_ns"), [(NOW - 300 * MS, NOW - 300 * MS), (NOW + 4 * MS, NOW)])
def test_a_press_is_as_old_as_its_lane_says_and_no_younger_than_its_arrival(captured_ns: int, at_ns: int) -> None:
    f = take(border(), Press(seq=1, captured_ns=captured_ns, button=Button.STOP), "panel", "keys")
    assert f.pressed[0].at_ns == at_ns


def test_what_was_heard_and_pressed_is_handed_over_once_in_order() -> None:
    b = border()
    take_ = [Command.FRONT, Command.STOP]
    for seq, command in enumerate(take_, 1):
        b.take(
            "front", encode_parcel(Parcel(stage="extra", body=Intent(seq=seq, captured_ns=NOW, command=command))), NOW
        )
    assert [w.command for w in facts(b).heard] == take_
    assert facts(b).heard == ()


@pytest.mark.parametrize("command", [Command.STOP, Command.HELP])
def test_however_much_is_said_at_once_a_stop_or_a_call_for_help_is_never_the_one_dropped(command: Command) -> None:
    b = border()
    for seq in range(1, HEARD_LIMIT + 5):
        wish = Intent(seq=seq, captured_ns=NOW, command=Command.FRONT)
        b.take("front", encode_parcel(Parcel(stage="extra", body=wish)), NOW)
    f = take(b, Intent(seq=1000, captured_ns=NOW, command=command), stage="extra")
    assert f.heard[-1].command is command


@pytest.mark.parametrize(
    "late",
    [
        Intent(seq=1, captured_ns=NOW - 1_100 * MS, command=Command.FRONT),
        Stick(seq=1, captured_ns=NOW - 1_100 * MS, forward=1.0, left=0.0),
    ],
)
def test_a_word_that_a_hung_recognizer_delivers_late_is_not_obeyed(late: Message) -> None:
    f = take(border(), late, stage="extra")
    assert not f.heard
    assert "too late" in f.refused["front/extra"]


def test_a_late_stop_is_still_a_stop_and_a_late_call_for_help_still_calls() -> None:
    for command in (Command.STOP, Command.HELP):
        f = take(border(), Intent(seq=1, captured_ns=NOW - 9_000 * MS, command=command), stage="extra")
        assert f.heard[0].command is command


@pytest.mark.parametrize(
    "wish",
    [Intent(seq=1, captured_ns=NOW, command=Command.FRONT), Stick(seq=1, captured_ns=NOW, forward=1.0, left=0.0)],
)
def test_only_a_recognizer_of_the_chair_file_may_ask_for_motion(wish: Message) -> None:
    f = take(border(), wish)
    assert not f.heard
    assert "not a recognizer" in f.refused[SONAR]


def test_anybody_may_ask_for_a_stop() -> None:
    assert take(border(), Intent(seq=1, captured_ns=NOW, command=Command.STOP)).heard[0].command is Command.STOP


@pytest.mark.parametrize(
    ("forward", "left", "command"),
    [(0.5, -1.0, Command.FRONT), (-0.5, 0.0, Command.BACK), (0.0, 0.5, Command.LEFT), (0.0, -0.5, Command.RIGHT)],
)
def test_a_stick_is_a_held_wish_with_its_fractions(forward: float, left: float, command: Command) -> None:
    message = Stick(seq=1, captured_ns=NOW - 40 * MS, forward=forward, left=left)
    wish = take(border(), message, stage="extra").heard[0]
    assert (wish.held, wish.stick, wish.command) == (True, (forward, left), command)
    assert wish.at_ns == NOW - 40 * MS, "a backlog of old samples must not keep a stick alive"


@pytest.mark.parametrize("gone", [Lost(seq=0, captured_ns=NOW, reason="unplugged"), Ended(seq=0, captured_ns=NOW)])
def test_a_lost_device_is_named_until_its_votes_speak_again(gone: Message) -> None:
    b = border()
    assert "front" in take(b, gone).lost
    assert "front" in take(b, Alive(seq=1, captured_ns=NOW), stage="extra").lost
    assert "front" not in take(b, reading(5)).lost


def test_a_veto_keeps_its_reason() -> None:
    assert take(border(), Veto(seq=1, captured_ns=NOW, stop=True, reason="tilt")).vetoes[SONAR].reason == "tilt"


@given(st.binary(max_size=300))
def test_no_bytes_of_a_lane_ever_raise_or_refresh(raw: bytes) -> None:
    b = border()
    b.take("front", raw, NOW)
    assert not facts(b).ranges


def test_random_blobs_are_all_refused_and_leave_nothing_behind() -> None:
    b = border()
    for _ in range(2000):
        b.take("front", os.urandom(24), NOW)
        assert facts(b).refused
    assert not facts(b).refused

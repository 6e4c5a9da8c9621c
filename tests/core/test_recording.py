"""The recorder: what was decided can be read and decided again; a file that is cut gives all before the cut."""

from __future__ import annotations

import json
import time
from functools import cache
from pathlib import Path

import pytest
import typer
from hypothesis import given, settings
from hypothesis import strategies as st
from mcap.exceptions import McapError
from mcap.writer import Writer
from msgspec.structs import replace
from typer.testing import CliRunner

from chairward import plan, records
from chairward.arbiter import decide
from chairward.cli.replay import replay as replay_command
from chairward.components import Context, Motion
from chairward.facts import MS, Facts, Limits, State, Wish
from chairward.messages import Command, DriveStatus, RangeReading
from chairward.plan import LanePlan, Part, Plan
from chairward.recording import PINS, PLAN, RECORDS, Recorder, RecorderSettings, messages, read, read_plan
from chairward.records import Record
from chairward.replay import Gap, Replayed, replay
from chairward.shared_state import SharedState
from chairward.testing.ride import chair_plan, recorded

LIMITS = Limits(steer_deg_s=5.0)


def a_plan() -> Plan:
    lane = LanePlan(name="front", source=Part(component="sonar"))
    return chair_plan(words={"go": "front"}, limits=LIMITS, drive=Part(component="pic_serial"), lanes=(lane,))


@cache
def some_records(count: int) -> list[Record]:
    state, made = State(latch="", armed=True), []
    for tick in range(count):
        now = 10**10 + tick * 20 * MS
        window = tuple(
            RangeReading(seq=tick + i, captured_ns=now - (3 - i) * MS, can_see=True, ahead_mm=900 - tick)
            for i in range(3)
        )
        wish = Wish(source="voice/voice_dtw", seq=tick, at_ns=now, command=Command.FRONT, word="go")
        facts = Facts(
            now_ns=now,
            ranges={"front/sonar": window},
            heard=(wish,) if tick % 50 == 0 else (),
            drive=DriveStatus(at_ns=now, linked=True, armed=True),
            supervisor_ns=now,
        )
        made.append(recorded(tick, state, facts, LIMITS))
        state = made[-1].after
    return made


def kept(folder: Path, made: list[Record]) -> Path:
    """These records as the recorder keeps them."""
    plan.write(a_plan(), folder / "plan.json")
    recorder = Recorder(
        RecorderSettings(path=Path("r.mcap")), Context(lane="recorder", run_dir=folder, chair_dir=folder)
    )
    for record in made:
        recorder.observe(records.encode(record))
    recorder.close()
    return folder / "r.mcap"


def written(folder: Path, said: list[tuple[str, bytes]]) -> Path:
    """A whole file with any messages."""
    path = folder / "forged.mcap"
    with path.open("wb") as file:
        writer = Writer(file)
        writer.start()
        for topic, data in said:
            writer.add_message(writer.register_channel(topic, "", 0), 0, data, 0)
        writer.finish()  # type: ignore[no-untyped-call]
    return path


@pytest.fixture(scope="module")
def recording(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return kept(tmp_path_factory.mktemp("recording"), some_records(400))


def test_every_record_comes_back_as_it_was(recording: Path) -> None:
    assert list(read(recording)) == some_records(400)


def test_every_decision_is_reproduced_from_the_file_alone(recording: Path) -> None:
    limits = read_plan(recording).limits
    assert limits == LIMITS
    assert replay(recording, limits) == Replayed(decisions=400, seconds=7.98)


def test_other_limits_would_have_decided_differently_and_replay_says_where(recording: Path) -> None:
    found = replay(recording, Limits(stop_mm=890, avoid_mm=900, near_loss_mm=900)).differences
    assert found
    assert "was recorded, would be" in found[0].what


def test_a_recorded_minus_zero_is_not_the_zero_that_is_decided(tmp_path: Path) -> None:
    made = list(some_records(3))
    forged = replace(made[1].decision, motion=Motion(-0.0, -0.0))
    found = replay(kept(tmp_path, [made[0], replace(made[1], decision=forged), made[2]]), LIMITS)
    assert [d.tick for d in found.differences] == [1]
    assert "decision.motion" in found.differences[0].what


def test_whole_numbers_where_the_arbiter_was_given_whole_numbers_are_no_difference(tmp_path: Path) -> None:
    state, facts = State(latch="", armed=True), some_records(1)[0].facts
    facts = replace(facts, drive=replace(facts.drive, speed_mm_s=0, turn_deg_s=0))
    after, decision = decide(state, facts, LIMITS)
    made = replace(some_records(1)[0], before=state, facts=facts, after=after, decision=decision)
    assert replay(kept(tmp_path, [made]), LIMITS).differences == []


def test_a_state_that_the_decision_before_did_not_leave_is_told(tmp_path: Path) -> None:
    made = list(some_records(4))
    before = replace(made[2].before, output_ns=made[2].before.output_ns - MS)
    after, decision = decide(before, made[2].facts, LIMITS)
    made[2] = replace(made[2], before=before, after=after, decision=decision)
    found = replay(kept(tmp_path, made[:3]), LIMITS)
    assert [d.tick for d in found.differences] == [2]
    assert "was left, but tick 2 began with" in found.differences[0].what


def test_ticks_that_are_missing_are_counted_and_are_no_difference(tmp_path: Path) -> None:
    made = some_records(30)
    assert replay(kept(tmp_path, made[3:10] + made[15:20] + made[21:]), LIMITS) == Replayed(
        decisions=21, seconds=0.52, gaps=[Gap(9, 5, 0.12), Gap(19, 1, 0.32)]
    )


def test_records_in_a_wrong_order_are_told(tmp_path: Path) -> None:
    made = list(some_records(4))
    found = replay(kept(tmp_path, [made[0], made[2], made[1], made[3]]), LIMITS)
    assert [d.what for d in found.differences] == ["tick 1 comes after tick 2"]


def test_a_whole_record_that_cannot_be_read_is_not_taken_for_a_cut(tmp_path: Path) -> None:
    path = written(tmp_path, [(RECORDS, records.encode(some_records(1)[0])), (RECORDS, b"\x81\xa4tick\xc0")])
    reading = read(path)
    next(reading)
    with pytest.raises(McapError, match=r"forged\.mcap: record 1 cannot be read"):
        next(reading)


UNREADABLE = {
    "empty": b"",
    "cut in its magic": b"\x89MCAP",
    "cut in its first record": b"\x89MCAP0\r\n\x01\xff\x00",
    "noise": b"\x89MCAP0\r\n" + bytes(range(256)),
    "another file": b"a letter to my aunt",
}


@pytest.mark.parametrize("data", UNREADABLE.values(), ids=UNREADABLE)
def test_replay_says_in_one_sentence_why_a_file_cannot_be_replayed(tmp_path: Path, data: bytes) -> None:
    path = tmp_path / "x.mcap"
    path.write_bytes(data)
    assert_one_sentence(path)


@pytest.mark.parametrize("plan_data", [b"{", b"{}", b'{"chair": "\xff"}', b"[]"])
def test_replay_says_in_one_sentence_that_a_plan_cannot_be_read(tmp_path: Path, plan_data: bytes) -> None:
    assert_one_sentence(written(tmp_path, [(PLAN, plan_data)]))


def test_replay_says_in_one_sentence_that_a_record_cannot_be_read(recording: Path, tmp_path: Path) -> None:
    plan_data = next(messages(recording, PLAN))
    assert_one_sentence(written(tmp_path, [(PLAN, plan_data), (RECORDS, b"\xc1")]))


def assert_one_sentence(path: Path) -> None:
    app = typer.Typer()
    app.command()(replay_command)
    result = CliRunner().invoke(app, [str(path)])
    assert result.exit_code == 2
    assert result.output.startswith(f"chairward: {path}")
    assert result.output.count("\n") == 1


@settings(max_examples=40, deadline=None)
@given(share=st.floats(min_value=0.0, max_value=1.0))
def test_a_file_cut_anywhere_gives_a_beginning_of_what_was_recorded(recording: Path, share: float) -> None:
    data = recording.read_bytes()
    cut = recording.with_name("cut.mcap")
    cut.write_bytes(data[: int(len(data) * share)])
    try:
        got = list(read(cut))
    except McapError:
        assert len(data) * share < 9  # not even the first bytes, which say what it is
        return
    assert got == some_records(400)[: len(got)]


def test_what_was_recorded_a_second_ago_survives_a_power_cut(tmp_path: Path) -> None:
    recorder = Recorder(RecorderSettings(path=Path("r.mcap")), Context(lane="r", run_dir=tmp_path, chair_dir=tmp_path))
    made = some_records(40)
    for record in made:
        recorder.observe(records.encode(record))
    end = time.monotonic() + 60.0  # a second is what is promised; a busy machine may take longer to wake the thread
    while len(list(read(tmp_path / "r.mcap"))) < len(made) and time.monotonic() < end:
        time.sleep(0.05)
    assert list(read(tmp_path / "r.mcap")) == made, "nothing more came, and still it was written out"
    recorder.close()


def test_a_file_that_is_no_recording_is_named(tmp_path: Path) -> None:
    path = tmp_path / "holiday.mcap"
    path.write_bytes(b"not a recording at all")
    with pytest.raises(McapError, match=r"holiday\.mcap: not a recording"):
        list(read(path))


def test_the_pins_of_a_simulated_controller_are_recorded_beside_each_decision(tmp_path: Path) -> None:
    pins = SharedState.create(tmp_path / "pins", ("drive_duty", "brake"))
    recorder = Recorder(RecorderSettings(path=Path("p.mcap")), Context(lane="r", run_dir=tmp_path, chair_dir=tmp_path))
    for nth, record in enumerate(some_records(5)):
        pins.write(drive_duty=nth / 10, brake=0.0)
        recorder.observe(records.encode(record))
    recorder.close()
    got = [json.loads(data) for data in messages(tmp_path / "p.mcap", PINS)]
    assert [values["drive_duty"] for values in got] == [0.0, 0.1, 0.2, 0.3, 0.4]

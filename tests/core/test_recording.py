"""The recorder: what was decided can be read and decided again; a file that is cut gives all before the cut."""

from __future__ import annotations

from pathlib import Path

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from mcap.exceptions import McapError

from chairward import plan, records
from chairward.arbiter import decide
from chairward.components import Context, Footprint
from chairward.facts import MS, Facts, Limits, State, Wish
from chairward.messages import Command, DriveStatus, RangeReading
from chairward.plan import ChairKind, LanePlan, Part, Plan
from chairward.recording import Recorder, RecorderSettings, read
from chairward.records import Record
from chairward.replay import differences, read_plan

LIMITS = Limits(steer_deg_s=5.0)


def a_plan() -> Plan:
    return Plan(
        chair="t",
        chair_file="/t.toml",
        kind=ChairKind.SIMULATOR,
        person="p",
        person_file="/p.toml",
        person_dir="/p",
        language="en",
        words={"go": "front"},
        footprint=Footprint(front_mm=1, rear_mm=1, half_width_mm=1),
        limits=LIMITS,
        drive=Part(component="pic_serial"),
        lanes=(LanePlan(name="front", source=Part(component="sonar")),),
    )


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
        after, decision = decide(state, facts, LIMITS)
        made.append(
            Record(
                tick=tick,
                due_ns=now,
                woke_ns=now,
                wrote_ns=now,
                periodic=True,
                limits_id="x",
                before=state,
                facts=facts,
                after=after,
                decision=decision,
            )
        )
        state = after
    return made


@pytest.fixture(scope="module")
def recording(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("recording")
    plan.write(a_plan(), folder / "plan.json")
    recorder = Recorder(
        RecorderSettings(path=Path("r.mcap")), Context(lane="recorder", run_dir=folder, chair_dir=folder)
    )
    for record in some_records(400):
        recorder.observe(records.encode(record))
    recorder.close()
    return folder / "r.mcap"


def test_every_record_comes_back_as_it_was(recording: Path) -> None:
    assert list(read(recording)) == some_records(400)


def test_every_decision_is_reproduced_from_the_file_alone(recording: Path) -> None:
    limits = read_plan(recording).limits
    assert limits == LIMITS
    assert list(differences(recording, limits)) == [None] * 400


def test_other_limits_would_have_decided_differently_and_replay_says_where(recording: Path) -> None:
    found = [d for d in differences(recording, Limits(stop_mm=890, avoid_mm=900, near_loss_mm=900)) if d is not None]
    assert found
    assert "was" in found[0].what


@settings(max_examples=25, deadline=None)
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


def test_a_file_that_is_no_recording_is_named(tmp_path: Path) -> None:
    path = tmp_path / "holiday.mcap"
    path.write_bytes(b"not a recording at all")
    with pytest.raises(McapError, match=r"holiday\.mcap: not a recording"):
        list(read(path))

"""The summary: what it says of a run is what the records hold."""

from __future__ import annotations

import io
import json
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st
from msgspec.structs import replace
from rich.console import Console
from typer.testing import CliRunner

from chairward.cli.app import app
from chairward.cli.run import parse_seconds, reports
from chairward.cli.run_shown import report, status_line
from chairward.components import Motion
from chairward.durations import Durations, percentiles_ms
from chairward.envelope import Caps
from chairward.facts import MS, Decision, Facts, Limits, S, State, Why, Wish
from chairward.messages import Command, DriveStatus, RangeReading
from chairward.records import Record
from chairward.summary import LATE_TICKS_LOGGED, Seen, Summary, against_truth

LIMITS = Limits(caps=Caps(500.0, 150.0, 30.0, 30.0))


def record(at_ms: int, motion: Motion = Motion(0.0, 0.0), late_ms: float = 0.0, **more: object) -> Record:  # noqa: B008
    now = 10 * S + at_ms * MS
    fields = {
        "heard": (),
        "wish": None,
        "ranges": {},
        "stop": False,
        "nearest_mm": None,
        "missed": 0,
        **more,
    }
    return Record(
        tick=at_ms,
        due_ns=now,
        woke_ns=now + int(late_ms * MS),
        wrote_ns=now + MS,
        periodic=True,
        before=State(),
        facts=Facts(
            now_ns=now,
            heard=fields["heard"],  # type: ignore[arg-type]
            ranges=fields["ranges"],  # type: ignore[arg-type]
            drive=DriveStatus(at_ns=now, linked=True, armed=True),
        ),
        after=State(wish=fields["wish"]),  # type: ignore[arg-type]
        decision=Decision(
            motion=motion,
            nearest_mm=fields["nearest_mm"],  # type: ignore[arg-type]
            protective_stop=bool(fields["stop"]),
            reasons=(Why(rule="stop_distance", source="front/x", detail="590 mm ahead"),) if fields["stop"] else (),
        ),
        missed=fields["missed"],  # type: ignore[arg-type]
    )


def wish(command: Command, seq: int, at_ms: int) -> Wish:
    return Wish(source="voice/v", seq=seq, at_ns=10 * S + at_ms * MS, command=command, word=command.value)


def summed(*records: Record) -> dict[str, object]:
    summary = Summary(LIMITS)
    for r in records:
        summary.add(r)
    return summary.result()


def test_every_refused_message_is_counted_and_the_last_of_each_source_is_told() -> None:
    first, second = record(0), record(20)
    facts = [
        replace(first.facts, refused={"front": "rubbish", "voice": "late"}, refusals={"front": 8, "voice": 1}),
        replace(second.facts, refused={"front": "too long"}, refusals={"front": 3}),
    ]
    summary = summed(*(replace(one, facts=said) for one, said in zip((first, second), facts, strict=True)))
    assert summary["refused_messages"] == {
        "front": {"count": 11, "last": "too long"},
        "voice": {"count": 1, "last": "late"},
    }


def test_distance_is_speed_times_time() -> None:
    assert summed(*(record(t, Motion(500.0, 0.0)) for t in range(0, 2001, 20)))["driven_m"] == 1.0


def test_a_command_counts_as_obeyed_only_when_the_chair_then_does_it() -> None:
    front, left = wish(Command.FRONT, 1, 0), wish(Command.LEFT, 2, 100)
    result = summed(
        record(0, heard=(front,), wish=front),
        record(20, Motion(100.0, 0.0), wish=front),
        record(100, heard=(left,), wish=None),
        record(120, Motion(100.0, 0.0)),
    )
    heard = result["commands_heard"]
    assert [(h["command"], h["obeyed"]) for h in heard] == [("front", True), ("left", False)]  # type: ignore[union-attr]
    assert result["commands_obeyed"] == ["front"]


def test_a_protective_stop_is_told_with_distance_and_reason() -> None:
    stops = summed(record(0), record(500, stop=True, nearest_mm=590))["protective_stops"]
    assert stops == [{"at_s": 0.5, "nearest_mm": 590, "why": ["stop_distance front/x 590 mm ahead"]}]


def test_a_motion_beyond_the_caps_is_counted() -> None:
    assert summed(record(0, Motion(500.0, 0.0)), record(20, Motion(501.0, 0.0)))["over_caps"] == 1


def test_late_ticks_are_counted_and_each_is_logged() -> None:
    result = summed(record(0), record(20, late_ms=39.0), record(40, late_ms=41.0))
    assert (result["late_ticks"], result["ticks"]) == (1, 3)
    assert result["late_tick_log"] == [{"at_s": 0.081, "late_ms": 41.0}]


def test_records_that_were_missed_are_said() -> None:
    assert summed(record(0), record(20, missed=7))["missed_records"] == 7


def test_nearest_approach_counts_only_while_driving_forward() -> None:
    moving = Motion(100.0, 0.0)
    assert summed(record(0, nearest_mm=100), record(20, moving, nearest_mm=640))["nearest_while_driving_mm"] == 640


def test_what_was_seen_is_held_against_the_truth_by_kind(tmp_path: Path) -> None:
    summary = Summary(LIMITS, keep_seen=True)
    lines = []
    for i, (seen, truth) in enumerate([(900, 880), (700, 690), (590, 600), (580, 595)]):
        captured = 10 * S + i * 100 * MS
        lines.append({"captured_ns": captured, "seq": i, "name": "a", "kind": "sequence", "truth_mm": truth})
        reading = RangeReading(seq=i, captured_ns=captured, can_see=True, ahead_mm=seen)
        motion = Motion(0.0 if seen < 600 else 100.0, 0.0)
        summary.add(record(i * 100, motion, ranges={"front/stereo": (reading,)}))
    (tmp_path / "front-truth.jsonl").write_text("\n".join(map(json.dumps, lines)))
    events: list[str] = []
    result = against_truth(summary.seen, tmp_path, events)["front/stereo"]["sequence"]
    assert events == []
    assert (result["frames"], result["abs_error_median_mm"]) == (4, 12.5)
    assert result["frames_from_600_to_stop"] == 0
    assert result["truth_at_stop_mm"] == 600


@pytest.mark.parametrize(
    "half", ['{"captured_ns": 5, "tru', '{"truth_mm": 600}', "7", '{"truth_mm": 1, "captured_ns": []}']
)
def test_a_half_written_truth_line_is_left_out_and_told(tmp_path: Path, half: str) -> None:
    whole = json.dumps({"captured_ns": 5, "kind": "still", "truth_mm": 600})
    (tmp_path / "front-truth.jsonl").write_text(f"{whole}\n{half}")
    events: list[str] = []
    seen = [Seen("front/stereo", 5, 610, True, Motion(0.0, 0.0))]
    assert against_truth(seen, tmp_path, events)["front/stereo"]["still"]["with_truth"] == 1
    assert len(events) == 1
    assert events[0].startswith("front-truth.jsonl: line 2 cannot be read")


def test_a_half_written_report_is_left_out_and_told(tmp_path: Path) -> None:
    (tmp_path / "report-world.json").write_text('{"collisions": 0}')
    (tmp_path / "report-pic.json").write_text('{"frames": ')
    events: list[str] = []
    assert reports(tmp_path, events) == {"world": {"collisions": 0}}
    assert len(events) == 1
    assert events[0].startswith("report-pic.json: cannot be read")


@pytest.mark.parametrize(("text", "seconds"), [("30s", 30.0), ("2m", 120.0), ("1.5h", 5400.0), ("7", 7.0)])
def test_durations_are_read_as_people_write_them(text: str, seconds: float) -> None:
    assert parse_seconds(text) == seconds


def test_a_wrong_duration_is_one_sentence() -> None:
    with pytest.raises(ValueError, match="--for soon: not a duration"):
        parse_seconds("soon")


def test_percentiles_of_nothing_are_nothing() -> None:
    assert percentiles_ms([]) is None
    assert percentiles_ms([1 * MS] * 99 + [100 * MS]) == {
        "n": 100,
        "p50": 1.0,
        "p99": 100.0,
        "p99_9": 100.0,
        "max": 100.0,
    }


@given(st.lists(st.integers(0, 10**12), min_size=1, max_size=300))
def test_percentiles_are_within_half_a_percent_and_the_largest_is_exact(values: list[int]) -> None:
    told = percentiles_ms(values)
    assert told is not None
    assert (told["n"], told["max"]) == (len(values), round(max(values) / MS, 3))
    for name, share in (("p50", 0.5), ("p99", 0.99), ("p99_9", 0.999)):
        exact = sorted(values)[min(len(values) - 1, int(len(values) * share))] / MS
        assert told[name] == pytest.approx(exact, rel=0.005, abs=0.001)


def test_durations_take_little_memory_however_many_they_are() -> None:
    durations = Durations()
    for value in range(0, 40 * MS, 199):
        durations.add(value)
    assert durations.n > 200_000
    assert len(durations._counts) < 6_000


def test_a_long_bad_run_is_counted_in_full_and_kept_in_part() -> None:
    summary = Summary(LIMITS)
    ticks = 3 * LATE_TICKS_LOGGED
    for i in range(ticks):
        reading = RangeReading(seq=i, captured_ns=10 * S + i * MS, can_see=True)
        summary.add(record(20 * i, late_ms=50.0, ranges={"front/stereo": (reading,)}))
    result = summary.result()
    assert (result["late_ticks"], result["readings"], len(result["late_tick_log"])) == (ticks, ticks, LATE_TICKS_LOGGED)
    assert summary.seen == [], "only an input that ends is kept, to hold it against the truth"


def test_the_summary_of_a_chair_that_never_moved_says_why_and_has_no_none() -> None:
    summary = Summary(LIMITS)
    sentence = "front camera [left] cannot be opened: plug it in"
    said = record(0, stop=False)
    why = Why(rule="freshness", source="front", detail="camera [left] cannot be opened: plug it in")
    summary.add(replace(said, decision=replace(said.decision, reasons=(why,))))
    whole = {**summary.result(), "ended": "over", "lanes": {}, "events": ["no [x]"], "recording": "/a/b.mcap"}
    Console(width=200, file=(out := io.StringIO())).print(report(whole))
    shown = out.getvalue()
    assert f"freshness {sentence}" in shown
    assert "no [x]" in shown
    assert "None" not in shown


def test_what_a_plugin_says_cannot_wipe_the_instruction_off_the_screen() -> None:
    said = record(0)
    wipes = Why(rule="freshness", source="front", detail="\x1b[2J\x1b[H\rWay clear")
    shown = status_line(replace(said, decision=replace(said.decision, reasons=(wipes,)))).plain
    assert shown.startswith(" ■ Stop now")
    assert shown.isprintable()
    whole = {**Summary(LIMITS).result(), "ended": "over", "lanes": {}, "events": ["\x1b[2J"], "recording": ""}
    Console(width=200, file=(out := io.StringIO())).print(report(whole))
    assert "\x1b" not in out.getvalue()


@pytest.mark.parametrize(("option", "end"), [("--logs", ""), ("--logs", "/logs"), ("--record", "/r.mcap")])
def test_where_nothing_can_be_written_no_run_begins(option: str, end: str, tmp_path: Path) -> None:
    (tmp_path / "file").touch()
    ended = CliRunner().invoke(
        app, ["demo", "--no-record" if option == "--logs" else "--headless", option, f"{tmp_path}/file{end}"]
    )
    assert ended.exit_code == 2
    assert f"chairward: {option}: {tmp_path}/file" in ended.output
    assert "cannot be written" in ended.output


def test_a_folder_is_no_recording(tmp_path: Path) -> None:
    ended = CliRunner().invoke(app, ["demo", "--record", str(tmp_path)])
    assert ended.exit_code == 2
    assert f"{tmp_path}: is a folder: name a file in it" in ended.output

"""The summary: what it says of a run is what the records hold."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from chairward.cli.run import parse_seconds
from chairward.components import Motion
from chairward.envelope import Caps
from chairward.facts import MS, Decision, Facts, Limits, S, State, Why, Wish
from chairward.messages import Command, DriveStatus, RangeReading
from chairward.records import Record
from chairward.summary import Summary, against_truth, percentiles_ms

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
        limits_id="",
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
    summary = Summary(LIMITS)
    lines = []
    for i, (seen, truth) in enumerate([(900, 880), (700, 690), (590, 600), (580, 595)]):
        captured = 10 * S + i * 100 * MS
        lines.append({"captured_ns": captured, "seq": i, "name": "a", "kind": "sequence", "truth_mm": truth})
        reading = RangeReading(seq=i, captured_ns=captured, can_see=True, ahead_mm=seen)
        motion = Motion(0.0 if seen < 600 else 100.0, 0.0)
        summary.add(record(i * 100, motion, ranges={"front/stereo": (reading,)}))
    (tmp_path / "front-truth.jsonl").write_text("\n".join(map(json.dumps, lines)))
    result = against_truth(summary.seen, tmp_path)["front/stereo"]["sequence"]
    assert (result["frames"], result["abs_error_median_mm"]) == (4, 12.5)
    assert result["frames_from_600_to_stop"] == 0
    assert result["truth_at_stop_mm"] == 600


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

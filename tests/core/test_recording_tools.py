"""Recordings in people's hands: replay by all cores, what another profile would have done, tables, redacted copies."""

from __future__ import annotations

import csv
import dataclasses
import json
import re
import xml.etree.ElementTree as ET
from pathlib import Path

import pytest
from msgspec.structs import replace
from typer.testing import CliRunner

from chairward import plan, profile, records
from chairward.cli.app import app
from chairward.components import Context
from chairward.facts import Facts, Limits, State
from chairward.plugins import discover
from chairward.recording import Recorder, RecorderSettings, read, read_plan, tools
from chairward.recording.read import entries
from chairward.recording.redact import redact
from chairward.replay import CHUNKS_WORTH_A_CORE, replay
from chairward.testing.ride import FRONT, PANEL, VOICE, Ride, chair_limits, recorded
from chairward.what_if import compare

LIMITS = chair_limits()


def drive_at_a_wall(limits: Limits, count: int) -> list[records.Record]:
    """An armed chair that is told to go and comes nearer to a wall, again and again."""
    from chairward.messages import Button, Command

    ride, made = Ride(limits=limits, reports_speed=True), []
    distance = 4000.0
    for tick in range(count):
        ride.world["front/range"] = {"ahead_mm": int(distance)}
        before = ride.state
        words = (ride.wish(Command.FRONT, word="vorwärts"),) if tick % 200 == 4 else ()
        press = [Button.RESET] if tick == 0 else [Button.ARM] if tick == 2 else []
        decision = ride.tick(*words, press=press)
        distance -= decision.motion.drive_mm_s * 0.02
        if tick % 400 == 399:
            distance = 4000.0
        made.append(recorded(tick, before, ride.newest_facts, limits))
    return made


def kept(folder: Path, made: list[records.Record], every: int = 0, base: plan.Plan | None = None) -> Path:
    """As the recorder keeps them; every: end a chunk after so many, as time would. base: the chair, "sim" if none."""
    base = base or profile.load("sim", None, [], discover())
    plan.write(dataclasses.replace(base, limits=LIMITS), folder / "plan.json")
    it = Recorder(RecorderSettings(path=Path("r.mcap")), Context(lane="r", run_dir=folder, chair_dir=folder))
    for nth, record in enumerate(made):
        it.observe(records.encode(record))
        if every and nth % every == 0:
            with it._lock:
                assert it._part is not None
                it._part.flush()
    it.close()
    return folder / "r.mcap"


@pytest.fixture(scope="module")
def made() -> list[records.Record]:
    return drive_at_a_wall(LIMITS, 1200)


@pytest.fixture(scope="module")
def recording(tmp_path_factory: pytest.TempPathFactory, made: list[records.Record]) -> Path:
    return kept(tmp_path_factory.mktemp("drive"), made)


def test_two_cores_find_what_one_finds(tmp_path: Path, made: list[records.Record]) -> None:
    spoilt = list(made)
    spoilt[700] = replace(spoilt[700], decision=replace(spoilt[700].decision, notes=("forged",)))
    del spoilt[300:310]
    path = kept(tmp_path, spoilt, every=len(made) // (2 * CHUNKS_WORTH_A_CORE))
    alone = replay(path, LIMITS, cores=1)
    assert (alone.decisions, alone.missing, [d.tick for d in alone.differences]) == (1190, 10, [700])
    assert replay(path, LIMITS, cores=2) == alone


def test_the_same_profile_changes_nothing(made: list[records.Record]) -> None:
    found = compare(made, ("a", "b"), LIMITS)
    assert (found.decisions, found.different, found.moments) == (1200, 0, [])
    assert found.then.driven_m == found.now.driven_m > 1.0


def test_a_more_careful_profile_is_slower_and_stops_farther_away(made: list[records.Record]) -> None:
    found = compare(made, ("then", "careful"), replace(LIMITS, forward_mm_s=200.0, stop_mm=900, avoid_mm=1000))
    assert found.now.top_mm_s == 200.0 < found.then.top_mm_s
    assert found.now.driven_m < found.then.driven_m
    assert found.moments
    assert ("top speed, mm/s", f"{found.then.top_mm_s:.5g}", "200") in found.rows()


def test_the_picture_of_a_comparison_is_well_formed_and_shows_both(made: list[records.Record]) -> None:
    found = compare(made, ("then <1>", "now"), replace(LIMITS, forward_mm_s=200.0))
    root = ET.fromstring(found.picture())
    words = "".join(root.itertext())
    assert "then <1>" in words
    assert "now" in words
    assert len(list(root.iter("{http://www.w3.org/2000/svg}polyline"))) >= 3


def test_what_if_on_the_command_line_writes_table_and_picture(recording: Path, tmp_path: Path) -> None:
    picture = tmp_path / "p.svg"
    result = CliRunner().invoke(
        app, ["replay", str(recording), "--what-if", "careful", "--picture", str(picture), "--json"]
    )
    assert result.exit_code == 0, result.output
    said = json.loads(result.output)
    assert said["different"] > 0
    assert any(row["what"] == "protective stops" for row in said["table"])
    ET.fromstring(picture.read_text())


def test_what_if_with_somebody_unknown_is_one_sentence(recording: Path) -> None:
    result = CliRunner().invoke(app, ["replay", str(recording), "--what-if", "nobody-here"])
    assert result.exit_code == 2
    assert "there is no profile 'nobody-here'" in result.output


def test_inspect_tells_who_drove_and_what_happened(recording: Path) -> None:
    found = tools.inspect(recording)
    assert (found.chair, found.person, found.decisions, found.missed) == ("sim", "demo", 1200, 0)
    assert found.protective_stops >= 1
    assert any("protective stop" in said["message"] for said in found.log)
    result = CliRunner().invoke(app, ["record", "inspect", str(recording), "--log"])
    assert "demo drove 'sim' with pic_serial" in result.output
    assert "warning: protective stop" in result.output


def test_inspect_says_of_a_cut_file_that_it_was_cut_and_of_no_other(recording: Path, tmp_path: Path) -> None:
    cut = tmp_path / "cut.mcap"
    whole = recording.read_bytes()
    for kept_bytes in (len(whole) - 1, len(whole) // 2):
        cut.write_bytes(whole[:kept_bytes])
        assert tools.inspect(cut).cut
        assert "it was cut" in CliRunner().invoke(app, ["record", "inspect", str(cut)]).output
    assert not tools.inspect(recording).cut
    assert "it was cut" not in CliRunner().invoke(app, ["record", "inspect", str(recording)]).output


def test_export_gives_a_row_for_every_decision(recording: Path, tmp_path: Path) -> None:
    tools.export(recording, tmp_path, "csv")
    with (tmp_path / "decisions.csv").open(newline="") as file:
        rows = list(csv.DictReader(file))
    assert [int(row["tick"]) for row in rows] == list(range(1200))
    assert max(float(row["told_drive_mm_s"]) for row in rows) > 400.0
    tools.export(recording, tmp_path, "jsonl")
    assert len((tmp_path / "decisions.jsonl").read_text().splitlines()) == 1200


def test_a_redacted_copy_tells_nobody_s_words_and_replays_bit_for_bit(recording: Path, tmp_path: Path) -> None:
    copy = tmp_path / "copy.mcap"
    assert redact(recording, copy) == 1200
    found = replay(copy, read_plan(copy).limits)
    assert (found.decisions, found.differences) == (1200, [])
    assert any(wish.word == "vorwärts" for record in read(recording) for wish in record.facts.heard)
    raw = b"".join(part for record in read(copy) for part in [records.encode(record)])
    assert "vorwärts".encode() not in raw
    named = read_plan(copy)
    assert (named.person, named.words, named.person_file) == ("somebody", {}, "")
    with pytest.raises(FileExistsError, match="is there already"):
        redact(recording, copy)


def told_of_places(tick: int, facts: Facts) -> Facts:
    """Devices and folders of a person "demo", in every text that a fact can have."""
    port, home = "/dev/serial/by-path/pci-0000:00:14.0-usb-0:1.2:1.0", "/home/anna maria/words.json"
    if tick == 3:
        return replace(facts, refused={VOICE: f"{home}: not a message ({port})"})
    if tick == 5:
        alive = replace(facts.alive[VOICE], well=False, reason=f"demo has no stop word in {home}")
        return replace(facts, alive={**facts.alive, VOICE: alive})
    if tick == 7:
        blind = tuple(replace(one, can_see=False, reason=f"{port} is 'the red one'") for one in facts.ranges[FRONT])
        return replace(facts, ranges={**facts.ranges, FRONT: blind})
    if tick == 9:
        return replace(facts, lost={PANEL: f"terminal /dev/pts/7 is gone ({port}): plug it in again"})
    if 11 <= tick < 15:
        return replace(facts, drive=replace(facts.drive, linked=False, fault=f"serial port {port} cannot be opened"))
    return facts


def test_a_redacted_copy_has_no_path_and_no_name_in_any_text_and_replays_bit_for_bit(tmp_path: Path) -> None:
    from chairward.messages import Button, Command

    base = profile.load("sim", None, [], discover())
    drive = dataclasses.replace(base.drive, settings={**base.drive.settings, "log": "/home/anna maria/words.json"})
    ride, state, made = Ride(limits=LIMITS), State(), []
    for tick in range(20):
        words = [ride.wish(Command.RESET, word="zurück")] if tick == 16 else []
        press = [Button.RESET] if tick in (0, 17) else [Button.ARM] if tick == 2 else []
        ride.tick(*words, press=press)
        made.append(recorded(tick, state, told_of_places(tick, ride.newest_facts), LIMITS))
        state = made[-1].after
    path, copy = kept(tmp_path, made, base=dataclasses.replace(base, drive=drive)), tmp_path / "copy.mcap"
    secret = re.compile(rb"(?<![\w/])/\w|demo|maria|zur|14.0|red one")
    before = b"".join(entry.data for entry in entries(path))
    assert {bytes(found) for found in secret.findall(before)} >= {
        b"/d",
        b"/h",
        b"demo",
        b"maria",
        b"zur",
        b"red one",
        b"14.0",
    }
    assert redact(path, copy) == 20
    found = replay(copy, read_plan(copy).limits)
    assert (found.decisions, found.differences) == (20, [])
    assert [hit for entry in entries(copy) for hit in secret.findall(entry.data)] == []
    assert any("serial port … cannot be opened" in record.decision.latch for record in read(copy))

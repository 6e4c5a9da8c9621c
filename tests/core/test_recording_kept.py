"""What a recording keeps, how much of it, and what people's tools make of it."""

from __future__ import annotations

import base64
import json
import os
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import jsonschema
import numpy as np
import pytest
from mcap.reader import make_reader
from msgspec.structs import replace

from chairward import frames, records
from chairward.components import Context
from chairward.facts import Decision, Why
from chairward.recording import LOG, Recorder, RecorderSettings, entries, messages, read, write
from chairward.recording.pictures import Keep, png
from chairward.recording.topics import TOPICS, schema
from chairward.stages import Pane
from chairward.testing.ride import Ride, recorded


def a_drive(count: int = 40) -> list[records.Record]:
    """Records of a chair that drives towards a wall and stops."""
    ride = Ride(reports_speed=True)
    ride.drive_off()
    made = []
    for tick in range(count):
        ride.world["front/range"] = {"ahead_mm": max(400, 1500 - 40 * tick)}
        before = ride.state
        ride.tick()
        now = ride.newest_facts.now_ns
        stamps = {"woke_ns": now + 50_000, "wrote_ns": now + 300_000, "newest_sent_ns": now}
        made.append(recorded(tick, before, ride.newest_facts, ride.limits, frame=b"\x01\x02", **stamps))
    return made


def recorder(folder: Path, rings: dict[str, int] | None = None, **settings: Any) -> Recorder:
    context = Context(lane="recorder", run_dir=folder, chair_dir=folder, frames=rings or {})
    return Recorder(RecorderSettings(path=Path("r.mcap"), **settings), context)


def until(true: Callable[[], bool], what: str, seconds: float = 20.0) -> None:
    end = time.monotonic() + seconds
    while not true():
        assert time.monotonic() < end, f"waited for {what}"
        time.sleep(0.02)


def test_every_message_fits_the_schema_that_the_file_gives_for_it(tmp_path: Path) -> None:
    it = recorder(tmp_path)
    for record in a_drive():
        it.observe(records.encode(record))
    it.close()
    seen = set()
    with (tmp_path / "r.mcap").open("rb") as file:
        for form, _channel, message in make_reader(file, validate_crcs=True).iter_messages():
            if form is not None:
                jsonschema.validate(json.loads(message.data), json.loads(form.data))
                seen.add(form.name)
    assert seen == {"chairward.Decided", "chairward.Reading", "chairward.Driven", "chairward.Timing", "foxglove.Log"}


@pytest.mark.parametrize("topic", TOPICS)
def test_schemas_are_such_as_viewers_can_follow(topic: str) -> None:
    name, kind = TOPICS[topic]

    def simple(part: Any) -> None:
        if isinstance(part, dict):
            assert "$ref" not in part
            assert not isinstance(part.get("type"), list), "a field is left out, never null"
            for value in part.values():
                simple(value)

    made = json.loads(schema(name, kind))
    simple(made)
    assert made["title"] == name
    assert made["type"] == "object"


def test_the_protective_stop_is_in_the_log_with_its_reason(tmp_path: Path) -> None:
    it = recorder(tmp_path)
    for record in a_drive():
        it.observe(records.encode(record))
    it.close()
    said = [json.loads(data)["message"] for data in messages(tmp_path / "r.mcap", LOG)]
    assert any(line.startswith("protective stop: stop_distance front/range") for line in said)


def with_stop(record: records.Record) -> bytes:
    stopped = replace(record.decision, protective_stop=True, reasons=(Why(rule="stop_distance"),))
    now = replace(record.facts, now_ns=time.monotonic_ns())
    return records.encode(replace(record, decision=stopped, facts=now))


@pytest.mark.parametrize(
    ("keep", "stops", "kept"),
    [(Keep.NEVER, True, False), (Keep.STOPS, False, False), (Keep.STOPS, True, True), (Keep.ALWAYS, False, True)],
)
def test_pictures_are_kept_only_where_the_profile_or_a_stop_allows(
    tmp_path: Path, keep: Keep, stops: bool, kept: bool
) -> None:
    fd = frames.create()
    writer = frames.FrameWriter(fd)
    image = np.arange(48 * 64 * 3, dtype=np.uint32).astype(np.uint8).reshape(48, 64, 3)
    it = recorder(tmp_path, {"front": fd}, pictures=keep, pictures_hz=20.0)
    for nth in range(10):
        writer.write({"left": Pane(name="left", image=image, captured_ns=time.monotonic_ns())})
        it.observe(with_stop(a_drive(1)[0]) if stops and nth == 9 else records.encode(a_drive(1)[0]))
        time.sleep(0.06)
    if kept:
        until(lambda: any("pictures" in e.topic for e in entries(tmp_path / "r.mcap")), "a picture on the disk")
    it.close()
    found = [e for e in entries(tmp_path / "r.mcap") if e.topic == "chairward/pictures/front/left"]
    assert bool(found) == kept
    for entry in found:
        jsonschema.validate(json.loads(entry.data), json.loads(schema(*TOPICS["chairward/pictures"])))
    writer.close()
    os.close(fd)


def test_a_picture_is_a_png_that_shows_what_was_seen() -> None:
    cv2 = pytest.importorskip("cv2")
    image = np.random.default_rng(1).integers(0, 256, (30, 40, 3), dtype=np.uint8)
    back = cv2.imdecode(np.frombuffer(png(image), np.uint8), cv2.IMREAD_COLOR)
    assert np.array_equal(back, image & 0xF8)
    grey = cv2.imdecode(np.frombuffer(png(image[..., 0]), np.uint8), cv2.IMREAD_GRAYSCALE)
    assert np.array_equal(grey, image[..., 0] & 0xF8)


def test_a_long_run_is_kept_in_parts_and_the_oldest_go(tmp_path: Path) -> None:
    it = recorder(tmp_path, part_mb=1, parts=2)
    noise = np.random.default_rng(1)
    record = a_drive(1)[0]
    for tick in range(600):  # text that cannot be packed: 8 kB a record
        text = base64.b64encode(noise.bytes(6000)).decode()
        said = replace(record.decision, notes=(text,))
        it.observe(records.encode(replace(record, tick=tick, decision=said)))
    it.close()
    parts = sorted(tmp_path.glob("*.mcap"))
    assert len(parts) == 2
    assert sum(part.stat().st_size for part in parts) < 4_000_000
    last = max(parts, key=lambda part: [r.tick for r in read(part)][-1])
    assert [r.tick for r in read(last)][-1] == 599


def test_a_recorder_that_is_started_again_in_a_run_goes_on_with_the_next_part(tmp_path: Path) -> None:
    made = a_drive(6)
    for some in (made[:3], made[3:]):
        it = recorder(tmp_path)
        for record in some:
            it.observe(records.encode(record))
        it.close()
    assert [[r.tick for r in read(tmp_path / name)] for name in ("r.mcap", "r.2.mcap")] == [[0, 1, 2], [3, 4, 5]]


def test_a_recorder_that_dies_again_and_again_does_not_push_out_what_it_has_recorded(tmp_path: Path) -> None:
    for record in a_drive(6):
        it = recorder(tmp_path, parts=2)
        it.observe(records.encode(record))
        it.close()
    assert [r.tick for r in read(tmp_path / "r.mcap")] == [0]
    assert len(list(tmp_path.glob("*.mcap"))) == 6


def test_a_disk_that_takes_nothing_is_told_and_counted(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(write, "TRY_AGAIN_S", 0.0)
    (tmp_path / "r.mcap").symlink_to("/dev/full")
    it = recorder(tmp_path)
    for record in a_drive(40):
        it.observe(records.encode(record))
    it.close()
    report = json.loads((tmp_path / "report-recorder.json").read_text())
    assert "No space left" in report["trouble"]
    assert [r.tick for r in read(tmp_path / "r.2.mcap")] == list(range(40)), "and the next file takes it all"


def test_records_that_were_missed_are_said_in_the_next_one_and_in_the_log(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(write, "TRY_AGAIN_S", 3600.0)
    it = recorder(tmp_path)
    made = a_drive(6)
    it.observe(records.encode(made[0]))
    it._give_up(OSError("the disk was taken away"))
    for record in made[1:4]:
        it.observe(records.encode(record))
    it._again_s = 0.0  # an hour later
    it.observe(records.encode(made[4]))
    it.close()
    later = tmp_path / "r.2.mcap"
    assert [(r.tick, r.missed) for r in read(later)] == [(4, 3)]
    assert "3 decisions before this one were not recorded" in next(iter(messages(later, LOG))).decode()
    assert json.loads((tmp_path / "report-recorder.json").read_text())["missed"] == 3


def test_the_shipped_default_keeps_pictures_round_stops_only() -> None:
    assert RecorderSettings().pictures is Keep.STOPS
    assert Decision().protective_stop is False

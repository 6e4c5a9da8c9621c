"""What can be done with a recording: look into it, take tables and pictures out of it."""

from __future__ import annotations

import base64
import csv
import json
from collections import Counter
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Literal

from chairward import records
from chairward.facts import S
from chairward.recording.read import entries, is_cut, read_plan
from chairward.recording.topics import LOG, PICTURES, PINS, PLAN, RECORDS, TOPICS

Format = Literal["csv", "jsonl"]


@dataclass(slots=True)
class Contents:
    """What a recording holds. seconds: from the first record to the last; missed: records that it lacks, as it says.

    cut: it has no end, so what came after the last record in it is lost (or is still to be written).
    """

    file: str
    size: int
    cut: bool
    chair: str = ""
    person: str = ""
    drive: str = ""
    seconds: float = 0.0
    decisions: int = 0
    missed: int = 0
    protective_stops: int = 0
    pictures: int = 0
    messages: dict[str, int] = field(default_factory=dict)
    log: list[dict[str, Any]] = field(default_factory=list)


def inspect(path: Path) -> Contents:
    """What is in it. Raises OSError, McapError."""
    found = Contents(str(path), path.stat().st_size, is_cut(path))
    counts: Counter[str] = Counter()
    began_ns = 0
    for entry in entries(path):
        counts[entry.topic] += 1
        if entry.topic == RECORDS:
            began_ns = began_ns or entry.at_ns
            found.seconds = round((entry.at_ns - began_ns) / S, 2)
            record = records.decode(entry.data)
            found.missed += record.missed
            found.protective_stops += record.decision.protective_stop
        elif entry.topic == LOG:
            said = json.loads(entry.data)
            at_s = round((entry.at_ns - began_ns) / S, 2) if began_ns else 0.0
            found.log.append({"at_s": at_s, "level": said["level"], "message": said["message"]})
    found.decisions = counts[RECORDS]
    found.pictures = sum(count for topic, count in counts.items() if topic.startswith(PICTURES))
    found.messages = dict(sorted(counts.items()))
    if counts[PLAN]:
        plan = read_plan(path)
        found.chair, found.person, found.drive = plan.chair, plan.person, plan.drive.component
    return found


def export(path: Path, folder: Path, form: Format) -> list[Path]:
    """One table for each readable topic, and the pictures as files; what was written. Raises OSError, McapError."""
    folder.mkdir(parents=True, exist_ok=True)
    rows: dict[str, list[dict[str, Any]]] = {}
    written = []
    for entry in entries(path):
        if entry.topic.startswith(f"{PICTURES}/"):
            name = entry.topic.removeprefix(f"{PICTURES}/").replace("/", "-")
            picture = folder / f"{name}-{entry.at_ns}.png"
            picture.write_bytes(base64.b64decode(json.loads(entry.data)["data"]))
            written.append(picture)
        elif entry.topic in TOPICS or entry.topic == PINS:
            rows.setdefault(entry.topic.rpartition("/")[2], []).append({"at_ns": entry.at_ns, **json.loads(entry.data)})
    for name, table in rows.items():
        target = folder / f"{name}.{form}"
        with target.open("w", encoding="utf-8", newline="") as file:
            if form == "jsonl":
                file.writelines(json.dumps(row) + "\n" for row in table)
            else:
                columns = list(dict.fromkeys(key for row in table for key in row))
                writer = csv.DictWriter(file, columns)
                writer.writeheader()
                writer.writerows(table)
        written.append(target)
    return sorted(written)

"""Writing what was measured into a chair file, comments and order kept (tomlkit)."""

from __future__ import annotations

import re
from collections.abc import Mapping
from datetime import date
from pathlib import Path
from typing import Any

import tomlkit
from tomlkit.items import Item, String

MEASURED = re.compile(r"(^|[;,] *)measured?\b.*$")
"""What an earlier call, or a template ("measure"), says at the end of a comment."""


def write_drive(path: Path, drive: str, values: Mapping[str, Any], note: str) -> list[str]:
    """Set keys of [drive.NAME], each with `note` as its comment; the keys that were set.

    A value that refers to another setting ("@sim_home.full_speed_mm_s") stays. Replaces the file in one step.
    """
    document = tomlkit.parse(path.read_text(encoding="utf-8"))
    table: Any = document["drive"][drive]
    written = []
    for key, value in values.items():
        if isinstance(table.get(key), String) and str(table[key]).startswith("@"):
            continue
        item = tomlkit.item(value)
        if note_of := _comment(table.get(key), value, note):
            item.comment(note_of)
        table[key] = item
        written.append(key)
    part = path.with_name(f"{path.name}.part")
    part.write_text(tomlkit.dumps(document), encoding="utf-8")
    part.replace(path)
    return written


def _comment(old: Any, value: Any, note: str) -> str:
    """What the line's comment says after: what a person wrote there is kept, what we wrote before is replaced."""
    if isinstance(value, str | date):
        return ""
    kept = MEASURED.sub("", old.trivia.comment.removeprefix("#").strip()) if isinstance(old, Item) else ""
    return f"{kept}; {note}" if kept else note

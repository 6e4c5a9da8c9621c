"""What the measurements of the hands write: one JSON file each, with the machine they were made on."""

from __future__ import annotations

import hashlib
import json
import os
import platform
from pathlib import Path
from typing import Any

import chairward_drive_pic_serial

RESULTS = Path(__file__).parent / "results"


def machine() -> dict[str, Any]:
    """Where and how busy."""
    return {
        "python": platform.python_version(),
        "cpus": os.cpu_count(),
        "load_1min": round(os.getloadavg()[0], 2),
    }


def of_sources(*parts: str) -> str:
    """A short digest of source files of the PIC plugin: figures of other sources are not added to."""
    folder = Path(chairward_drive_pic_serial.__file__).parent
    digest = hashlib.sha256()
    for part in parts:
        for path in sorted(folder.glob(part)):
            digest.update(path.read_bytes())
    return digest.hexdigest()[:12]


def save(name: str, result: dict[str, Any]) -> None:
    """Write results/NAME.json in one step."""
    part = RESULTS / f"{name}.part"
    part.write_text(json.dumps(result, indent=1) + "\n", encoding="utf-8")
    part.replace(RESULTS / f"{name}.json")


def saved(name: str, sources: str) -> dict[str, Any]:
    """What an earlier, unfinished call has left; {} when there is none or when it was made with other sources."""
    path = RESULTS / f"{name}.json"
    if not path.exists():
        return {}
    result: dict[str, Any] = json.loads(path.read_text(encoding="utf-8"))
    return result if result.get("sources") == sources else {}


def spread(values: list[float]) -> dict[str, float]:
    """n, p50, p99 and the extremes, in the unit of the values."""
    ordered = sorted(values)
    last = len(ordered) - 1
    at = {"min": 0.0, "p50": 0.5, "p99": 0.99, "max": 1.0}
    return {"n": len(ordered), **{name: round(ordered[round(last * share)], 3) for name, share in at.items()}}

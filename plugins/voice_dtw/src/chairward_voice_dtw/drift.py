"""Does a voice still sound as it was recorded? Scores of accepted words, day by day, and a sentence when they sink.

    <person_dir>/<words folder>/heard.json   {"version": 1, "days": {"2026-11-22": {"n": 40, "score": 3.1}}}

score is the mean of the day's runs' median log-odds. Written when a run ends; a broken file is begun anew, since
nothing depends on it.
"""

from __future__ import annotations

import json
from collections.abc import Sequence
from datetime import date
from pathlib import Path
from typing import Any

import numpy as np

VERSION = 1
FILE = "heard.json"
KEEP_DAYS = 120
FEWEST_WORDS = 20
COMPARED_DAYS = 5
SUNK = 1.5
"""Log-odds: three quarters of the odds are gone by then."""


def _read(path: Path) -> dict[str, dict[str, Any]]:
    try:
        data = json.loads(path.read_text(encoding="utf-8"))
        days = data["days"] if data["version"] == VERSION else {}
        return {str(day): {"n": int(v["n"]), "score": float(v["score"])} for day, v in days.items()}
    except (OSError, ValueError, KeyError, TypeError, AttributeError):
        return {}


def note(folder: Path, day: date, scores: Sequence[float]) -> None:
    """Add a run's scores to its day. Raises OSError."""
    if not scores:
        return
    days = _read(folder / FILE)
    before = days.get(day.isoformat(), {"n": 0, "score": 0.0})
    count = before["n"] + len(scores)
    mean = (before["n"] * before["score"] + len(scores) * float(np.median(scores))) / count
    days[day.isoformat()] = {"n": count, "score": round(mean, 3)}
    kept = {name: days[name] for name in sorted(days)[-KEEP_DAYS:]}
    part = folder / (FILE + ".part")
    part.write_text(json.dumps({"version": VERSION, "days": kept}, indent=1), encoding="utf-8")
    part.replace(folder / FILE)


def forget(folder: Path) -> None:
    """After new recordings the old days say nothing. Raises OSError."""
    (folder / FILE).unlink(missing_ok=True)


def proposal(folder: Path) -> str:
    """ "" or a sentence: the last days' words fit their recordings much worse than the first days' did."""
    days = [day for _, day in sorted(_read(folder / FILE).items()) if day["n"] >= FEWEST_WORDS]
    if len(days) < 2 * COMPARED_DAYS:
        return ""
    first = float(np.median([day["score"] for day in days[:COMPARED_DAYS]]))
    last = float(np.median([day["score"] for day in days[-COMPARED_DAYS:]]))
    if first - last < SUNK:
        return ""
    return (
        f"the words sound less like their recordings than they used to (score {last:.1f}, at first {first:.1f}): "
        "record them again, or make a second set with --set"
    )

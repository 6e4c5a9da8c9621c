"""A lane's device lent to set-up: while it is, the lane keeps it closed and counts as lost, so nothing moves.

Whoever calibrates cameras needs the cameras themselves, and only one program can have them. A file in the run's folder:
a screen writes it, the lane looks for it before it opens its source and at every item.
"""

from __future__ import annotations

from pathlib import Path

REASON = "its device is lent to set-up"


def file(run_dir: Path, lane: str) -> Path:
    """The file that lends a lane's device."""
    return run_dir / f"lent-{lane}"


def lend(run_dir: Path, lane: str) -> None:
    """Ask the lane to close its device."""
    file(run_dir, lane).touch(mode=0o600)


def take_back(run_dir: Path, lane: str) -> None:
    """The lane may have it again; may be called twice."""
    file(run_dir, lane).unlink(missing_ok=True)

"""What a screen may ask of the run as a whole: to begin again with another person's profile, or to end.

A file in the run's folder: the lane that has the screen writes it, the supervisor looks for it and ends the run (the
chair first, as always) if the chair stands, and `chairward run` loads the plan anew. Nothing of a running plan changes.
"""

from __future__ import annotations

import logging
from pathlib import Path
from typing import Annotated

import msgspec

log = logging.getLogger(__name__)

FILE = "next.json"
REASON = "a screen asked for it"
"""How such a run says that it ended."""


class NextRun(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """person: who drives next; "": nobody, the run just ends."""

    person: Annotated[str, msgspec.Meta(max_length=200)]


def ask(run_dir: Path, wanted: NextRun) -> None:
    """Ask for it; in one step, so that nobody reads half of it."""
    part = run_dir / f"{FILE}.part"
    part.write_bytes(msgspec.json.encode(wanted))
    part.replace(run_dir / FILE)


def asked(run_dir: Path) -> NextRun | None:
    """What has been asked for, if anything that makes sense."""
    try:
        return msgspec.json.decode((run_dir / FILE).read_bytes(), type=NextRun)
    except FileNotFoundError:
        return None
    except (OSError, msgspec.DecodeError, UnicodeDecodeError) as error:
        log.warning("%s cannot be read (%s) and is left alone", run_dir / FILE, error)
        (run_dir / FILE).unlink(missing_ok=True)
        return None


def forget(run_dir: Path) -> None:
    """Nobody asks any more."""
    (run_dir / FILE).unlink(missing_ok=True)

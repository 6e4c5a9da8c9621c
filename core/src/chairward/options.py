"""What the supervisor tells each process on its command line, as JSON. Descriptors are inherited."""

from __future__ import annotations

import msgspec


class GuardOptions(msgspec.Struct, frozen=True):
    """lanes: the guard's end of each lane's line. observers: the guard's end of each observer's."""

    plan: str
    run_dir: str
    control: int
    lanes: dict[str, int]
    observers: list[int]


class LaneOptions(msgspec.Struct, frozen=True):
    """guard: the lane's end of its line. control: to the supervisor. frames: the memory for its pictures.

    records, rings: only for a lane that observes: where records arrive, and every lane's pictures, read-only.
    """

    plan: str
    run_dir: str
    lane: str
    guard: int
    control: int
    frames: int = -1
    records: int = -1
    rings: dict[str, int] = {}


class BesideOptions(msgspec.Struct, frozen=True):
    """kind: companion or observer. pipe: where a companion says "ready", where an observer gets its records.

    rings: for an observer, every lane's pictures, read-only.
    """

    plan: str
    run_dir: str
    kind: str
    name: str
    pipe: int
    rings: dict[str, int] = {}

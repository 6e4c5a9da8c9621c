"""Starting the lanes and observers of a run, each with its ends of its lines and the pictures that it may see."""

from __future__ import annotations

import os
import socket
from collections.abc import Mapping
from pathlib import Path

from chairward import frames, wire
from chairward.companions import plan_file
from chairward.options import BesideOptions, LaneOptions
from chairward.plan import LanePlan
from chairward.processes import Process, spawn

RECORD_BUFFER_BYTES = 4 * 1024 * 1024


def start_lane(
    lane: LanePlan, run_dir: Path, rings: Mapping[str, int]
) -> tuple[Process, socket.socket, socket.socket, socket.socket | None]:
    """The lane's process, the supervisor's end of its line, and the guard's: of its line, and of its records if any.

    rings: by lane, the memory for its pictures.
    """
    guard_end, lane_end = wire.pair()
    ours, theirs = wire.pair()
    passed = [lane_end, theirs]
    records_end, seen = None, {}
    if lane.observes:
        records_end, lane_records = wire.pair(RECORD_BUFFER_BYTES)
        passed.append(lane_records)
        seen = {name: frames.read_only(fd) for name, fd in rings.items()}
    options = LaneOptions(
        plan=str(plan_file(run_dir)),
        run_dir=str(run_dir),
        lane=lane.name,
        guard=lane_end.fileno(),
        control=theirs.fileno(),
        frames=rings[lane.name],
        records=passed[-1].fileno() if lane.observes else -1,
        rings=seen,
    )
    fds = [*(end.fileno() for end in passed), rings[lane.name], *seen.values()]
    process = spawn(run_dir, "chairward.lane", options, f"lane-{lane.name}", fds)
    _given(passed, seen)
    return process, ours, guard_end, records_end


def start_observer(name: str, run_dir: Path, rings: Mapping[str, int]) -> tuple[Process, socket.socket]:
    """The observer's process, and the guard's end of its line. Raises OSError."""
    guard_end, its_end = wire.pair(RECORD_BUFFER_BYTES)
    seen = {lane: frames.read_only(fd) for lane, fd in rings.items()}
    options = BesideOptions(str(plan_file(run_dir)), str(run_dir), "observer", name, its_end.fileno(), seen)
    try:
        process = spawn(run_dir, "chairward.beside", options, name, [its_end.fileno(), *seen.values()])
    except OSError:
        guard_end.close()
        raise
    finally:
        _given([its_end], seen)
    return process, guard_end


def _given(ends: list[socket.socket], seen: Mapping[str, int]) -> None:
    """What only the new process may hold now, or its end would never read as closed."""
    for end in ends:
        end.close()
    for fd in seen.values():
        os.close(fd)

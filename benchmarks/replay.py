"""Replay measured on recordings: is every decision reproduced, how fast, and what does a file give that was cut?

    python benchmarks/replay.py RECORDING... [--cuts 1000] [--out benchmarks/results/replay.json]

Record ten minutes first: chairward demo --headless --for 600s --record RECORDING (or several shorter ones)
CPU time of one process is given beside wall time: what a busy machine does to the latter says nothing about replay.
"""

from __future__ import annotations

import argparse
import json
import os
import platform
import random
import shutil
import tempfile
import time
from itertools import accumulate
from pathlib import Path
from typing import Any

from mcap.reader import make_reader

from chairward import records
from chairward.arbiter import decide
from chairward.recording import RECORDS, messages, read_plan, tools
from chairward.recording.read import parts, walk
from chairward.replay import replay


def reproduced(path: Path) -> dict[str, Any]:
    """All decisions, by one process and by all."""
    limits = read_plan(path).limits
    cpu, wall = time.process_time(), time.perf_counter()
    found = replay(path, limits, cores=1)
    cpu_s, wall_s = time.process_time() - cpu, time.perf_counter() - wall
    wall = time.perf_counter()
    shared = replay(path, limits)
    shared_s = time.perf_counter() - wall
    assert shared == found
    return {
        "recorded_s": round(found.seconds, 1),
        "decisions": found.decisions,
        "reproduced_bit_for_bit": found.decisions - len(found.differences),
        "missing": found.missing,
        "decisions_a_second": round(found.decisions / found.seconds, 1),
        "us_a_decision_cpu": round(cpu_s / found.decisions * 1e6, 1),
        "us_a_decision_cpu_in_decide": round(deciding(path) / found.decisions * 1e6, 1),
        "times_real_time_one_core_cpu": round(found.seconds / cpu_s),
        "times_real_time_one_core_wall": round(found.seconds / wall_s),
        "times_real_time_all_cores_wall": round(found.seconds / shared_s),
        "cores": os.cpu_count(),
    }


def deciding(path: Path) -> float:
    """Processor time of decide() alone, s: chunk by chunk, so that what it decides from is as warm as in a replay."""
    limits, topics, taken = read_plan(path).limits, dict[int, str](), 0.0
    for part in parts(path):
        known = [records.decode(entry.data) for entry in walk(part, topics, RECORDS)]
        began = time.process_time()
        for record in known:
            decide(record.before, record.facts, limits)
        taken += time.process_time() - began
    return taken


def cut(path: Path, cuts: int, seed: int) -> dict[str, Any]:
    """Cut the file at random places: does it still open, is what it gives a beginning of what was recorded, and is
    everything there that stood in it before the cut?

    What stands where is told by the mcap library's index, what is in it by the file before it was cut.
    """
    whole = list(messages(path, RECORDS))
    topics: dict[int, str] = {}
    with path.open("rb") as file:
        summary = make_reader(file).get_summary()
        assert summary is not None
        ends = [one.chunk_start_offset + one.chunk_length for one in summary.chunk_indexes]
    counts = [sum(1 for _ in walk(part, topics, RECORDS)) for part in parts(path, 0, len(ends))]
    counts = counts[-len(ends) :]  # what stands before the first chunk holds no records
    before = dict(zip(ends, accumulate(counts), strict=True))
    chance, size = random.Random(seed), path.stat().st_size
    opened = wrong = lost = extra = 0
    with tempfile.TemporaryDirectory() as folder:
        part = Path(folder) / "cut.mcap"
        shutil.copy(path, part)
        for at in sorted((chance.randrange(8, size) for _ in range(cuts)), reverse=True):
            os.truncate(part, at)
            got = list(messages(part, RECORDS))  # raises where it does not open
            opened += 1
            wrong += got != whole[: len(got)]
            written = max((count for end, count in before.items() if end <= at), default=0)
            lost += len(got) < written
            extra += len(got) - written
    return {
        "cuts": cuts,
        "opened": opened,
        "not_a_beginning": wrong,
        "without_something_that_stood_before_the_cut": lost,
        "records_of_the_chunk_that_was_cut_on_average": round(extra / cuts, 1),
    }


def measured(path: Path, cuts: int) -> dict[str, Any]:
    """Everything of one recording."""
    contents = tools.inspect(path)
    return {
        "file_mb": round(contents.size / 1e6, 1),
        "protective_stops": contents.protective_stops,
        "pictures": contents.pictures,
        "missed_by_the_recorder": contents.missed,
        **reproduced(path),
        **cut(path, cuts, seed=1),
    }


def main() -> None:
    """Measure and write."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("recordings", type=Path, nargs="+")
    parser.add_argument("--cuts", type=int, default=1000, help="of all recordings together")
    parser.add_argument("--out", type=Path, default=Path(__file__).parent / "results" / "replay.json")
    given = parser.parse_args()
    result = {
        "what": "replay of recorded demos, bit for bit; and the same files cut at random places",
        "python": platform.python_version(),
        "load_1min": round(os.getloadavg()[0], 2),
        "recordings": [measured(path, given.cuts // len(given.recordings)) for path in given.recordings],
    }
    text = json.dumps(result, indent=1)
    given.out.write_text(text + "\n")
    print(text)


if __name__ == "__main__":
    main()

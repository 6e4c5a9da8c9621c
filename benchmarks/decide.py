"""How long one decision takes with 3, 10, 30 and 100 sensors: percentiles of wall and CPU time, in microseconds.

    .venv/bin/python benchmarks/decide.py            writes benchmarks/results/decide.json

Twice: with nothing near, and with something near every second sensor, so that half of them vote. Wall time includes
whatever else the machine does; CPU time of the thread does not. The garbage collector is off, as it is in the guard
between ticks.
"""

from __future__ import annotations

import gc
import json
import os
import platform
import time
from pathlib import Path

from msgspec.structs import replace

from chairward.arbiter import decide
from chairward.components import Motion
from chairward.facts import MS, Facts, Limits, SourceLimits, State
from chairward.testing.ride import AHEAD_AND_SIDES, START_NS, chair_limits, driving, healthy, readings

SENSORS = (3, 10, 30, 100)
NEAR_MM = (3_000, 1_000)
"""Far enough for no rule to vote about it, and within the room that rule 3 cares about."""
DECISIONS = 20_000
RESULTS = Path(__file__).parent / "results" / "decide.json"


def case(sensors: int, near_mm: int) -> tuple[State, Facts, Limits]:
    """A chair that drives; every second sensor sees something near_mm ahead."""
    need = SourceLimits(freshness_ns=200 * MS, covers=AHEAD_AND_SIDES)
    limits = chair_limits(sensors={f"lane{i}/range": need for i in range(sensors)}, steer_deg_s=8.0)
    said = {
        f"lane{i}/range": readings(START_NS, ahead_mm=near_mm if i % 2 else 3_000, left_mm=900, right_mm=800)
        for i in range(sensors)
    }
    return driving(output=Motion(300.0, 0.0)), replace(healthy(limits), ranges=said), limits


def percentiles(times_ns: list[int]) -> dict[str, float]:
    """p50, p99, p99.9 and the largest, in microseconds."""
    times_ns.sort()
    last = len(times_ns) - 1
    at = {"p50": 0.5, "p99": 0.99, "p99.9": 0.999, "max": 1.0}
    return {name: round(times_ns[int(last * share)] / 1_000, 1) for name, share in at.items()}


def measure(sensors: int, near_mm: int) -> dict[str, object]:
    """Wall and CPU time of many equal decisions."""
    state, facts, limits = case(sensors, near_mm)
    wall, cpu = [], []
    for _ in range(DECISIONS):
        a, b = time.perf_counter_ns(), time.thread_time_ns()
        decide(state, facts, limits)
        d, c = time.thread_time_ns(), time.perf_counter_ns()
        wall.append(c - a)
        cpu.append(d - b)
    return {"sensors": sensors, "near_mm": near_mm, "wall_us": percentiles(wall), "cpu_us": percentiles(cpu)}


def main() -> None:
    """Measure and write."""
    gc.collect()
    gc.disable()
    rows = [measure(sensors, near_mm) for near_mm in NEAR_MM for sensors in SENSORS]
    result = {
        "what": "time of one decide(), microseconds",
        "decisions": DECISIONS,
        "python": platform.python_version(),
        "cpus": os.cpu_count(),
        "load_1min": round(os.getloadavg()[0], 2),
        "rows": rows,
    }
    RESULTS.parent.mkdir(exist_ok=True)
    RESULTS.write_text(json.dumps(result, indent=1) + "\n")
    print(json.dumps(rows, indent=1))


if __name__ == "__main__":
    main()

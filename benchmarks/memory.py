"""Does a run grow? Memory, descriptors and threads of every process of a chair that drives, stops and loses lanes.

    nice .venv/bin/python benchmarks/memory.py [--minutes 60]        writes benchmarks/results/memory.json

Real processes in real time (the rig of tests/safety): every minute a lane is killed and comes back, every minute
another sends what is not a message. The first minutes are warming up: growth counts from `warm_minutes` on.
"""

from __future__ import annotations

import argparse
import json
import os
import platform
import signal
import sys
import tempfile
import time
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
sys.path[:0] = [str(ROOT / "tests" / "safety"), str(ROOT / "tests" / "safety" / "zoo")]
RESULTS = ROOT / "benchmarks" / "results" / "memory.json"

from rig import Rig, load, running  # noqa: E402

from chairward.records import Record  # noqa: E402

LANES = ("front", "voice", "panel")
TROUBLE_EVERY_S = 60.0
SAMPLE_EVERY_S = 10.0
KEPT_RECORDS = 500


def size(pid: int) -> dict[str, int]:
    """Resident kB, open descriptors and threads of a process."""
    status = dict(line.split(":", 1) for line in Path(f"/proc/{pid}/status").read_text().splitlines())
    return {
        "rss_kb": int(status["VmRSS"].split()[0]),
        "descriptors": len(os.listdir(f"/proc/{pid}/fd")),
        "threads": int(status["Threads"]),
    }


def trouble(rig: Rig, nth: int) -> None:
    """Kill a lane, or let one send rubbish for two seconds; then drive again."""
    lane = LANES[nth % len(LANES)]
    if nth % 2:
        rig.misbehave("front", "nan")
        time.sleep(2.0)
        rig.behave("front")
    else:
        os.kill(rig.pid(lane), signal.SIGKILL)
        time.sleep(1.0)
    rig.wait(rig.driving, f"the chair to drive again after trouble {nth}", 60.0)


def keep_few(rig: Rig) -> None:
    """The rig keeps every record for its tests; here that would be the growth that is looked for."""

    def on_record(record: Record) -> None:
        rig.records.append(record)
        del rig.records[:-KEPT_RECORDS]

    rig.supervisor.on_record = on_record


def watch(rig: Rig, seconds: float) -> list[dict[str, object]]:
    """Samples of every process that lives through it, and of the run's own process (the supervisor)."""
    names = {"guard": rig.pid("guard"), "controller": rig.pid("pic"), "supervisor": os.getpid()}
    samples: list[dict[str, object]] = []
    began = time.monotonic()
    decisions, nth, trouble_s = 0, 0, TROUBLE_EVERY_S
    while (now_s := time.monotonic() - began) < seconds:
        time.sleep(SAMPLE_EVERY_S)
        decisions = rig.records[-1].tick
        samples.append({"at_s": round(now_s), "decisions": decisions, **{n: size(pid) for n, pid in names.items()}})
        if now_s >= trouble_s:
            trouble(rig, nth)
            nth, trouble_s = nth + 1, trouble_s + TROUBLE_EVERY_S
    return samples


def grown(samples: list[dict[str, dict[str, int]]], name: str, what: str, warm_s: float) -> dict[str, int]:
    """A figure at the end of warming up, at the end, the most, and by how much that is more than after warming up."""
    values = [s[name][what] for s in samples if int(s["at_s"]) >= warm_s]  # type: ignore[call-overload]
    return {"warm": values[0], "end": values[-1], "most": max(values), "grew": max(values) - values[0]}


def main() -> None:
    """Drive for so long, then compare."""
    import chairward_zoo

    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--minutes", type=float, default=60.0)
    parser.add_argument("--warm-minutes", type=float, default=5.0)
    parser.add_argument("--out", type=Path, default=RESULTS)
    options = parser.parse_args()
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        os.environ["PYTHONPATH"] = str(chairward_zoo.install(folder / "zoo"))
        sys.path.insert(0, os.environ["PYTHONPATH"])
        with running(load(folder), folder / "run") as rig:
            keep_few(rig)
            samples = watch(rig, options.minutes * 60.0)
            events = len(rig.supervisor.events)
    result = {
        "what": "processes of a driving chair whose lanes die and send rubbish in turn, once a minute",
        "minutes": options.minutes,
        "warm_minutes": options.warm_minutes,
        "decisions": samples[-1]["decisions"],
        "events": events,
        "python": platform.python_version(),
        "grown": {
            process: {
                what: grown(samples, process, what, options.warm_minutes * 60.0)  # type: ignore[arg-type]
                for what in ("rss_kb", "descriptors", "threads")
            }
            for process in ("guard", "controller", "supervisor")
        },
        "samples": samples[:: max(1, len(samples) // 60)],
    }
    options.out.write_text(json.dumps(result, indent=1) + "\n")
    print(json.dumps(result["grown"], indent=1))


if __name__ == "__main__":
    main()

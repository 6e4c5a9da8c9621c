"""The guard's figures under SCHED_FIFO: tick lateness, and from a reading sent to the stop's bytes written.

    .venv/bin/python benchmarks/guard.py ticks --neighbours 4 --seconds 150        add a piece to the ten minutes
    .venv/bin/python benchmarks/guard.py stops --neighbours 0 --seconds 60         readings that stop the chair
    .venv/bin/python benchmarks/guard.py zoo --seconds 4                           beside each animal of the zoo
    .venv/bin/python benchmarks/guard.py report                                    writes benchmarks/results/guard.json

Real processes: zoo citizens as lanes (tests/safety/zoo), the real serial drive, a simulated PIC. Every piece is kept in
WORK as one line. On a virtual machine the processors are now and then given to others (steal): seconds without any are
told apart, for what a hypervisor takes no program can give back.
"""

from __future__ import annotations

import argparse
import contextlib
import json
import multiprocessing
import os
import platform
import signal
import sys
import tempfile
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

ROOT = Path(__file__).resolve().parents[1]
sys.path[:0] = [str(ROOT / "tests" / "safety"), str(ROOT / "tests" / "safety" / "zoo")]
RESULTS = ROOT / "benchmarks" / "results" / "guard.json"

from rig import CHAIR, Rig, load, running  # noqa: E402

from chairward import processes  # noqa: E402
from chairward.durations import percentiles_ms  # noqa: E402
from chairward.records import Record  # noqa: E402

EAGER = "\n[settings.voice_citizen]\nword_ms = 150\n[settings.panel_citizen]\npress_ms = 60\n"
Row = dict[str, Any]


def busy() -> None:
    """A neighbour that never rests, of ordinary priority whatever this program has."""
    os.sched_setscheduler(0, os.SCHED_OTHER, os.sched_param(0))
    while True:
        sum(i * i for i in range(10_000))


@contextlib.contextmanager
def neighbours(number: int) -> Iterator[None]:
    """So many of them."""
    hogs = [multiprocessing.Process(target=busy, daemon=True) for _ in range(number)]
    for hog in hogs:
        hog.start()
    try:
        yield
    finally:
        for hog in hogs:
            hog.terminate()
            hog.join()


def stolen() -> int:
    """Clock ticks that the hypervisor gave to others since the start."""
    return int(Path("/proc/stat").read_text().split("\n", 1)[0].split()[8])


def watch(rig: Rig, seconds: float, each_second: Callable[[], None] = lambda: None) -> tuple[list[Record], set[int]]:
    """The records of so many seconds, and which of these (of CLOCK_MONOTONIC) nothing was stolen in."""
    whole: set[int] = set()
    del rig.records[:-1]
    end = time.monotonic() + seconds
    while time.monotonic() < end:
        second, before = int(time.monotonic()), stolen()
        each_second()
        time.sleep(max(0.0, second + 1.0 - time.monotonic()))
        if stolen() == before:
            whole.add(second)
    return list(rig.records)[1:], whole


def lateness(records: list[Record], whole: set[int]) -> Row:
    """How late the ticks were, ns: all, and those of the seconds that nobody stole from."""
    ticks = [(r.woke_ns - r.due_ns, r.due_ns // 1_000_000_000) for r in records if r.periodic]
    return {
        "all_ns": [late for late, _ in ticks],
        "whole_ns": [late for late, second in ticks if second in whole],
    }


def ticks(folder: Path, options: argparse.Namespace) -> Iterator[Row]:
    """A while of ticks, driving or not."""
    with running(load(folder), folder / "run", until_driving=False) as rig:
        rig.wait(lambda: bool(rig.records), "the guard", 60.0)
        with neighbours(options.neighbours):
            records, whole = watch(rig, options.seconds)
        fifo = bool(rig.supervisor.up and rig.supervisor.up.fifo)
        yield {"neighbours": options.neighbours, "fifo": fifo} | lateness(records, whole)


def stops(folder: Path, options: argparse.Namespace) -> Iterator[Row]:
    """A sensor that says 100 mm now and then: from its send to the first hard or zero command that it brought about."""
    with running(load(folder, CHAIR + EAGER), folder / "run") as rig, neighbours(options.neighbours):

        def wall_for_a_moment() -> None:
            rig.wait(rig.driving, "the chair to drive", 60.0)
            rig.misbehave("front", "wall")
            rig.wait(lambda: rig.records[-1].decision.motion == (0.0, 0.0), "a stop", 10.0)
            rig.behave("front")

        records, whole = watch(rig, options.seconds, wall_for_a_moment)
        took = []
        moving = False
        for r in records:
            newest = r.facts.ranges.get("front/range_citizen", ())
            if moving and r.decision.motion == (0.0, 0.0) and newest and newest[-1].ahead_mm == 100:
                took.append((r.wrote_ns - r.newest_sent_ns, r.facts.now_ns // 1_000_000_000))
            moving = r.decision.motion != (0.0, 0.0)
        yield {
            "neighbours": options.neighbours,
            "fifo": bool(rig.supervisor.up and rig.supervisor.up.fifo),
            "all_ns": [ns for ns, _ in took],
            "whole_ns": [ns for ns, second in took if second in whole],
        }


def zoo(folder: Path, options: argparse.Namespace) -> Iterator[Row]:
    """Beside each animal in turn."""
    import chairward_zoo  # type: ignore[import-not-found]

    processes.BACK_OFF_S = (0.02,)
    with running(load(folder), folder / "run", until_driving=False) as rig:
        for how in sorted(chairward_zoo.WAYS_TO_FAIL):
            rig.wait(lambda: sees(rig), "a sensor that sees", 120.0)
            rig.misbehave("front", how)
            records, whole = watch(rig, options.seconds)
            rig.behave("front")
            with contextlib.suppress(ProcessLookupError):
                os.killpg(rig.pid("front"), signal.SIGKILL)
            time.sleep(0.5)
            yield {"animal": how} | lateness(records, whole)


def sees(rig: Rig) -> bool:
    """The sensor's process is well."""
    facts = rig.records[-1].facts if rig.records else None
    newest = facts.ranges.get("front/range_citizen", ()) if facts else ()
    return bool(facts and newest and facts.now_ns - newest[-1].captured_ns < 100_000_000 and not facts.lost)


KINDS = {"ticks": ticks, "stops": stops, "zoo": zoo}


def report(pieces: list[Row]) -> Row:
    """Percentiles of all pieces of a kind, with so many neighbours or beside that animal."""
    rows: dict[str, dict[str, Row]] = {}
    for piece in pieces:
        name = piece.get("animal", f"{piece.get('neighbours')} busy neighbours{piece.get('beside', '')}")
        row = rows.setdefault(piece["kind"], {}).setdefault(name, {"pieces": 0, "all": [], "whole": []})
        row["pieces"] += 1
        row["all"] += piece["all_ns"]
        row["whole"] += piece["whole_ns"]
    for kind in rows.values():
        for name, row in kind.items():
            everything, nothing_stolen = percentiles_ms(row["all"]), percentiles_ms(row["whole"])
            kind[name] = {"pieces": row["pieces"], "ms": everything, "ms_nothing_stolen": nothing_stolen}
    return {**rows, "worst_of_zoo": worst(rows["zoo"])} if "zoo" in rows else rows


def worst(zoo: dict[str, Row]) -> Row:
    """The animal beside which the ticks were latest."""
    animal = max(zoo, key=lambda name: zoo[name]["ms"]["p99_9"])
    return {"animal": animal, "p99_9": zoo[animal]["ms"]["p99_9"], "animals": len(zoo)}


def main() -> None:
    """One piece, or the report."""
    import chairward_zoo

    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("what", choices=[*KINDS, "report"])
    parser.add_argument("--seconds", type=float, default=60.0)
    parser.add_argument("--neighbours", type=int, default=0)
    parser.add_argument("--beside", default="", help="what else went on: such pieces are told apart")
    parser.add_argument("--work", type=Path, default=Path(tempfile.gettempdir()) / "chairward-guard.jsonl")
    options = parser.parse_args()
    if options.what == "report":
        pieces = [json.loads(line) for line in options.work.read_text().splitlines()]
        about = {"python": platform.python_version(), "machine": platform.machine(), "cores": os.cpu_count()}
        RESULTS.write_text(json.dumps({**about, **report(pieces)}, indent=1) + "\n")
        return
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        os.environ["PYTHONPATH"] = str(chairward_zoo.install(folder / "zoo"))
        sys.path.insert(0, os.environ["PYTHONPATH"])
        pieces = []
        for row in KINDS[options.what](folder, options):
            beside = f", {options.beside}" if options.beside else ""
            pieces.append({"kind": options.what, "beside": beside, **row})
            with options.work.open("a") as file:
                file.write(json.dumps(pieces[-1]) + "\n")
    print(json.dumps(report(pieces), indent=1))


if __name__ == "__main__":
    main()

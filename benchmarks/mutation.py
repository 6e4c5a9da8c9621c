"""Does some test notice every small fault in the safety core? Mutants by cosmic-ray, judged by the core's fast tests.

    .venv/bin/python benchmarks/mutation.py                  goes on where it was stopped
    .venv/bin/python benchmarks/mutation.py --fresh          every mutant anew: the figure to keep
    .venv/bin/python benchmarks/mutation.py --only wishes --sample 100

Works in copies of the tree, never in the tree itself. Mutants of annotations, which nothing evaluates, are left out.
Each is judged by the tests of its own module alone, each rule's by those of that rule; of these only by those that
reach the changed statement, for no other can notice. All are collected and measured once; each mutant is tried in a
fork of that process, by the test that killed last first, then by the quickest. What no test *could* notice, by a class
that `same_for_every_value` proves, is not tried: it is listed as a survivor with that reason, and left out of
killed_percent (not of killed_percent_of_all). All other survivors count, however good their reason.

Writes benchmarks/results/mutation.json, with line and branch coverage by all these tests. Ends with 1 where too few
are killed, where a survivor has no reason (of its class, or in benchmarks/mutation_survivors.toml), or where a line or
branch is never run.
"""

from __future__ import annotations

import argparse
import json
import multiprocessing
import os
import platform
import shutil
import subprocess
import sys
import tempfile
import tomllib
from concurrent.futures import ProcessPoolExecutor
from pathlib import Path
from random import Random
from typing import Any

from mutant_judge import LONGEST_S, NONE_FAILS, OWN_TESTS, QUICK, files_of, source_of, work
from mutants import Mutant, mutants_of

ROOT = Path(__file__).resolve().parents[1]
RESULTS = ROOT / "benchmarks" / "results" / "mutation.json"
REASONS = ROOT / "benchmarks" / "mutation_survivors.toml"
LEDGER = ROOT / "build" / "mutation.jsonl"
ENOUGH_PERCENT = 98.0
PYTEST_INI = "[pytest]\naddopts = --import-mode=importlib -q -s -p no:cacheprovider\nfilterwarnings = error\n"


def copy_tree(to: Path) -> Path:
    """What the tests of the core need."""
    for folder in ("core", "tests/core", "profiles"):
        shutil.copytree(ROOT / folder, to / folder, ignore=shutil.ignore_patterns("__pycache__"))
    shutil.copy(ROOT / "tests" / "conftest.py", to / "tests")
    (to / "pytest.ini").write_text(PYTEST_INI)
    return to


def judge(mutants: list[Mutant], folder: Path, processes: int, *, fresh: bool) -> dict[str, str]:
    """Key -> first failure. Tried are all (fresh), or what the ledger does not know, and survivors without a reason."""
    lines = LEDGER.read_text().splitlines() if LEDGER.exists() and not fresh else []
    known: dict[str, str] = dict(json.loads(line) for line in lines)
    known |= {mutant.key: NONE_FAILS for mutant in mutants if mutant.never_tried}
    why = reasons()
    todo = [m for m in mutants if m.key not in known or (known[m.key] == NONE_FAILS and not reason_of(m, why))]
    print(f"{len(mutants)} mutants, {len(todo)} to try", flush=True)
    fork = multiprocessing.get_context("fork")
    answers: multiprocessing.Queue[tuple[str, str]] = fork.Queue()
    workers = [
        fork.Process(target=work, args=(copy_tree(folder / str(nth)), todo[nth::processes], answers), daemon=True)
        for nth in range(processes)
    ]
    for worker in workers:
        worker.start()
    LEDGER.parent.mkdir(exist_ok=True)
    with LEDGER.open("a") as ledger:
        waiting = {mutant.key for mutant in todo}
        while waiting:
            key, said = answers.get(timeout=3.0 * LONGEST_S)
            known[key] = said
            waiting.discard(key)
            ledger.write(json.dumps([key, said]) + "\n")
            ledger.flush()
    for worker in workers:
        worker.join()
    return {mutant.key: known[mutant.key] for mutant in mutants}


def coverage(tree: Path) -> dict[str, Any]:
    """Line and branch coverage of the mutated modules by all these tests, and where it is missing."""
    env = {**os.environ, **QUICK, "PYTHONPATH": str(tree / "core/src")}
    include = ",".join(f"*/{source_of(module)}" for module in OWN_TESTS)
    run = [sys.executable, "-m", "coverage"]
    measure = [*run, "run", "--branch", f"--include={include}", "-m", "pytest", *files_of(*OWN_TESTS, tree=tree)]
    subprocess.run(measure, cwd=tree, env=env, check=True, stdout=subprocess.DEVNULL)
    subprocess.run([*run, "json", "-q", "-o", "coverage.json"], cwd=tree, env=env, check=True)
    report = json.loads((tree / "coverage.json").read_text())
    total = report["totals"]
    return {
        "lines": total["num_statements"],
        "lines_run": total["covered_lines"],
        "branches": total["num_branches"],
        "branches_run": total["covered_branches"],
        "percent": total["percent_covered"],
        "missing": {
            Path(name).stem: {"lines": file["missing_lines"], "branches": file["missing_branches"]}
            for name, file in report["files"].items()
            if file["missing_lines"] or file["missing_branches"]
        },
    }


def reasons() -> dict[tuple[str, str], str]:
    """Why survivors may live, by their lines before and after."""
    return {
        (entry["was"], entry["now"]): group["reason"]
        for group in tomllib.loads(REASONS.read_text()).get("group", [])
        for entry in group["survivors"]
    }


def reason_of(mutant: Mutant, why: dict[tuple[str, str], str]) -> str:
    """Why this one may live; "" where nobody has given a reason."""
    return mutant.never_tried or why.get((mutant.was, mutant.now), "")


def count(mutants: list[Mutant], said: dict[str, str]) -> dict[str, Any]:
    """How many were killed, and each survivor with the reason why it may live."""
    why = reasons()
    survivors = [mutant for mutant in mutants if said[mutant.key] == NONE_FAILS]
    return {
        "mutants": len(mutants),
        "not_tried": sum(bool(mutant.never_tried) for mutant in mutants),
        "killed": len(mutants) - len(survivors),
        "survivors": [
            {
                "line": mutant.line,
                "operator": mutant.operator,
                "was": mutant.was,
                "now": mutant.now,
                "reason": reason_of(mutant, why),
            }
            for mutant in survivors
        ],
    }


def whole(modules: dict[str, dict[str, Any]], covered: dict[str, Any]) -> dict[str, Any]:
    """The result over all modules that were tried."""
    keys = ("mutants", "not_tried", "killed")
    mutants, not_tried, killed = (sum(found.get(key, 0) for found in modules.values()) for key in keys)
    return {
        "what": "mutants of the safety core (cosmic-ray) that its fast tests notice, and the coverage by these tests",
        "python": platform.python_version(),
        "mutants": mutants,
        "not_tried": not_tried,
        "killed": killed,
        "killed_percent": round(100.0 * killed / (mutants - not_tried), 2),
        "killed_percent_of_all": round(100.0 * killed / mutants, 2),
        "coverage": covered,
        "modules": modules,
    }


def main() -> None:
    """Make, try, count, write."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--fresh", action="store_true", help="forget what an earlier run has killed")
    parser.add_argument("--only", choices=tuple(OWN_TESTS), help="one module: the others' results are left as they are")
    parser.add_argument("--sample", type=int, help="so many mutants of each at random; the result is printed, not kept")
    parser.add_argument("--processes", type=int, default=os.cpu_count())
    options = parser.parse_args()
    tried = [options.only] if options.only else list(OWN_TESTS)
    with tempfile.TemporaryDirectory(prefix="mutation-") as folder:
        tree = copy_tree(Path(folder) / "whole")
        with ProcessPoolExecutor(options.processes) as pool:
            made = list(pool.map(mutants_of, tried, [(tree / source_of(module)).read_text() for module in tried]))
        if options.sample:
            made = [Random(0).sample(found, min(options.sample, len(found))) for found in made]
        said = judge(
            [mutant for found in made for mutant in found], Path(folder), options.processes, fresh=options.fresh
        )
        kept = json.loads(RESULTS.read_text()) if RESULTS.exists() else {"modules": {}, "coverage": {}}
        covered = kept["coverage"] if options.only or options.sample else coverage(tree)
    found = {module: count(mutants, said) for module, mutants in zip(tried, made, strict=True)}
    everything = {**kept["modules"], **found}
    result = whole({module: everything[module] for module in OWN_TESTS if module in everything}, covered)
    if not options.sample:
        RESULTS.write_text(json.dumps(result, indent=1) + "\n")
    for module, counts in found.items():
        print(f"{module}: {counts['killed']} of {counts['mutants']} killed")
        for one in counts["survivors"]:
            print("  {line} {operator}\n    - {was}\n    + {now}\n    = {reason}".format(**one))
    print(json.dumps({key: value for key, value in result.items() if key != "modules"}, indent=1))
    explained = all(one["reason"] for counts in everything.values() for one in counts["survivors"])
    sys.exit(not explained or bool(covered.get("missing")) or result["killed_percent"] < ENOUGH_PERCENT)


if __name__ == "__main__":
    main()

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
import gc
import json
import multiprocessing
import os
import platform
import resource
import select
import shutil
import signal
import subprocess
import sys
import tempfile
import time
import tomllib
from collections.abc import Callable, Mapping
from concurrent.futures import ProcessPoolExecutor
from contextlib import redirect_stderr, redirect_stdout
from functools import partial
from inspect import unwrap
from itertools import zip_longest
from math import ceil
from pathlib import Path
from random import Random
from types import FunctionType
from typing import Any

import pytest
from coverage import Coverage
from hypothesis import given, settings
from hypothesis.strategies import integers
from mutants import Mutant, mutants_of

ROOT = Path(__file__).resolve().parents[1]
RESULTS = ROOT / "benchmarks" / "results" / "mutation.json"
REASONS = ROOT / "benchmarks" / "mutation_survivors.toml"
LEDGER = ROOT / "build" / "mutation.jsonl"
ENOUGH_PERCENT = 98.0
LONGEST_S = 600.0
SLACK_CPU_S, SLOWER = 2.0, 4.0
MOST_BYTES = 4 * 1024**3
NONE_FAILS = "no test fails"
QUICK = {"HYPOTHESIS_PROFILE": "quick", "PYTEST_DISABLE_PLUGIN_AUTOLOAD": "1"}
PYTEST_INI = "[pytest]\naddopts = --import-mode=importlib -q -s -p no:cacheprovider\nfilterwarnings = error\n"


OWN_TESTS = {
    "envelope": ["test_envelope.py"],
    "scene": ["test_scene.py", "test_rules_02_stop_distance.py", "test_rules_05_blind.py"],
    "stopping": ["test_stopping.py"],
    "rules": ["test_rules_*.py"],
    "wishes": ["test_wishes.py", "test_rules_07_*.py", "test_rules_08_latch.py"],
    "memory": ["test_rules_06_near_loss.py"],
    "arbiter": ["test_arbiter_*.py", "test_rules_*.py", "test_reset_by_word.py"],
    "profile.proof": ["profile/test_proof.py"],
}
"""The mutated modules of `chairward`, and where in tests/core their promises are kept."""


def source_of(module: str) -> str:
    """A module's file, in the project."""
    return f"core/src/chairward/{module.replace('.', '/')}.py"


# ---- trying them ----------------------------------------------------------------------------------------------------
class Judge:
    """A pytest plugin that collects all tests once and shows them each mutant in a forked process of its own."""

    def __init__(self, mutants: list[Mutant], tell: Callable[[str, str], None]) -> None:
        self.mutants, self.tell = mutants, tell
        self.lines: dict[str, dict[str, set[int]]] = {}
        self.seconds: dict[str, float] = {}
        self.killed_at: dict[str, int] = {}

    def pytest_runtestloop(self, session: pytest.Session) -> bool:
        """In place of pytest's own loop."""
        warm_up()
        gc.freeze()  # what all forks share is not touched by their collectors
        measured = json.loads(in_a_fork(partial(measure, session)))
        if "fails" in measured:
            raise SystemExit(f"{measured['fails']} fails without any mutant: mend it first")
        self.seconds = measured["seconds"]
        self.lines = {
            module: {nodeid: set(lines) for nodeid, lines in of_tests.items()}
            for module, of_tests in measured["lines"].items()
        }
        for nth, mutant in enumerate(self.mutants):
            items = self.judges(session, mutant)
            said = in_a_fork(partial(first_failure, session, items, mutant, self.seconds))
            self.killed_at[said] = nth
            self.tell(mutant.key, said)
        return True

    def judges(self, session: pytest.Session, mutant: Mutant) -> list[pytest.Item]:
        """The tests that may notice a mutant, the likeliest first."""
        own = [item for item in session.items if any(map(item.path.match, OWN_TESTS[mutant.module]))]
        if mutant.module == "rules":
            own = [item for item in own if item.path.stem.endswith(f"_{mutant.function}")] or own
        if not mutant.sets:
            first, last = mutant.within
            reached = self.lines.get(mutant.module, {})
            own = [item for item in own if any(first <= line <= last for line in reached.get(item.nodeid, ()))]
        return sorted(own, key=lambda item: (-self.killed_at.get(item.nodeid, -1), self.seconds[item.nodeid]))


def warm_up() -> None:
    """Let hypothesis read the constants of all modules once, not in every fork."""
    settings(max_examples=1, database=None)(given(integers())(lambda _: None))()


def measure(session: pytest.Session) -> str:
    """Run all tests without any mutant: which one fails, or the seconds and the lines of each, as JSON."""
    cover = Coverage(data_file=None, include=[f"*/{source_of(module)}" for module in OWN_TESTS])
    seconds, lines = {}, {}
    cover.start()
    for item, following in zip_longest(session.items, session.items[1:]):
        cover.switch_context(item.nodeid)
        began = time.process_time()
        item.config.hook.pytest_runtest_protocol(item=item, nextitem=following)
        seconds[item.nodeid] = time.process_time() - began
        if session.testsfailed:
            return json.dumps({"fails": item.nodeid})
    cover.stop()
    data = cover.get_data()
    for module in OWN_TESTS:
        of_tests: dict[str, list[int]] = {}
        for line, nodeids in data.contexts_by_lineno(str(Path(source_of(module)).resolve())).items():
            for nodeid in nodeids:
                of_tests.setdefault(nodeid, []).append(line)
        lines[module] = of_tests
    return json.dumps({"seconds": seconds, "lines": lines})


def in_a_fork(act: Callable[[], str]) -> str:
    """What `act` says in a process of its own, which may die or hang."""
    read_end, write_end = os.pipe()
    pid = os.fork()
    if pid == 0:
        os.setsid()
        resource.setrlimit(resource.RLIMIT_AS, (MOST_BYTES, MOST_BYTES))
        with open(write_end, "w") as out:
            out.write(act())
        os._exit(0)
    os.close(write_end)
    with open(read_end) as answer:
        in_time = select.select([answer], [], [], LONGEST_S)[0]
        said = (answer.read() or "the process dies") if in_time else "the tests hang"
    os.kill(pid, signal.SIGKILL)
    os.waitpid(pid, 0)
    return said


def first_failure(
    session: pytest.Session, items: list[pytest.Item], mutant: Mutant, seconds: Mapping[str, float]
) -> str:
    """Run the tests one after the other until one fails; NONE_FAILS where none does.

    One that takes the processor for much longer than without the mutant ends the process: a mutant that hangs.
    """
    put_in_place(mutant)
    for item, following in zip_longest(items, items[1:]):
        until_s = ceil(time.process_time() + SLACK_CPU_S + SLOWER * seconds[item.nodeid])
        resource.setrlimit(resource.RLIMIT_CPU, (until_s, resource.RLIM_INFINITY))
        item.config.hook.pytest_runtest_protocol(item=item, nextitem=following)
        if session.testsfailed:
            return item.nodeid
    return NONE_FAILS


def put_in_place(mutant: Mutant) -> None:
    """Give each function of the living module the code of the mutant's, and its constants the new value everywhere."""
    name = f"chairward.{mutant.module}"
    born: dict[str, Any] = {"__name__": name}
    exec(compile(mutant.text, mutant.operator, "exec"), born)
    living = vars(sys.modules[name])
    new = functions(born)
    for qualname, function in functions(living).items():
        function.__code__ = new[qualname].__code__
    for constant in mutant.sets or ():
        old = living[constant]
        for module in list(sys.modules.values()):
            if vars(module).get(constant) is old:
                setattr(module, constant, born[constant])


def functions(namespace: Mapping[str, Any]) -> dict[str, FunctionType]:
    """The functions and methods that a module defines, by qualified name."""
    name = namespace["__name__"]
    own = [unwrap(value) for value in namespace.values() if getattr(value, "__module__", "") == name]
    own += [method for value in own if isinstance(value, type) for method in vars(value).values()]
    return {value.__qualname__: value for value in own if isinstance(value, FunctionType)}


def first_failure_of_import(tree: Path, mutant: Mutant | None) -> str:
    """The slow way, for what is evaluated when the module is imported: write the file, start pytest anew."""
    files = files_of(*([mutant.module] if mutant else OWN_TESTS))
    if mutant:
        path = tree / source_of(mutant.module)
        whole = path.read_text()
        path.write_text(mutant.text)
    try:
        run = [sys.executable, "-B", "-m", "pytest", "-x", *files]
        subprocess.run(run, check=True, timeout=LONGEST_S, stdout=subprocess.DEVNULL)
    except (subprocess.CalledProcessError, subprocess.TimeoutExpired) as failed:
        return type(failed).__name__
    else:
        return NONE_FAILS
    finally:
        if mutant:
            path.write_text(whole)


def files_of(*modules: str, tree: Path = Path()) -> list[str]:
    """The files of these modules' own tests."""
    patterns = [pattern for module in modules for pattern in OWN_TESTS[module]]
    return sorted({str(path) for pattern in patterns for path in (tree / "tests/core").glob(pattern)})


def work(tree: Path, mutants: list[Mutant], answers: multiprocessing.Queue[tuple[str, str]]) -> None:
    """One worker process, in a copy of the tree of its own."""
    os.chdir(tree)
    os.environ |= {**QUICK, "PYTHONPATH": str(tree / "core/src")}
    sys.path.insert(0, str(tree / "core/src"))
    slow = [mutant for mutant in mutants if mutant.sets is None]
    if slow and first_failure_of_import(tree, None) != NONE_FAILS:
        raise SystemExit("the tests fail without any mutant: mend them first")
    for mutant in slow:
        answers.put((mutant.key, first_failure_of_import(tree, mutant)))
    quick = [mutant for mutant in mutants if mutant.sets is not None]
    with open(os.devnull, "w") as nowhere, redirect_stdout(nowhere), redirect_stderr(nowhere):
        pytest.main(
            files_of(*{mutant.module for mutant in quick}),
            plugins=[Judge(quick, lambda key, said: answers.put((key, said)))],
        )


# ---- the whole ------------------------------------------------------------------------------------------------------
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

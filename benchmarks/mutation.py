"""Does some test notice every small fault in the safety core? Mutants by cosmic-ray, judged by the core's fast tests.

    .venv/bin/python benchmarks/mutation.py                  goes on where it was stopped
    .venv/bin/python benchmarks/mutation.py --fresh          every mutant anew: the figure to keep
    .venv/bin/python benchmarks/mutation.py --only wishes --sample 100

Works in copies of the tree, never in the tree itself. Mutants of annotations, which nothing evaluates, are left out.
Each is judged by the tests of its own module alone, each rule's by those of that rule. Writes
benchmarks/results/mutation.json, with line and branch coverage by all these tests. Ends with 1 where too few are
killed, where a survivor has no reason in benchmarks/mutation_survivors.toml, or where a line or branch is never run.
"""

from __future__ import annotations

import argparse
import ast
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
import tomllib
from collections import Counter
from collections.abc import Callable, Mapping
from concurrent.futures import ProcessPoolExecutor
from contextlib import redirect_stderr, redirect_stdout
from dataclasses import dataclass
from difflib import unified_diff
from hashlib import sha256
from inspect import unwrap
from itertools import zip_longest
from pathlib import Path
from random import Random
from types import FunctionType
from typing import Any

import pytest
from hypothesis import given, settings
from hypothesis.strategies import integers

ROOT = Path(__file__).resolve().parents[1]
RESULTS = ROOT / "benchmarks" / "results" / "mutation.json"
REASONS = ROOT / "benchmarks" / "mutation_survivors.toml"
LEDGER = ROOT / "build" / "mutation.jsonl"
ENOUGH_PERCENT = 98.0
LONGEST_S = 600.0
MOST_CPU_S = 10
MOST_BYTES = 4 * 1024**3
NONE_FAILS = "no test fails"
QUICK = {"HYPOTHESIS_PROFILE": "quick", "PYTEST_DISABLE_PLUGIN_AUTOLOAD": "1"}
PYTEST_INI = "[pytest]\naddopts = --import-mode=importlib -q -p no:cacheprovider\nfilterwarnings = error\n"

OWN_TESTS = {
    "envelope": ["test_envelope.py"],
    "scene": ["test_scene.py", "test_rules_02_stop_distance.py", "test_rules_05_blind.py"],
    "stopping": ["test_stopping.py"],
    "rules": ["test_rules_*.py"],
    "wishes": ["test_rules_07_*.py", "test_rules_08_latch.py"],
    "memory": ["test_rules_06_near_loss.py"],
    "arbiter": ["test_arbiter_*.py", "test_rules_08_latch.py", "test_rules_04_avoid.py", "test_rules_07_*.py"],
    "profile.proof": ["profile/test_proof.py"],
}
"""The mutated modules of `chairward`, and where in tests/core their promises are kept."""


def source_of(module: str) -> str:
    """A module's file, in the project."""
    return f"core/src/chairward/{module.replace('.', '/')}.py"


@dataclass(frozen=True, slots=True)
class Mutant:
    """One small change of one statement at the top level of a module (mostly: a function).

    was and now: the changed lines. statement: the whole statement with the change; text: the whole module with it.
    function: the name of the function, or "". sets: the module's constants that the changed line defines; None where it
    is neither that nor in a function's body (a class, a decorator, a default), so that only a new import shows it.
    """

    module: str
    line: int
    operator: str
    was: str
    now: str
    statement: str
    text: str
    function: str
    sets: tuple[str, ...] | None

    @property
    def key(self) -> str:
        """The same for the same change of the same statement."""
        return sha256(f"{self.module}\n{self.statement}".encode()).hexdigest()[:20]


# ---- making mutants -------------------------------------------------------------------------------------------------
def mutants_of(module: str, source: str) -> list[Mutant]:
    """Every mutant of a module that is a program and differs in more than annotations, each once."""
    from cosmic_ray.ast import ast_nodes, get_ast
    from cosmic_ray.mutating import mutate_code
    from cosmic_ray.plugins import get_operator, operator_names

    found, sets, before = [], constants_of(ast.parse(source)), ""
    operators = [make() for make in map(get_operator, operator_names()) if not make.arguments()]
    for node in get_ast(source).children:
        statement, function = node.get_code(), node.name.value if node.type == "funcdef" else ""
        parts, done = list(ast_nodes(get_ast(statement))), {meaning(statement), ""}
        for operator in operators:
            places = [at for part in parts for at in operator.mutation_positions(part)]
            for occurrence, (start, _) in enumerate(places):
                mutated = mutate_code(statement, operator, occurrence)
                if mutated is None or (said := meaning(mutated)) in done:
                    continue
                done.add(said)
                line = before.count("\n") + start[0]
                was, now = changed(statement, mutated), changed(mutated, statement)
                text = before + mutated + source[len(before) + len(statement) :]
                name = type(operator).__name__
                found.append(Mutant(module, line, name, was, now, mutated, text, function, sets.get(line)))
        before += statement
    return found


def meaning(source: str) -> str:
    """The syntax tree without annotations; "" for what is no program at all."""
    try:
        tree = ast.parse(source)
    except SyntaxError:
        return ""
    for node in ast.walk(tree):
        match node:
            case ast.FunctionDef():
                node.returns = None
            case ast.arg():
                node.annotation = None
            case ast.AnnAssign():
                node.annotation = ast.Constant(None)
    return ast.dump(tree)


def constants_of(tree: ast.Module) -> dict[int, tuple[str, ...]]:
    """Line -> the constants that it defines for the module; none for the lines of functions' bodies."""
    lines: dict[int, tuple[str, ...]] = {}
    for statement in tree.body:
        if isinstance(statement, ast.Assign):
            names = tuple(name.id for name in ast.walk(statement.targets[0]) if isinstance(name, ast.Name))
            lines |= dict.fromkeys(range(statement.lineno, (statement.end_lineno or 0) + 1), names)
    for node in ast.walk(tree):
        if isinstance(node, ast.FunctionDef):
            lines |= dict.fromkeys(range(node.body[0].lineno, (node.end_lineno or 0) + 1), ())
    return lines


def changed(text: str, other: str) -> str:
    """The lines of a text that are not in the other."""
    difference = list(unified_diff(text.splitlines(), other.splitlines(), n=0))
    return " ".join(line[1:].strip() for line in difference[2:] if line.startswith("-"))


# ---- trying them ----------------------------------------------------------------------------------------------------
class Judge:
    """A pytest plugin that collects all tests once and shows them each mutant in a forked process of its own."""

    def __init__(self, mutants: list[Mutant], tell: Callable[[str, str], None]) -> None:
        self.mutants, self.tell = mutants, tell
        self.killers: Counter[str] = Counter()

    def pytest_runtestloop(self, session: pytest.Session) -> bool:
        """In place of pytest's own loop."""
        warm_up()
        if (failed := verdict(session, session.items, None)) != NONE_FAILS:
            raise SystemExit(f"{failed} fails without any mutant: mend it first")
        for mutant in self.mutants:
            own = [item for item in session.items if any(map(item.path.match, OWN_TESTS[mutant.module]))]
            if mutant.module == "rules":
                own = [item for item in own if item.path.stem.endswith(f"_{mutant.function}")] or own
            said = verdict(session, sorted(own, key=lambda item: -self.killers[item.nodeid]), mutant)
            self.killers[said] += 1
            self.tell(mutant.key, said)
        return True


def warm_up() -> None:
    """Let hypothesis read the constants of all modules once, not in every fork."""
    settings(max_examples=1, database=None)(given(integers())(lambda _: None))()


def verdict(session: pytest.Session, items: list[pytest.Item], mutant: Mutant | None) -> str:
    """The first test that fails with this mutant (None: without any), or NONE_FAILS."""
    read_end, write_end = os.pipe()
    pid = os.fork()
    if pid == 0:
        os.setsid()
        resource.setrlimit(resource.RLIMIT_AS, (MOST_BYTES, MOST_BYTES))
        resource.setrlimit(resource.RLIMIT_CPU, (MOST_CPU_S, MOST_CPU_S))
        if mutant:
            put_in_place(mutant)
        with open(write_end, "w") as out:
            out.write(first_failure(session, items))
        os._exit(0)
    os.close(write_end)
    with open(read_end) as answer:
        in_time = select.select([answer], [], [], LONGEST_S)[0]
        said = (answer.read() or "the process dies") if in_time else "the tests hang"
    os.kill(pid, signal.SIGKILL)
    os.waitpid(pid, 0)
    return said


def first_failure(session: pytest.Session, items: list[pytest.Item]) -> str:
    """Run the tests one after the other until one fails."""
    for item, following in zip_longest(items, items[1:]):
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


def judge(mutants: list[Mutant], folder: Path, processes: int) -> dict[str, str]:
    """Key -> first failure. What the ledger knows as killed is not tried again."""
    lines = LEDGER.read_text().splitlines() if LEDGER.exists() else []
    known: dict[str, str] = dict(json.loads(line) for line in lines)
    todo = [mutant for mutant in mutants if known.get(mutant.key, NONE_FAILS) == NONE_FAILS]
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
        "missing": {
            Path(name).stem: {"lines": file["missing_lines"], "branches": file["missing_branches"]}
            for name, file in report["files"].items()
            if file["missing_lines"] or file["missing_branches"]
        },
    }


def count(mutants: list[Mutant], said: dict[str, str]) -> dict[str, Any]:
    """How many were killed, and each survivor with the reason why it may live ("" where nobody has given one)."""
    reasons = {
        (entry["was"], entry["now"]): group["reason"]
        for group in tomllib.loads(REASONS.read_text()).get("group", [])
        for entry in group["survivors"]
    }
    survivors = [mutant for mutant in mutants if said[mutant.key] == NONE_FAILS]
    return {
        "mutants": len(mutants),
        "killed": len(mutants) - len(survivors),
        "survivors": [
            {
                "line": mutant.line,
                "operator": mutant.operator,
                "was": mutant.was,
                "now": mutant.now,
                "reason": reasons.get((mutant.was, mutant.now), ""),
            }
            for mutant in survivors
        ],
    }


def whole(modules: dict[str, dict[str, Any]], covered: dict[str, Any]) -> dict[str, Any]:
    """The result over all modules that were tried."""
    mutants, killed = (sum(found[key] for found in modules.values()) for key in ("mutants", "killed"))
    return {
        "what": "mutants of the safety core (cosmic-ray) that its fast tests notice, and the coverage by these tests",
        "python": platform.python_version(),
        "mutants": mutants,
        "killed": killed,
        "killed_percent": round(100.0 * killed / mutants, 2),
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
    if options.fresh:
        LEDGER.unlink(missing_ok=True)
    tried = [options.only] if options.only else list(OWN_TESTS)
    with tempfile.TemporaryDirectory(prefix="mutation-") as folder:
        tree = copy_tree(Path(folder) / "whole")
        with ProcessPoolExecutor(options.processes) as pool:
            made = list(pool.map(mutants_of, tried, [(tree / source_of(module)).read_text() for module in tried]))
        if options.sample:
            made = [Random(0).sample(found, min(options.sample, len(found))) for found in made]
        said = judge([mutant for found in made for mutant in found], Path(folder), options.processes)
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

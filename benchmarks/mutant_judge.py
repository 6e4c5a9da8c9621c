"""Shows mutants to the core's fast tests: collected and measured once, each mutant tried in a fork of that process.

Used by mutation.py, whose first lines say which tests judge which mutant, and how it is counted.
"""

from __future__ import annotations

import gc
import json
import multiprocessing
import os
import resource
import select
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Mapping
from contextlib import redirect_stderr, redirect_stdout
from functools import partial
from inspect import unwrap
from itertools import zip_longest
from math import ceil
from pathlib import Path
from types import FunctionType
from typing import Any

import pytest
from coverage import Coverage
from hypothesis import given, settings
from hypothesis.strategies import integers
from mutants import Mutant

LONGEST_S = 600.0
SLACK_CPU_S, SLOWER = 2.0, 4.0
MOST_BYTES = 4 * 1024**3
NONE_FAILS = "no test fails"
QUICK = {"HYPOTHESIS_PROFILE": "quick", "PYTEST_DISABLE_PLUGIN_AUTOLOAD": "1"}

OWN_TESTS = {
    "envelope": ["test_envelope.py"],
    "scene": ["test_scene.py", "test_rules_02_stop_distance.py", "test_rules_05_blind.py"],
    "stopping": ["test_stopping.py"],
    "rules": ["test_rules_*.py"],
    "wishes": ["test_wishes.py", "test_rules_07_*.py", "test_rules_08_latch.py"],
    "reflex": ["test_reflex.py"],
    "memory": ["test_rules_06_near_loss.py"],
    "arbiter": ["test_arbiter_*.py", "test_rules_*.py", "test_reset_by_word.py"],
    "profile.proof": ["profile/test_proof.py"],
}
"""The mutated modules of `chairward`, and where in tests/core their promises are kept."""


def source_of(module: str) -> str:
    """A module's file, in the project."""
    return f"core/src/chairward/{module.replace('.', '/')}.py"


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

"""How good a plugin is: bronze, silver, gold, platinum. Each grade needs all rules of those below it.

bronze: it registers and explains itself. silver: its contract tests pass. gold: they also pass in a hostile
environment, and importing it is light. platinum: typed, documented, and bound to the API it was written for.
"""

from __future__ import annotations

import json
import os
import subprocess
import sys
import tempfile
from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass, replace
from importlib.metadata import Distribution, distributions
from pathlib import Path
from typing import Any

from chairward.components import Component
from chairward.hookspecs import ENTRY_POINT_GROUP
from chairward.messages import Intent, Press, RangeReading, Stick, Veto
from chairward.plugins import KINDS, discover

GRADES = ("bronze", "silver", "gold", "platinum")
IMPORT_LIMIT_S = 1.0
"""Processor time of importing a plugin after the core: every process of a run does it."""
TESTS_LIMIT_S = 1200.0


class GradeError(ValueError):
    """One sentence: why nothing can be graded."""


@dataclass(frozen=True, slots=True)
class Rule:
    """One rule. kept: None when an earlier grade failed and it was not tried. why: why it is not kept."""

    grade: str
    says: str
    kept: bool | None
    why: str = ""


@dataclass(frozen=True, slots=True)
class Graded:
    """All rules of a plugin, and the highest grade of which every rule is kept."""

    plugin: str
    rules: Sequence[Rule]

    @property
    def grade(self) -> str:
        """ "" for none."""
        reached = ""
        for grade in GRADES:
            if not all(rule.kept for rule in self.rules if rule.grade == grade):
                break
            reached = grade
        return reached

    def as_dict(self) -> dict[str, Any]:
        """For JSON."""
        return {"plugin": self.plugin, "grade": self.grade, "rules": [asdict(rule) for rule in self.rules]}


@dataclass(frozen=True, slots=True)
class Project:
    """An installed plugin, what it offers by kind, and where its sources are."""

    name: str
    offered: Sequence[tuple[str, Component]]
    folder: Path
    tests: Path


def graded(name: str, folder: Path, tests: Path, say: Callable[[str], object]) -> Graded:
    """Grade the installed plugin `name`. Raises GradeError when it is not installed or has no tests there."""
    registry = discover()
    refused = next((refusal.reason for refusal in registry.refused if refusal.plugin == name), "")
    offered = [
        (kind, component)
        for kind in KINDS
        for component in registry.components[kind].values()
        if component.plugin == name
    ]
    if not refused and name not in {other for other, _ in registry.manager.list_name_plugin()}:
        raise GradeError(f"no plugin '{name}' is installed: see `chairward plugins`")
    if not tests.is_dir():
        raise GradeError(f"{tests}: no such folder of tests: give --folder or --tests")
    project = Project(name, offered, folder, tests)
    rules = _bronze(project, refused)
    for grade, judge in (("silver", _silver), ("gold", _gold), ("platinum", _platinum)):
        go_on = all(rule.kept for rule in rules)
        say(f"{grade}: {'...' if go_on else 'not tried'}")
        rules += judge(project) if go_on else [Rule(grade, "all rules below", None)]
    return Graded(name, [replace(rule, why="") if rule.kept else rule for rule in rules])


RECOGNIZER = ("HeldDeviceContract", "WordContract")


def needed_contracts(kind: str, component: Component) -> Sequence[str]:
    """The contract classes of which a component must keep one, whichever it is; none for a companion."""
    gives = set(component.gives)
    if kind == "source":
        if gives & {Intent, Stick, Press}:
            return RECOGNIZER
        if RangeReading in gives:
            return ("SensorContract",)
        return ("DeviceContract",) if Veto in gives else ("SourceContract",)
    known = {"sensor": ("SensorContract",), "recognizer": RECOGNIZER, "drive": ("DriveContract",)}
    return {**known, "observer": ("ObserverContract",)}.get(kind, ())


def _bronze(project: Project, refused: str) -> list[Rule]:
    components = [component for _, component in project.offered]
    bare = [f"{c.name}.{n}" for c in components for n, f in c.settings.model_fields.items() if not f.description]
    silent = [c.name for c in components if not c.summary]
    readme = project.folder / "README.md"
    return [
        Rule("bronze", "it registers, with the API of this version", not refused, refused),
        Rule("bronze", "it offers something", bool(components) or bool(refused), "no hook gives a component"),
        Rule("bronze", "every component says what it is", not silent, f"no summary: {', '.join(silent)}"),
        Rule("bronze", "every setting says what it is", not bare, f"no description: {', '.join(bare)}"),
        Rule("bronze", "it has a README.md", readme.is_file(), f"{readme} is missing"),
    ]


def _silver(project: Project) -> list[Rule]:
    passed, failed = _run_tests(project, {}, [])
    rules = [Rule("silver", "all its tests pass, none is skipped", not failed, failed)]
    for kind, component in project.offered:
        contracts = needed_contracts(kind, component)
        if contracts:
            names = {component.name, ""} if kind == "drive" else {component.name}
            kept = any((contract, name) in passed for contract in contracts for name in names)
            needed = " or ".join(contracts)
            why = f"no test class inherits {needed} with a rig of '{component.name}'"
            rules.append(Rule("silver", f"{component.name}: {needed} passes", kept, "" if kept else why))
    return rules


def _gold(project: Project) -> list[Rule]:
    busy = [sys.executable, "-c", "while True: pass"]
    neighbours = [subprocess.Popen(busy) for _ in range(os.cpu_count() or 2)]
    hostile = {"LANG": "C", "LC_ALL": "C", "TZ": "Asia/Kathmandu", "HOME": "/nonexistent", "PYTHONHASHSEED": "7"}
    try:
        runs = [_run_tests(project, hostile, ["-X", "dev"])[1] for _ in range(2)]
    finally:
        for neighbour in neighbours:
            neighbour.kill()
            neighbour.wait()
    failed = next((run for run in runs if run), "")
    module = _distribution(project.name)[1]
    return [
        Rule("gold", "its tests pass twice beside busy neighbours, in a bare environment", not failed, failed),
        *(Rule("gold", says, not why, why) for says, why in _import_manners(module)),
    ]


def _platinum(project: Project) -> list[Rule]:
    distribution, module = _distribution(project.name)
    folder = project.folder
    requires = [r.replace(" ", "") for r in distribution.requires or [] if r.split()[0].startswith("chairward")]
    bound = any(r.startswith(("chairward>", "chairward<", "chairward~", "chairward=")) for r in requires)
    package = next((p for p in (folder / "src").glob("*") if p.name == module.split(".")[0]), None)
    typed = package is not None and (package / "py.typed").exists()
    mypy = [sys.executable, "-m", "mypy", "--strict", "--ignore-missing-imports", str(package or folder / "src")]
    checked = subprocess.run(mypy, cwd=folder, capture_output=True, text=True, check=False)
    notes = (folder / "CHANGELOG.md").is_file()
    return [
        Rule("platinum", "it says which versions of chairward it is for", bound, "bound it: chairward>=0.1,<0.2"),
        Rule("platinum", "it is marked as typed", typed, "py.typed is missing beside its __init__.py"),
        Rule("platinum", "mypy --strict finds nothing", checked.returncode == 0, checked.stdout.strip()[-300:]),
        Rule("platinum", "it has a CHANGELOG.md", notes, f"{folder / 'CHANGELOG.md'} is missing"),
    ]


def _run_tests(project: Project, env: dict[str, str], flags: Sequence[str]) -> tuple[set[tuple[str, str]], str]:
    """([contract, component] of each contract all of whose tests passed, "" or what failed)."""
    with tempfile.TemporaryDirectory() as scratch:
        report = Path(scratch) / "contracts.json"
        command = [sys.executable, *flags, "-m", "pytest", "-q", "-p", "chairward.testing.kept", str(project.tests)]
        environment = {**os.environ, **env, "CHAIRWARD_KEPT": str(report)}
        try:
            done = subprocess.run(
                command,
                cwd=project.folder,
                env=environment,
                capture_output=True,
                text=True,
                check=False,
                timeout=TESTS_LIMIT_S,
            )
        except subprocess.TimeoutExpired:
            return set(), f"its tests were not done after {TESTS_LIMIT_S:.0f} s"
        found = json.loads(report.read_text()) if report.exists() else {"kept": [], "failed": ["pytest did not run"]}
    said = done.stderr.strip() or done.stdout.strip()
    failed = ", ".join(found["failed"][:5]) or ("" if done.returncode == 0 else said[-300:])
    return {(kept[0], kept[1]) for kept in found["kept"]}, failed


_MANNERS = """
import sys, threading, time
import chairward.plugins, chairward.components, chairward.messages, chairward.hookspecs, pydantic
touched = []
def watch(event, args):
    if event == "open" and isinstance(args[0], str) and args[0].startswith("/dev/") and args[0] != "/dev/null":
        touched.append(args[0])
    if event in ("socket.connect", "subprocess.Popen"):
        touched.append(event)
sys.addaudithook(watch)
threads, start = threading.active_count(), time.process_time()
__import__(sys.argv[1])
took = time.process_time() - start
print(took, threading.active_count() - threads, *touched)
"""


def _import_manners(module: str) -> list[tuple[str, str]]:
    """(rule, "" or why not) of what importing the plugin does."""
    command = [sys.executable, "-c", _MANNERS, module]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    if done.returncode != 0:
        return [("it can be imported", done.stderr.strip()[-300:])]
    took, threads, *touched = done.stdout.split()
    slow = float(took) > IMPORT_LIMIT_S
    return [
        ("importing it takes little time", f"{took} s: import heavy libraries where they are used" if slow else ""),
        ("importing it starts no thread", "" if threads == "0" else f"{threads} threads"),
        ("importing it touches no device", ", ".join(touched)),
    ]


def _distribution(plugin: str) -> tuple[Distribution, str]:
    """The distribution that offers the plugin, and the plugin's module."""
    for distribution in distributions():
        for point in distribution.entry_points:
            if point.group == ENTRY_POINT_GROUP and point.name == plugin:
                return distribution, point.module
    raise GradeError(f"no installed distribution has an entry point '{plugin}' of {ENTRY_POINT_GROUP}")

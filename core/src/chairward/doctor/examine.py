"""The examination: the profile first, then all checks, each place of the chair in a process of its own.

Places (the machine, each lane, the drive) are looked at side by side; the checks of one place come one after the
other, for they share its devices. A check that does not answer in time is ended, and the rest of its place goes on.
"""

from __future__ import annotations

import json
import os
import selectors
import subprocess
import tempfile
import time
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import IO, NamedTuple

import msgspec

from chairward import plan as plans
from chairward import profile
from chairward.components import Settings
from chairward.doctor.machine import installed
from chairward.findings import Check, Finding, Site, advised
from chairward.plan import LanePlan, Part, Plan, fill_run_dir
from chairward.plugins import PluginError, Registry
from chairward.processes import kill_group, last_words, spawn

START_S = 45.0
"""A place's process that has not begun its first check by then is a finding."""
MACHINE, DRIVE = "machine", "drive"


class Task(NamedTuple):
    """One check, of a plugin, at one place of the chair."""

    place: str
    plugin: str
    check: Check
    lane: LanePlan | None
    part: Part | None


class Options(msgspec.Struct, frozen=True):
    """What a place's process is told. pipe: where its findings go. done: so many checks have been made already."""

    place: str
    plugins: list[str]
    plan: str
    root: str
    pipe: int
    done: int = 0


@dataclass(slots=True)
class Place:
    """One place's process, and what it is at."""

    name: str
    tasks: Sequence[Task]
    process: subprocess.Popen[bytes] | None = None
    pipe: IO[bytes] | None = None
    unread: bytes = b""
    done: int = 0
    due_s: float = 0.0
    found: list[Finding] = field(default_factory=list)


def examine(registry: Registry, chair: str | None, person: str | None, root: Path = Path("/")) -> Iterator[Finding]:
    """All findings, place by place; those about a chair only when one is named."""
    yield from installed(registry)
    plan: Plan | None = None
    if chair is not None:
        try:
            loaded = profile.load_traced(chair, person, [], registry)
            plan = loaded.plan
            yield Finding(
                "profile", True, f"chair '{plan.chair}' with person '{plan.person}' loads and its distances are proven"
            )
            if loaded.unmeasured:
                yield Finding("drive", False, loaded.unmeasured, f"chairward check drive --chair {plan.chair}")
        except (ValueError, PluginError) as error:
            yield Finding("profile", False, *advised(str(error), "correct the file at that place"))
    with tempfile.TemporaryDirectory(prefix="chairward-doctor-") as folder:
        yield from _side_by_side(tasks(registry, plan), plan, root, Path(folder))


def look_at(registry: Registry, plan: Plan, places: Sequence[str], root: Path = Path("/")) -> list[Finding]:
    """The findings at some places only: "machine", a lane's name, "drive"."""
    mine = [task for task in tasks(registry, plan) if task.place in places]
    with tempfile.TemporaryDirectory(prefix="chairward-doctor-") as folder:
        return list(_side_by_side(mine, plan, root, Path(folder)))


def tasks(registry: Registry, plan: Plan | None) -> list[Task]:
    """Every check that applies, in order: the machine, the lanes with their stages, the drive."""
    offered = [(plugin, check) for plugin, checks in offers(registry) for check in checks]

    def at(place: str, lane: LanePlan | None, part: Part | None) -> list[Task]:
        name = part.component if part else ""
        return [Task(place, plugin, check, lane, part) for plugin, check in offered if check.component == name]

    found = at(MACHINE, None, None)
    if plan is None:
        return found
    for lane in plan.lanes:
        for part in (lane.source, *lane.stages):
            found += at(lane.name, lane, part)
    return found + at(DRIVE, None, plan.drive)


def offers(registry: Registry) -> Iterator[tuple[str, Sequence[Check]]]:
    """Each plugin's name and its checks; one whose hook raises has a check that says so."""
    for name, plugin in registry.manager.list_name_plugin():
        offer = getattr(plugin, "chairward_checks", None)
        if offer is None:
            continue
        try:
            yield name, list(offer())
        except Exception as error:  # noqa: BLE001 - one plugin's broken checks must not take the others away
            broken = Finding("plugins", False, f"the checks of plugin '{name}' fail: {error}", "update that plugin")
            yield name, [Check(name="plugins", look=lambda _, broken=broken: [broken])]  # type: ignore[misc]


def site(task: Task, registry: Registry, plan: Plan | None, root: Path, run_dir: Path) -> Site:
    """Where a task looks."""
    settings = None
    if task.part is not None:
        settings = _settings(task, registry).model_validate(fill_run_dir(task.part.settings, run_dir))
    return Site(
        registry=registry,
        plan=plan,
        lane=task.lane,
        part=task.part,
        settings=settings,
        root=root,
        run_dir=run_dir,
    )


def _settings(task: Task, registry: Registry) -> type[Settings]:
    assert task.part is not None
    name = task.part.component
    if task.lane is None:
        return registry.get("drive", name).settings
    if task.part is task.lane.source:
        return registry.get("source", name).settings
    return registry.stage(name)[1].settings


def _side_by_side(found: Sequence[Task], plan: Plan | None, root: Path, folder: Path) -> Iterator[Finding]:
    places = [Place(name, [t for t in found if t.place == name]) for name in dict.fromkeys(t.place for t in found)]
    if plan is not None:
        plans.write(plan, folder / "plan.json")
    selector = selectors.DefaultSelector()
    try:
        for place in places:
            _start(place, plan is not None, root, folder, selector)
        while any(place.process is not None for place in places):
            for key, _ in selector.select(0.1):
                _hear(key.data, root, folder, selector, chair=plan is not None)
            for place in places:
                if place.process is not None and time.monotonic() > place.due_s:
                    _give_up(place, root, folder, selector, chair=plan is not None)
    finally:
        for place in places:
            _end(place, selector)
        selector.close()
    for place in places:
        yield from place.found


def _start(place: Place, chair: bool, root: Path, folder: Path, selector: selectors.BaseSelector) -> None:
    ours, theirs = os.pipe()
    parts = [part for t in place.tasks if t.lane for part in (t.lane.source, *t.lane.stages)]
    plugins = sorted({*(t.plugin for t in place.tasks), *(part.plugin for part in parts)})
    file = str(folder / "plan.json") if chair else ""
    options = Options(place.name, plugins, file, str(root), theirs, place.done)
    place.process = spawn(folder, "chairward.doctor.place", options, place.name, [theirs])
    os.close(theirs)
    place.pipe, place.unread, place.due_s = os.fdopen(ours, "rb", buffering=0), b"", time.monotonic() + START_S
    selector.register(place.pipe, selectors.EVENT_READ, place)


def _hear(place: Place, root: Path, folder: Path, selector: selectors.BaseSelector, *, chair: bool) -> None:
    """Lines of a place's process: a check begins, a finding, a check has ended."""
    assert place.pipe is not None
    data = place.pipe.read(65536)
    if not data:
        _end(place, selector)
        if place.done < len(place.tasks):  # it died in the middle of a check
            words = last_words(folder, place.name)
            _failed(place, f"the check ended in the middle: {words}", "report this to whoever made that plugin")
            _go_on(place, chair, root, folder, selector)
        return
    *lines, place.unread = (place.unread + data).split(b"\n")
    for line in lines:
        said = json.loads(line)
        if "begins" in said:
            place.due_s = time.monotonic() + said["timeout_s"]
        elif "ended" in said:
            place.done += 1
            place.due_s = time.monotonic() + START_S
        else:
            place.found.append(Finding(**said))


def _give_up(place: Place, root: Path, folder: Path, selector: selectors.BaseSelector, *, chair: bool) -> None:
    """A device that hangs has hung its check, and nothing else."""
    limit = place.tasks[place.done].check.timeout_s
    _end(place, selector)
    _failed(place, f"no answer within {limit:g} s: its device hangs", "unplug the device, plug it in and try again")
    _go_on(place, chair, root, folder, selector)


def _failed(place: Place, what: str, fix: str) -> None:
    place.found.append(Finding(place.tasks[place.done].check.name, False, f"{place.name}: {what}", fix))
    place.done += 1


def _go_on(place: Place, chair: bool, root: Path, folder: Path, selector: selectors.BaseSelector) -> None:
    if place.done < len(place.tasks):
        _start(place, chair, root, folder, selector)


def _end(place: Place, selector: selectors.BaseSelector) -> None:
    if place.process is None or place.pipe is None:
        return
    selector.unregister(place.pipe)
    place.pipe.close()
    kill_group(place.process)
    place.process.wait()
    place.process = None

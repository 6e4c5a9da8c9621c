"""Checks of the machine itself and of what is installed; and of every chair, whatever its devices are.

What is looked at comes in as an argument or stands below `site.root`, so that each fault can be put there by a test.
"""

from __future__ import annotations

import grp
import os
import re
import resource
import shutil
import sys
import time
from collections.abc import Iterable, Iterator, Mapping, Sequence
from datetime import date
from importlib.metadata import Distribution, distributions
from pathlib import Path
from typing import Any

import platformdirs

from chairward.findings import Check, Finding, Site, not_tried
from chairward.hookspecs import ENTRY_POINT_GROUP
from chairward.plan import ChairKind, Plan
from chairward.plugins import Registry

MIN_FREE_BYTES = 500_000_000
MIN_YEAR = 2024
OLDEST, NEWEST = (3, 11), (3, 13)
MEASURED_DAYS = 365


def installed(registry: Registry) -> Iterator[Finding]:
    """Python, and the plugins as they were found."""
    yield from python(sys.version_info[:2], sys.platform)
    yield from plugins(registry)
    yield from packages(distributions())


def python(version: tuple[int, ...], platform: str) -> Iterator[Finding]:
    """Is this a Python and a system that the tests ran on?"""
    ok = OLDEST <= version[:2] <= NEWEST
    said = f"Python {version[0]}.{version[1]}"
    yield Finding("python", ok, said, "" if ok else "use Python 3.11, 3.12 or 3.13")
    linux = platform == "linux"
    yield Finding("system", linux, platform, "" if linux else "use Linux: the guard needs its sockets and clocks")


def plugins(registry: Registry) -> Iterator[Finding]:
    """Plugins that were refused, each with the reason."""
    for refused in registry.refused:
        yield Finding(
            "plugins", False, f"plugin '{refused.plugin}' {refused.reason}", "install a matching version of it"
        )
    if not registry.refused:
        count = sum(len(found) for found in registry.components.values())
        yield Finding("plugins", True, f"{count} components from {len(registry.manager.get_plugins())} plugins")


def packages(found: Iterable[Distribution]) -> Iterator[Finding]:
    """What each plugin needs is installed too (a plugin that was copied by hand lacks it)."""
    there, wrong = {}, False
    for one in found:
        there[_plain(one.name or "")] = one
    for one in sorted(there.values(), key=lambda d: d.name):
        if not any(point.group == ENTRY_POINT_GROUP for point in one.entry_points):
            continue
        for requirement in one.requires or ():
            need = re.match(r"[A-Za-z0-9._-]+", requirement)
            if need and ";" not in requirement and _plain(need[0]) not in there:
                wrong = True
                what = f"plugin '{one.name}' {one.version} needs {need[0]}, which is not installed"
                yield Finding("packages", False, what, f"pip install '{requirement}'")
    if not wrong:
        yield Finding("packages", True, "what the plugins need is installed")


def _plain(name: str) -> str:
    """A distribution's name as all its spellings mean it (PEP 503)."""
    return re.sub(r"[-_.]+", "-", name).lower()


def realtime(fifo: bool, memlock_bytes: int) -> Iterator[Finding]:
    """May the guard have the processor when it needs it? memlock_bytes: -1 for as much as it likes."""
    place = "/etc/security/limits.d/chairward.conf and log in again"
    yield Finding(
        "real time",
        fifo,
        "the guard may use SCHED_FIFO" if fifo else "the guard may not use SCHED_FIFO: its ticks can be late",
        "" if fifo else f"add '@chairward - rtprio 60' to {place}",
        needed=False,
    )
    lock = memlock_bytes == -1
    yield Finding(
        "memory",
        lock,
        "the guard may lock its memory" if lock else f"the guard may lock only {memlock_bytes // 1024} kB",
        "" if lock else f"add '@chairward - memlock unlimited' to {place}",
        needed=False,
    )


def _realtime(_: Site) -> Iterator[Finding]:
    root = os.geteuid() == 0
    limit = resource.getrlimit(resource.RLIMIT_MEMLOCK)[0]
    unlimited = root or limit in (-1, resource.RLIM_INFINITY)
    yield from realtime(root or resource.getrlimit(resource.RLIMIT_RTPRIO)[0] >= 1, -1 if unlimited else limit)


def processor(site: Site) -> Iterator[Finding]:
    """A processor that saves power wakes late, and one core cannot see and decide at once."""
    cpus = site.root / "sys/devices/system/cpu"
    for file in sorted(cpus.glob("cpu[0-9]*/cpufreq/scaling_governor"))[:1]:
        governor = file.read_text().strip()
        saves = governor == "powersave"
        yield Finding(
            "processor",
            not saves,
            f"its governor is '{governor}'",
            "sudo cpupower frequency-set -g performance" if saves else "",
            needed=False,
        )
    online = cpus / "online"
    if online.exists() and online.read_text().strip() == "0":
        yield Finding("processor", False, "it has one core", "use a computer with two cores or more", needed=False)


def disk(folder: Path, free_bytes: int) -> Iterator[Finding]:
    """Room for recordings, in a folder that can be written."""
    ok = free_bytes > MIN_FREE_BYTES
    yield Finding(
        "disk", ok, f"{free_bytes // 1_000_000} MB free for recordings", "" if ok else "make room in your home folder"
    )
    there = next(p for p in (folder, *folder.parents) if p.exists())
    if not there.is_dir() or not os.access(there, os.W_OK):
        kind = "cannot be written" if there.is_dir() else "is no folder"
        yield Finding("recordings", False, f"{there} {kind}, and recordings go there", f"make {folder} writable")


def _disk(_: Site) -> Iterator[Finding]:
    folder = Path(platformdirs.user_state_dir("chairward")) / "recordings"
    there = next(p for p in (folder, *folder.parents) if p.is_dir())
    yield from disk(folder, shutil.disk_usage(there).free)


def clock(today: date) -> Iterator[Finding]:
    """A clock that was never set dates recordings and measurements wrongly."""
    ok = today.year >= MIN_YEAR
    fix = "" if ok else "set the clock: recordings and measurements are dated by it"
    yield Finding("clock", ok, f"today is {today.isoformat()}", fix)


def _clock(_: Site) -> Iterator[Finding]:
    yield from clock(date.fromtimestamp(time.time()))


def devices(site: Site) -> Iterator[Finding]:
    """Every absolute device path in the settings: there, and may be opened by this user."""
    if site.plan is None:
        yield not_tried("devices", "there is no chair to look at: name one by --chair")
        return
    parts = [site.plan.drive, *(part for lane in site.plan.lanes for part in (lane.source, *lane.stages))]
    for part in parts:
        for key, text in part.settings.items():
            if isinstance(text, str) and text.startswith("/"):
                yield device(f"{part.component}.{key}", Path(text))


def device(key: str, path: Path) -> Finding:
    """One path of the settings."""
    where = f"{key} = {path}"
    if not path.exists():
        return Finding("devices", False, f"{where} is not there", "plug the device in or correct the path")
    if not os.access(path, os.R_OK | (os.W_OK if path.is_char_device() else 0)):
        fix = f"sudo usermod -aG {_group(path)} $USER, log in again"
        return Finding("devices", False, f"{where} may not be opened", fix)
    return Finding("devices", True, f"{where} is there")


def _group(path: Path) -> str:
    try:
        return grp.getgrgid(path.stat().st_gid).gr_name
    except KeyError:
        return str(path.stat().st_gid)


def chair(site: Site) -> Iterator[Finding]:
    """What a chair with somebody in it needs beside this software, and what was never measured."""
    if site.plan is None:
        yield not_tried("chair", "there is no chair to look at: name one by --chair")
        return
    if site.plan.kind is ChairKind.CHAIR:
        yield Finding(
            "hardware stop",
            True,
            "somebody sits in this chair: Chairward's stop is a protective stop",
            "fit and try a contactor stop that is independent of this software",
            needed=False,
        )
    if site.plan.kind in (ChairKind.CHAIR, ChairKind.ROBOT):
        yield from measured(_stopping(site.plan), date.fromtimestamp(time.time()), site.plan.chair)


def _stopping(plan: Plan) -> Mapping[str, Any]:
    import tomllib

    table: Mapping[str, Any] = tomllib.loads(Path(plan.chair_file).read_text(encoding="utf-8")).get("stopping", {})
    return table


def measured(stopping: Mapping[str, Any], today: date, chair: str) -> Iterable[Finding]:
    """The reaction that the proof rests on: measured on this chair, and not too long ago."""
    on = stopping.get("reaction_measured")
    fix = f"chairward check timing --chair {chair}"
    if on is None:
        return [Finding("reaction", False, "its reaction time was never measured", fix, needed=False)]
    days = (today - on).days
    if days > MEASURED_DAYS:
        return [Finding("reaction", False, f"its reaction time was measured {days} days ago", fix, needed=False)]
    return [Finding("reaction", True, f"its reaction time was measured on {on.isoformat()}")]


def checks() -> Sequence[Check]:
    """The core's own checks."""
    return [
        Check(name="real time", look=_realtime),
        Check(name="processor", look=processor),
        Check(name="disk", look=_disk),
        Check(name="clock", look=_clock),
        Check(name="devices", look=devices),
        Check(name="chair", look=chair),
    ]

"""What is wrong on this machine and with this chair, each finding with one fix. First form: looks, moves nothing.

Every check is a small function that yields findings; none of them opens a device that a running chair may be using.
"""

from __future__ import annotations

import ctypes.util
import grp
import os
import resource
import shutil
import sys
import time
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from chairward import profile
from chairward.plan import ChairKind, Plan
from chairward.plugins import PluginError, Registry

MIN_FREE_BYTES = 500_000_000
MIN_YEAR = 2024


@dataclass(frozen=True, slots=True)
class Finding:
    """ok: nothing to do. what: one sentence. fix: what to do, empty when ok. needed: False for a mere advice."""

    check: str
    ok: bool
    what: str
    fix: str = ""
    needed: bool = True


def examine(registry: Registry, chair: str | None, person: str | None) -> Iterator[Finding]:
    """All checks; those about a chair only when one is named."""
    yield from _python()
    yield from _plugins(registry)
    yield from _realtime()
    yield from _disk()
    yield from _clock()
    if chair is None:
        return
    try:
        plan = profile.load(chair, person, [], registry)
    except (ValueError, PluginError) as error:
        yield Finding("profile", False, str(error), "correct the file at that place")
        return
    yield Finding(
        "profile", True, f"chair '{plan.chair}' with person '{plan.person}' loads and its distances are proven"
    )
    for check in (_sound, _devices, _hardware_stop):
        yield from check(plan)


def _python() -> Iterator[Finding]:
    version = f"Python {sys.version_info.major}.{sys.version_info.minor}"
    ok = (3, 11) <= sys.version_info[:2] <= (3, 13)
    yield Finding("python", ok, version, "" if ok else "use Python 3.11, 3.12 or 3.13")
    linux = sys.platform == "linux"
    yield Finding("system", linux, sys.platform, "" if linux else "use Linux: the guard needs its sockets and clocks")


def _plugins(registry: Registry) -> Iterator[Finding]:
    for refused in registry.refused:
        yield Finding(
            "plugins", False, f"plugin '{refused.plugin}' {refused.reason}", "install a matching version of it"
        )
    if not registry.refused:
        count = sum(len(found) for found in registry.components.values())
        yield Finding("plugins", True, f"{count} components from {len(registry.manager.get_plugins())} plugins")


def _realtime() -> Iterator[Finding]:
    fifo = os.geteuid() == 0 or resource.getrlimit(resource.RLIMIT_RTPRIO)[0] >= 1
    yield Finding(
        "real time",
        fifo,
        "the guard may use SCHED_FIFO" if fifo else "the guard may not use SCHED_FIFO: its ticks can be late",
        "" if fifo else "add '@chairward - rtprio 60' to /etc/security/limits.d/chairward.conf and log in again",
        needed=False,
    )
    limit = resource.getrlimit(resource.RLIMIT_MEMLOCK)[0]
    lock = os.geteuid() == 0 or limit in (-1, resource.RLIM_INFINITY)
    yield Finding(
        "memory",
        lock,
        "the guard may lock its memory" if lock else f"the guard may lock only {limit // 1024} kB",
        ""
        if lock
        else "add '@chairward - memlock unlimited' to /etc/security/limits.d/chairward.conf and log in again",
        needed=False,
    )


def _disk() -> Iterator[Finding]:
    free = shutil.disk_usage(Path.home()).free
    ok = free > MIN_FREE_BYTES
    yield Finding(
        "disk", ok, f"{free // 1_000_000} MB free for recordings", "" if ok else "make room in your home folder"
    )


def _clock() -> Iterator[Finding]:
    ok = time.gmtime().tm_year >= MIN_YEAR
    yield Finding(
        "clock", ok, time.strftime("%Y-%m-%d %H:%M"), "" if ok else "set the clock: recordings are dated by it"
    )


def _sound(plan: Plan) -> Iterator[Finding]:
    if all(lane.source.component != "microphone" or lane.source.settings.get("kind") != "live" for lane in plan.lanes):
        return
    ok = ctypes.util.find_library("portaudio") is not None
    yield Finding(
        "microphone",
        ok,
        "PortAudio is there" if ok else "PortAudio is missing",
        "" if ok else "sudo apt install libportaudio2",
    )


def _devices(plan: Plan) -> Iterator[Finding]:
    """Every absolute device path in the settings: there, and may be opened by this user."""
    parts = [plan.drive, *(part for lane in plan.lanes for part in (lane.source, *lane.stages))]
    for part in parts:
        for key, path in _paths(part.settings):
            where = f"{part.component}.{key} = {path}"
            if not path.exists():
                yield Finding("devices", False, f"{where} is not there", "plug the device in or correct the path")
            elif not os.access(path, os.R_OK | os.W_OK if path.is_char_device() else os.R_OK):
                group = _group(path)
                yield Finding(
                    "devices", False, f"{where} may not be opened", f"sudo usermod -aG {group} $USER, log in again"
                )
            else:
                yield Finding("devices", True, f"{where} is there")


def _paths(settings: Any) -> Iterator[tuple[str, Path]]:
    for key, value in settings.items():
        if isinstance(value, str) and value.startswith("/") and "{run}" not in value:
            yield key, Path(value)


def _group(path: Path) -> str:
    try:
        return grp.getgrgid(path.stat().st_gid).gr_name
    except KeyError:
        return str(path.stat().st_gid)


def _hardware_stop(plan: Plan) -> Iterator[Finding]:
    if plan.kind is ChairKind.CHAIR:
        yield Finding(
            "hardware stop",
            True,
            "somebody sits in this chair: Chairward's stop is a protective stop",
            "fit and try a contactor stop that is independent of this software",
            needed=False,
        )

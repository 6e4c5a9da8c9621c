"""What is wrong with the machine or with what is installed is found with a fix; the kernel's view is a folder."""

from __future__ import annotations

from collections.abc import Callable
from datetime import date
from importlib.metadata import EntryPoint, PathDistribution
from pathlib import Path
from typing import Any

import pytest
from doctor_faults import as_a_user

from chairward.doctor import machine
from chairward.findings import Site
from chairward.plugins import discover


def kernel(folder: Path, **files: str) -> Site:
    for name, text in files.items():
        path = folder / name.replace("__", "/")
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(text)
    return Site(registry=discover([]), root=folder)


def dist(folder: Path, name: str, requires: str) -> PathDistribution:
    at = folder / f"{name}-1.0.dist-info"
    at.mkdir()
    (at / "METADATA").write_text(f"Metadata-Version: 2.1\nName: {name}\nVersion: 1.0\nRequires-Dist: {requires}\n")
    (at / "entry_points.txt").write_text(f"[chairward.plugins]\n{name} = {name}\n")
    return PathDistribution(at)


def locked(path: Path) -> Path:
    path.touch(0)
    return path


class OldPlugin:
    """Written for an API that is no more."""

    CHAIRWARD_API = 0


MACHINE: dict[str, tuple[Callable[[Path], Any], str]] = {
    "old python": (lambda _: machine.python((3, 9), "linux"), "Python 3.9"),
    "not linux": (lambda _: machine.python((3, 11), "darwin"), "darwin"),
    "plugin that cannot be imported": (
        lambda _: machine.plugins(discover([EntryPoint("sonar", "no_such_module_at_all", "chairward.plugins")])),
        "'sonar' cannot be imported",
    ),
    "plugin for another api": (
        lambda _: machine.plugins(discover([], {"old": OldPlugin()})),
        "'old' was written for API 0",
    ),
    "plugin without what it needs": (
        lambda folder: machine.packages([dist(folder, "sonar", "no-such-package>=2")]),
        "needs no-such-package, which is not installed",
    ),
    "no real time": (lambda _: machine.realtime(False, -1), "may not use SCHED_FIFO"),
    "no locked memory": (lambda _: machine.realtime(True, 65536), "may lock only 64 kB"),
    "power saving": (
        lambda folder: machine.processor(
            kernel(folder, sys__devices__system__cpu__cpu0__cpufreq__scaling_governor="powersave\n")
        ),
        "governor is 'powersave'",
    ),
    "one core": (
        lambda folder: machine.processor(kernel(folder, sys__devices__system__cpu__online="0\n")),
        "one core",
    ),
    "disk full": (lambda folder: machine.disk(folder, 1_000_000), "1 MB free"),
    "recordings cannot be kept": (
        lambda folder: machine.disk((kernel(folder, blocked="") and folder / "blocked") / "recordings", 10**10),
        "blocked is no folder",
    ),
    "clock never set": (lambda _: machine.clock(date(1970, 1, 2)), "1970-01-02"),
    "device may not be opened": (
        lambda folder: as_a_user(lambda: [machine.device("keys.device", locked(folder / "kbd"))]),
        "kbd may not be opened",
    ),
    "device path wrong": (lambda folder: [machine.device("keys.device", folder / "kbd")], "kbd is not there"),
    "reaction never measured": (lambda _: machine.measured({}, date(2026, 1, 1), "box"), "never measured"),
    "reaction measured long ago": (
        lambda _: machine.measured({"reaction_measured": date(2020, 1, 1)}, date(2026, 1, 1), "box"),
        "2192 days ago",
    ),
}


@pytest.mark.parametrize("name", MACHINE)
def test_what_is_wrong_with_the_machine_is_found_with_a_fix(name: str, tmp_path: Path) -> None:
    make, says = MACHINE[name]
    bad = [f for f in make(tmp_path) if not f.ok]
    assert [f for f in bad if says in f.what], bad
    assert all(f.fix for f in bad)


def test_no_fix_of_a_chair_that_was_never_measured_has_a_blank_to_fill_in() -> None:
    (found,) = machine.measured({}, date(2026, 1, 1), "box")
    assert found.fix == "chairward check timing --chair box"

"""A run, fully resolved: what chair file, person file and `--set` come to. Made by `chairward.profile.load`,
written as JSON for the processes of the run, never edited by hand."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from enum import StrEnum
from pathlib import Path
from typing import Any

import msgspec

from chairward.components import Context, Footprint, Pose
from chairward.facts import Limits
from chairward.messages import Button, Way


class ChairKind(StrEnum):
    """What stands behind the drive: decides what is allowed (thesis methods never on a chair somebody sits in)."""

    SIMULATOR = "simulator"
    FILES = "files"
    ROBOT = "robot"
    CHAIR = "chair"


@dataclass(frozen=True, slots=True, kw_only=True)
class Part:
    """One component with its checked settings (as JSON values); plugin: the entry point that offers it."""

    component: str
    settings: Mapping[str, Any] = field(default_factory=dict)
    plugin: str = ""


@dataclass(frozen=True, slots=True, kw_only=True)
class LanePlan:
    """One lane: a source, then its stages in order.

    freshness_ns: how old the newest report of each vetoing stage, recognizer or stop device of it may be.
    covers: the ways its sensors watch (declared, rule 10). may: the buttons it is entitled to press.
    stop_device: its Alive is a required vote. ends_run: the run ends when its source has given everything.
    observes: its source also gets copies of all records and of all pictures (a screen that shows and presses).
    """

    name: str
    source: Part
    stages: tuple[Part, ...] = ()
    freshness_ns: int = 200_000_000
    covers: frozenset[Way] = frozenset()
    pose: Pose = field(default_factory=Pose)
    may: frozenset[Button] = frozenset()
    stop_device: bool = False
    ends_run: bool = False
    observes: bool = False


@dataclass(frozen=True, slots=True, kw_only=True)
class Plan:
    """Everything a run needs. Paths in settings have been made absolute; "{run}" in them is the run's folder.

    recorder: how `chairward run` records, where the chair file names no recorder of its own.
    """

    chair: str
    chair_file: str
    kind: ChairKind
    person: str
    person_file: str
    person_dir: str
    language: str
    words: Mapping[str, str]
    footprint: Footprint
    limits: Limits
    drive: Part
    lanes: tuple[LanePlan, ...]
    companions: Mapping[str, Part] = field(default_factory=dict)
    observers: Mapping[str, Part] = field(default_factory=dict)
    recorder: Part = field(default_factory=lambda: Part(component="recorder", plugin="core"))

    def context(self, lane: str, pose: Pose, run_dir: Path) -> Context:
        """What a component of `lane` is told."""
        return Context(
            lane=lane,
            run_dir=run_dir,
            chair_dir=Path(self.chair_file).parent,
            pose=pose,
            footprint=self.footprint,
            person=self.person,
            person_dir=Path(self.person_dir),
            words=dict(self.words),
            language=self.language,
            stop_mm=self.limits.stop_mm,
            avoid_mm=self.limits.avoid_mm,
        )


def fill_run_dir(settings: Mapping[str, Any], run_dir: Path) -> dict[str, Any]:
    """The settings with "{run}" in strings replaced by the run's folder."""
    return {k: v.replace("{run}", str(run_dir)) if isinstance(v, str) else v for k, v in settings.items()}


def write(plan: Plan, path: Path) -> None:
    """Write the plan as JSON."""
    path.write_bytes(msgspec.json.format(msgspec.json.encode(plan), indent=1))


def read(path: Path) -> Plan:
    """The plan back. Raises msgspec.DecodeError."""
    return msgspec.json.decode(path.read_bytes(), type=Plan)

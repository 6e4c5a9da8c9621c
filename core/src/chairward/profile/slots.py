"""Every component of a chair, each with the layers of its settings: the chair file's, the person's, `--set`."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from chairward.components import Component
from chairward.plan import ChairKind
from chairward.plugins import PluginError, Registry
from chairward.profile.errors import ProfileError
from chairward.profile.files import Override, ProfileFile
from chairward.profile.lanes import Lane
from chairward.profile.models import Chair, Person
from chairward.profile.settings import Layer, Slot

RECORDER = "recorder"
"""The observer that `chairward run` adds; settings.recorder in either file is for it."""


@dataclass(frozen=True, slots=True)
class Given:
    """What a load starts from: two files and what they say, what was said beside them, and the plugins there are."""

    chair_file: ProfileFile
    chair: Chair
    person_file: ProfileFile
    person: Person
    overrides: Sequence[Override]
    registry: Registry

    @property
    def label(self) -> str:
        """How errors call the chair file."""
        return self.chair_file.label


def every_slot(given: Given, found: Sequence[Lane], drive: str) -> list[Slot]:
    """The slots of all lanes, drives, companions and observers. Raises ProfileError."""
    slots = [*_of_lanes(given, found), *_of_drives(given, drive), *_of_programs(given, drive)]
    recorder = given.registry.components["observer"].get(RECORDER)
    if recorder is not None and all(slot.component.name != RECORDER for slot in slots):
        slots.append(_slot(given, recorder, f"settings.{RECORDER}.", {}, RECORDER))  # named by the file or not
    _check_used(given, slots)
    return slots


def _of_lanes(given: Given, found: Sequence[Lane]) -> Iterator[Slot]:
    for lane in found:
        names = [lane.source.name, *lane.table.stages]
        for name in lane.table.settings:
            if name not in names:
                raise ProfileError(
                    f"{given.label}: lane.{lane.name}.settings.{name}: this lane has no '{name}' "
                    f"(it has: {', '.join(names)})"
                )
        for _, component in lane.components:
            own = lane.table.settings.get(component.name, {})
            place = f"lane.{lane.name}.settings.{component.name}."
            yield _slot(given, component, place, own, f"lane.{lane.name}.{component.name}", lane.name)


def _of_drives(given: Given, drive: str) -> Iterator[Slot]:
    """Of the drives that are not used those that a plugin offers: what their tables say is checked too."""
    for name, own in given.chair.drive.items():
        if name == drive or name in given.registry.components["drive"]:
            yield _slot(given, _component(given, "drive", name, "drive"), f"drive.{name}.", own, f"drive.{name}")


def _of_programs(given: Given, drive: str) -> Iterator[Slot]:
    chair = given.chair
    for kind, tables in (("companion", chair.companion), ("observer", chair.observer)):
        for name, part in tables.items():
            if part.with_drive is not None and part.with_drive not in chair.drive:
                raise ProfileError(
                    f"{given.label}: {kind}.{name}.with_drive = '{part.with_drive}', but this chair offers only "
                    f"{', '.join(chair.drive)}"
                )
            if part.with_drive in (None, drive):
                component = _component(given, kind, part.component, f"{kind}.{name}.component")
                yield _slot(given, component, f"{kind}.{name}.settings.", part.settings, f"{kind}.{name}")


def _component(given: Given, kind: str, name: str, key: str) -> Component:
    try:
        return given.registry.get(kind, name)
    except PluginError as error:
        raise ProfileError(f"{given.label}: {key} = '{name}': {error}") from None


def _slot(given: Given, component: Component, place: str, own: Mapping[str, Any], where: str, lane: str = "") -> Slot:
    """The layers of one component, weakest first. place: where in the chair file its own settings stand."""
    name, chair_dir, person_file = component.name, given.chair_file.path.parent, given.person_file
    wishes = given.person.settings.get(name, {})
    asks = given.chair.kind is ChairKind.CHAIR
    layers = [
        Layer(given.chair.settings.get(name, {}), f"{given.label}: settings.{name}.", chair_dir),
        Layer(own, f"{given.label}: {place}", chair_dir),
        Layer(wishes, f"{person_file.label}: settings.{name}.", person_file.path.parent, asks=True),
        *[
            Layer(change.values, change.where, Path.cwd(), asks=asks)
            for change in given.overrides
            if change.table == name
        ],
    ]
    return Slot(component, tuple(layer for layer in layers if layer.values), where, f"{given.label}: {place}", lane)


def _check_used(given: Given, slots: Sequence[Slot]) -> None:
    """Settings of a component that is not in this chair are mistakes, not wishes."""
    chair, label = given.chair, given.label
    used = {slot.component.name for slot in slots}
    offered = used | set(chair.drive) | {c.component for c in chair.companion.values()}
    named = [(f"{label}: settings.{name}", name) for name in chair.settings]
    named += [(f"{label}: choices.{name}", name) for name in chair.choices]
    named += [(f"{given.person_file.label}: settings.{name}", name) for name in given.person.settings]
    named += [(f"--set {c.table}.{c.key}", c.table) for c in given.overrides if c.table not in ("", "limits")]
    for text, name in named:
        if text.startswith("--set") and name in Chair.model_fields:
            raise ProfileError(f"{text}: stands in the chair file alone: --set takes limits and components' settings")
        if name not in offered:
            raise ProfileError(f"{text}: this chair uses no component '{name}' (it uses: {', '.join(sorted(used))})")

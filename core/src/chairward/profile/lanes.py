"""Lanes: is every stage fed by an earlier one, and which votes does the guard have to wait for."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

from chairward.components import Component
from chairward.facts import MS, SourceLimits
from chairward.messages import Button, Intent, Press, RangeReading, Stick, Veto
from chairward.plugins import PluginError, Registry
from chairward.profile.errors import ProfileError
from chairward.profile.models import Chair, LaneTable


@dataclass(frozen=True, slots=True)
class Lane:
    """A lane of the chair file with its components found."""

    name: str
    table: LaneTable
    source: Component
    stages: tuple[tuple[str, Component], ...]
    """("sensor" or "recognizer", component) in order."""

    @property
    def components(self) -> tuple[tuple[str, Component], ...]:
        """Source and stages with their kinds."""
        return (("source", self.source), *self.stages)


@dataclass(slots=True)
class Votes:
    """Every required vote by name, "lane/stage"."""

    sensors: dict[str, SourceLimits] = field(default_factory=dict)
    recognizers: dict[str, SourceLimits] = field(default_factory=dict)
    stop_devices: dict[str, SourceLimits] = field(default_factory=dict)
    vetoers: dict[str, SourceLimits] = field(default_factory=dict)


def find(chair: Chair, registry: Registry, label: str) -> list[Lane]:
    """The lanes with their components, in order and checked. Raises ProfileError."""
    lanes = []
    for name, table in chair.lane.items():
        key = f"{label}: lane.{name}.source = '{table.source}'"
        try:
            source = registry.get("source", table.source)
            key = f"{label}: lane.{name}.stages"
            stages = tuple(registry.stage(stage) for stage in table.stages)
        except PluginError as error:
            raise ProfileError(f"{key}: {error}") from None
        if twice := next((s for s in table.stages if table.stages.count(s) > 1), None):
            raise ProfileError(f"{key}: '{twice}' is named twice: name it once")
        lanes.append(Lane(name, table, source, stages))
    for lane in lanes:
        _check_order(lane, registry, label)
        _check_claims(lane, label)
    return lanes


def _check_order(lane: Lane, registry: Registry, label: str) -> None:
    """Each stage must find on the bench what it needs, put there by the source or an earlier stage."""
    there = set(lane.source.gives)
    stages = [component for _, component in lane.stages]
    for index, stage in enumerate(stages):
        for need in stage.needs:
            if need in there:
                continue
            start = f"{label}: lane.{lane.name}: stage '{stage.name}' needs {need.__name__}"
            if later := next((s for s in stages[index + 1 :] if need in s.gives), None):
                raise ProfileError(f"{start}, which '{later.name}' gives: move '{later.name}' before it")
            offers = _who_gives(need, registry)
            advice = f"put one of them before it ({offers})" if offers else "install a plugin that gives it"
            raise ProfileError(
                f"{start}, which neither the source '{lane.source.name}' nor an earlier stage gives: {advice}"
            )
        there |= set(stage.gives)


def _who_gives(need: type[object], registry: Registry) -> str:
    """Installed sources and stages that give a type."""
    kinds = ("source", "sensor", "recognizer")
    found = [f"'{n}'" for kind in kinds for n, c in registry.components[kind].items() if need in c.gives]
    return ", ".join(sorted(found))


def _check_claims(lane: Lane, label: str) -> None:
    """What the lane claims (covers, buttons, stop device) must be something it can do."""
    start = f"{label}: lane.{lane.name}"
    senses = any(RangeReading in component.gives for _, component in lane.components)
    if lane.table.covers and not senses:
        raise ProfileError(f"{start}.covers: nothing in this lane gives distances: add a sensor or remove covers")
    if senses and not lane.table.covers:
        raise ProfileError(f"{start}.covers is missing: say which ways its sensor watches (ahead, behind, left, right)")
    if not lane.table.stop_device:
        return
    if Press not in lane.source.gives:
        raise ProfileError(
            f"{start}.stop_device = true, but source '{lane.source.name}' has no button to press: use one that has"
        )
    if Button.STOP not in lane.table.may:
        raise ProfileError(f"{start}.may must name 'stop': the lane is a stop device")


def votes(lanes: Sequence[Lane]) -> Votes:
    """What each lane owes the guard, and how old it may be."""
    found = Votes()
    for lane in lanes:
        limits = SourceLimits(freshness_ns=lane.table.freshness_ms * MS, covers=lane.table.covers)
        plain = SourceLimits(freshness_ns=limits.freshness_ns)
        for kind, component in lane.components:
            name = f"{lane.name}/{component.name}"
            if RangeReading in component.gives:
                found.sensors[name] = limits
            if Veto in component.gives:
                found.vetoers[name] = plain
            if kind == "recognizer" or (kind == "source" and {Intent, Stick} & set(component.gives)):
                found.recognizers[name] = plain
        if lane.table.stop_device:
            found.stop_devices[f"{lane.name}/{lane.source.name}"] = plain
    return found

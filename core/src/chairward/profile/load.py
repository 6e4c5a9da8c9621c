"""Chair file + person file + `--set` -> Plan. All or nothing: a wrong file never half-loads."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import platformdirs

from chairward.components import Footprint, Pose
from chairward.facts import MS, Limits
from chairward.messages import Command, Way
from chairward.plan import LanePlan, Part, Plan
from chairward.plugins import Registry
from chairward.profile import files, lanes, refusals
from chairward.profile.errors import ProfileError
from chairward.profile.files import Override, ProfileFile
from chairward.profile.lanes import Lane
from chairward.profile.limits import resolve
from chairward.profile.merge import merge, validated
from chairward.profile.models import Chair, LimitsTable, Person
from chairward.profile.proof import Proof, prove
from chairward.profile.settings import Slot, parts
from chairward.profile.slots import RECORDER, Given, every_slot


@dataclass(frozen=True, slots=True)
class Loaded:
    """A plan, its proof, and where each limit and setting came from ("limits.stop_mm" -> "people/asha.toml").

    unmeasured: why this chair may not drive yet, "" when it may: its drive has still to be measured.
    """

    plan: Plan
    proof: Proof
    origin: dict[str, str]
    unmeasured: str = ""


def load(
    chair: str | Path,
    person: str | Path | None,
    sets: Sequence[str],
    registry: Registry,
    profiles_dir: Path | None = None,
) -> Plan:
    """The plan of a run. person None: the one the chair file names. Raises ProfileError."""
    loaded = load_traced(chair, person, sets, registry, profiles_dir)
    if loaded.unmeasured:
        raise ProfileError(loaded.unmeasured)
    return loaded.plan


def read_chair(file: ProfileFile) -> Chair:
    """A chair file's own checks. Raises ProfileError."""
    chair = validated(Chair, file.values, f"{file.label}: ")
    if file.path.stem != chair.name:
        raise ProfileError(f"{file.label}: name = '{chair.name}': must be the file's name, '{file.path.stem}'")
    return chair


def read_person(file: ProfileFile) -> Person:
    """A person file's own checks. Raises ProfileError."""
    for key in file.values:
        if key in Chair.model_fields and key not in Person.model_fields:
            raise ProfileError(f"{file.label}: {key} is the integrator's alone, in the chair file: remove it")
    person = validated(Person, file.values, f"{file.label}: ")
    if file.path.stem != person.name:
        raise ProfileError(f"{file.label}: name = '{person.name}': must be the file's name, '{file.path.stem}'")
    return person


def load_traced(
    chair: str | Path,
    person: str | Path | None,
    sets: Sequence[str],
    registry: Registry,
    profiles_dir: Path | None = None,
) -> Loaded:
    """As `load`, with the proof and where the values came from; a drive that was not measured is told, not refused."""
    folder = files.directory(profiles_dir)
    overrides = files.overrides(sets)
    chair_file = files.read(files.find("chairs", chair, folder))
    table = read_chair(chair_file)
    if person is None and table.person is None:
        known = ", ".join(files.names("people", folder)) or "none"
        raise ProfileError(f"{chair_file.label}: names no person: say who drives (there: {known})")
    person_file = files.read(files.find("people", person or str(table.person), folder))
    return load_files(chair_file, person_file, registry, overrides)


def load_files(
    chair_file: ProfileFile, person_file: ProfileFile, registry: Registry, overrides: Sequence[Override] = ()
) -> Loaded:
    """As `load_traced`, of what has been read (or is only about to be written). Raises ProfileError."""
    table, rider = read_chair(chair_file), read_person(person_file)
    if table.name not in rider.chairs:
        raise ProfileError(
            f"{person_file.label}: chair = {', '.join(rider.chairs)}, but this chair is '{table.name}': "
            "add it there once it was tried with this person"
        )
    rider = _overridden(rider, overrides)
    return _Loading(Given(chair_file, table, person_file, rider, overrides, registry)).result()


def load_chair(file: ProfileFile, drive: str, registry: Registry) -> Loaded:
    """A chair file on its own, with somebody who asks for nothing, and one of its drives. Raises ProfileError."""
    chair = read_chair(file)
    nobody = Person(name="nobody", chair=chair.name, drive=drive, words={"stop": Command.STOP})
    return _Loading(Given(file, chair, file, nobody, (), registry)).result()


def check_chair(file: ProfileFile, registry: Registry) -> Loaded:
    """`load_chair` with each of its drives; the first that may not drive yet, else the first. Raises ProfileError."""
    every = [load_chair(file, drive, registry) for drive in read_chair(file).drive]
    return next((loaded for loaded in every if loaded.unmeasured), every[0])


def _overridden(person: Person, overrides: Sequence[Override]) -> Person:
    """`--set drive=...` and `--set language=...`."""
    raw = person.model_dump(mode="json")
    for change in overrides:
        if not change.table:
            person = validated(Person, {**raw, change.key: change.value}, "--set ")
            raw = person.model_dump(mode="json")
    return person


class _Loading:
    """One load: what was given, and the steps from it to a plan."""

    def __init__(self, given: Given) -> None:
        self.given = given
        self.chair, self.label, self.overrides = given.chair, given.label, given.overrides
        self.person, self.rider = given.person, given.person_file.label

    def result(self) -> Loaded:
        """All checks, in the order in which their errors help most."""
        limits = self._limits()
        found = lanes.find(self.chair, self.given.registry, self.label)
        drive = self._drive()
        slots = every_slot(self.given, found, drive)
        made = parts(slots, self.chair.choices, self.label)
        votes = lanes.votes(found)
        listens = any(kind == "recognizer" for lane in found for kind, _ in lane.stages)
        refusals.words(self.person, self.rider, self.chair, limits, listens=listens)
        refusals.stop_device(self.label, found)
        refusals.covers_ahead(self.label, found)
        refusals.ridden(self.chair, self.label, found, slots, made)
        freshness = max(limit.freshness_ns for limit in votes.sensors.values()) // MS
        behind = any(Way.BEHIND in limit.covers for limit in votes.sensors.values())
        proof = prove(limits, self.chair.stopping, freshness, self._limit_place, sees_behind=behind)
        by_place = {slot.where: part for slot, part in zip(slots, made, strict=True)}
        driven = next(slot for slot in slots if slot.where == f"drive.{drive}")
        refusals.drive(driven, by_place[driven.where], limits, self.chair.stopping)
        unmeasured = refusals.silence(driven, by_place[driven.where], self.chair)
        plan = self._plan(found, drive, by_place, resolve(limits, self.chair, votes, proof))
        return Loaded(plan, proof, self._origins(slots), unmeasured)

    def _limits(self) -> LimitsTable:
        """The chair's limits, then the person's, then `--set limits.*` as a further wish of the person."""
        limits = merge(self.chair.limits, self.person.limits, f"{self.rider}: limits.")
        sets = {change.key: change.value for change in self.overrides if change.table == "limits"}
        return merge(self.chair.limits, {**self.person.limits, **sets}, "--set limits.") if sets else limits

    def _limit_place(self, key: str) -> str:
        """Where a limit's value stands, for errors of the proof."""
        if any(change.table == "limits" and change.key == key for change in self.overrides):
            return f"--set limits.{key}"
        if key in self.person.limits:
            return f"{self.rider}: limits.{key}"
        return f"{self.label}: {'limits' if key in LimitsTable.model_fields else 'stopping'}.{key}"

    def _drive(self) -> str:
        """The drive the person uses."""
        offered = self.chair.drive
        names = ", ".join(offered)
        if self.person.drive is None:
            if len(offered) > 1:
                raise ProfileError(f"{self.rider}: drive is missing: this chair offers {names}, choose one")
            return next(iter(offered))
        if self.person.drive not in offered:
            changed = any(c.key == "drive" and not c.table for c in self.overrides)
            place = "--set drive" if changed else f"{self.rider}: drive"
            raise ProfileError(f"{place} = '{self.person.drive}', but this chair offers only {names}")
        return self.person.drive

    def _plan(self, found: Sequence[Lane], drive: str, by_place: dict[str, Part], limits: Limits) -> Plan:
        chair, person = self.chair, self.person
        return Plan(
            chair=chair.name,
            chair_file=str(self.given.chair_file.path),
            kind=chair.kind,
            person=person.name,
            person_file=str(self.given.person_file.path),
            person_dir=str(platformdirs.user_data_path("chairward") / "people" / person.name),
            language=person.language,
            words={word: str(command) for word, command in person.words.items()},
            footprint=Footprint(**chair.footprint.model_dump()),
            limits=limits,
            drive=by_place[f"drive.{drive}"],
            lanes=tuple(
                LanePlan(
                    name=lane.name,
                    source=by_place[f"lane.{lane.name}.{lane.source.name}"],
                    stages=tuple(by_place[f"lane.{lane.name}.{stage}"] for stage in lane.table.stages),
                    freshness_ns=lane.table.freshness_ms * MS,
                    covers=lane.table.covers,
                    pose=Pose(**lane.table.pose.model_dump()),
                    may=lane.table.may,
                    stop_device=lane.table.stop_device,
                    ends_run=lane.table.ends_run,
                    observes=lane.table.observes,
                )
                for lane in found
            ),
            companions={n: by_place[f"companion.{n}"] for n in chair.companion if f"companion.{n}" in by_place},
            observers={n: by_place[f"observer.{n}"] for n in chair.observer if f"observer.{n}" in by_place},
            **({"recorder": by_place[RECORDER]} if RECORDER in by_place else {}),
        )

    def _origins(self, slots: Sequence[Slot]) -> dict[str, str]:
        """Where each limit and setting came from; what is not named is a default."""
        origin = {}
        for key in LimitsTable.model_fields:
            place = self._limit_place(key)
            if place.startswith(self.label) and key not in self.chair.limits.model_fields_set:
                continue
            origin[f"limits.{key}"] = place.partition(": ")[0] if ": " in place else "--set"
        for slot in slots:
            for layer in slot.layers:
                for key in layer.values:
                    origin[f"{slot.where}.{key}"] = layer.where.partition(": ")[0] if ": " in layer.where else "--set"
        return origin

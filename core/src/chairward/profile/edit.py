"""Changing a person file from a program: its comments stay, and nothing is written that the loader would refuse."""

from __future__ import annotations

import os
import re
import tomllib
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import tomlkit
from pydantic_core import to_jsonable_python
from tomlkit.exceptions import TOMLKitError

from chairward.plugins import Registry
from chairward.profile import files
from chairward.profile.errors import ProfileError, shown
from chairward.profile.files import ProfileFile
from chairward.profile.load import load_files, read_chair, read_person
from chairward.profile.merge import mark_of
from chairward.profile.models import LimitsTable

TABLES = {"words": 2, "limits": 2, "settings": 3}
"""How many parts a key of each table has: settings.component.key; a word may itself have dots in it."""


@dataclass(frozen=True, slots=True)
class Change:
    """One value of a person file; value None takes the line out."""

    path: tuple[str, ...]
    value: Any


def changes(texts: Sequence[str]) -> list[Change]:
    """Take `limits.stop_mm=700`, `words.go on=front`, `language=hi`, `limits.lease_s=` (take out) apart.

    Raises ProfileError.
    """
    found = []
    for text in texts:
        table = re.split("[.=]", text)[0].strip()
        key, equals, value = text.rpartition("=") if table == "words" else text.partition("=")
        path = tuple(key.strip().split(".", TABLES.get(table, 1) - 1))
        if not equals or not all(path) or len(path) != TABLES.get(table, 1) or path == ("name",):
            raise ProfileError(
                f"{shown(text)}: write key=value, for example limits.stop_mm=700, words.forward=front or language=hi; "
                "a name is given by the file"
            )
        found.append(Change(path, None if not value.strip() else files.toml_value(value.strip())))
    return found


def changed(text: str, wanted: Sequence[Change]) -> str:
    """The TOML text with the changes made and everything else, comments too, as it was. Raises ProfileError."""
    try:
        document = tomlkit.parse(text)
        for change in wanted:
            table: Any = document
            *outer, last = change.path
            for step in outer:
                if step not in table and change.value is None:
                    break
                table = table.setdefault(step, tomlkit.table())
            else:
                if change.value is not None:
                    table[last] = change.value
                elif last in table:
                    del table[last]
        return str(tomlkit.dumps(document))
    except (TOMLKitError, TypeError, AttributeError, ValueError) as error:
        raise ProfileError(f"the file cannot be changed so: {error}") from None


def proofs(file: ProfileFile, registry: Registry, folder: Path) -> dict[str, str]:
    """The proof for every chair that a person file names. Raises ProfileError for the first that does not allow it."""
    return {
        chair: str(load_files(files.read(files.find("chairs", chair, folder)), file, registry).proof)
        for chair in read_person(file).chairs
    }


def edit(person: str, wanted: Sequence[Change], registry: Registry, folder: Path, *, write: bool) -> dict[str, str]:
    """Change people/<person>.toml if every chair it names allows it; returns the proofs. Raises ProfileError, OSError.

    All or nothing: the new file takes the old one's place in one step. write False: only say whether it would do.
    """
    path = files.find("people", person, folder)
    before = files.read(path)
    text = changed(path.read_text(encoding="utf-8"), wanted)
    found = proofs(ProfileFile(before.path, before.label, tomllib.loads(text)), registry, folder)
    if write:
        part = path.with_suffix(".toml.part")
        with part.open("w", encoding="utf-8") as file:
            file.write(text)
            file.flush()
            os.fsync(file.fileno())
        part.replace(path)
    return found


def limit_rows(chair_file: ProfileFile, person_file: ProfileFile) -> Iterator[dict[str, Any]]:
    """Every limit that a person may set: what it is, the chair's bound, which way is safer, the person's own value."""
    chair, person = read_chair(chair_file), read_person(person_file)
    schema = LimitsTable.model_json_schema()["properties"]
    for key in LimitsTable.model_fields:
        mark = mark_of(LimitsTable, key)
        if mark is not None:
            told = schema[key]
            yield {
                "key": key,
                "description": told.get("description", ""),
                "safer": mark.name.lower(),
                "chair": _plain(getattr(chair.limits, key)),
                "own": _plain(person.limits.get(key)),
                "least": told.get("minimum", told.get("exclusiveMinimum")),
                "most": told.get("maximum", told.get("exclusiveMaximum")),
                "whole": told.get("type") == "integer",
            }


def choice_rows(chair_file: ProfileFile, person_file: ProfileFile, registry: Registry) -> Iterator[dict[str, Any]]:
    """Every setting of a component that the chair lets the person choose, its schema and the person's own value."""
    chair, person = read_chair(chair_file), read_person(person_file)
    by_name = {name: c for components in registry.components.values() for name, c in components.items()}
    for component, table in chair.choices.items():
        schema: Mapping[str, Any] = {}
        if component in by_name:
            schema = by_name[component].settings.model_json_schema().get("properties", {})
        for key, choice in table.items():
            yield {
                "component": component,
                "key": key,
                "choice": _plain(choice),
                "schema": schema.get(key, {}),
                "chair": _plain(chair.settings.get(component, {}).get(key)),
                "own": _plain(person.settings.get(component, {}).get(key)),
            }


def _plain(value: Any) -> Any:
    """A value as JSON has it, sets sorted."""
    plain = to_jsonable_python(value, fallback=str)
    return sorted(plain) if isinstance(value, set | frozenset) else plain

"""docs/profiles.md names every key of the files, with its default, range and mark."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest
from pydantic import BaseModel
from pydantic_core import PydanticUndefined, to_jsonable_python

from chairward.profile.merge import Safer, mark_of
from chairward.profile.models import (
    Chair,
    FootprintTable,
    LaneTable,
    LimitsTable,
    PartTable,
    Person,
    PoseTable,
    StoppingTable,
)

ROOT = Path(__file__).resolve().parents[3]
DOCS = ROOT / "docs" / "profiles.md"


def row(model: type[BaseModel], key: str) -> str:
    """The line of a numeric key: | `key` | default | range | who | meaning |"""
    field = model.model_fields[key]
    default: Any = field.get_default()
    shown = "" if default is PydanticUndefined else to_jsonable_python(default)
    shown = "all" if isinstance(shown, list) else shown
    bounds = {name: getattr(m, name) for m in field.metadata for name in ("ge", "gt", "le") if hasattr(m, name)}
    low = f"{bounds['ge']:g}" if "ge" in bounds else f"> {bounds['gt']:g}" if "gt" in bounds else ""
    between = f"{low} to {bounds['le']:g}" if "le" in bounds else ""
    who = {Safer.HIGHER: "raise", Safer.LOWER: "lower", Safer.SUBSET: "drop some", Safer.FREE: "any", None: "-"}
    return f"| `{key}` | {shown} | {between} | {who[mark_of(model, key)]} | {field.description} |"


@pytest.mark.parametrize("model", [LimitsTable, StoppingTable])
def test_every_limit_has_its_line(model: type[BaseModel]) -> None:
    text = DOCS.read_text(encoding="utf-8")
    assert [line for key in model.model_fields if (line := row(model, key)) not in text] == []


@pytest.mark.parametrize("model", [Chair, Person, LaneTable, PoseTable, FootprintTable, PartTable])
def test_every_key_is_named(model: type[BaseModel]) -> None:
    text = DOCS.read_text(encoding="utf-8")
    assert [key for key in model.model_fields if f"`{key}`" not in text] == []


@pytest.mark.parametrize(
    "file", sorted(ROOT.glob("profiles/*/*.toml")), ids=lambda path: f"{path.parent.name}-{path.stem}"
)
def test_every_shipped_profile_is_in_its_table(file: Path) -> None:
    assert f"\n| `{file.stem}` | " in DOCS.read_text(encoding="utf-8")

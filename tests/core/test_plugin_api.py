"""The plugin API is what third parties build on: a change of a public name, field or hook needs a note.

`CHAIRWARD_WRITE_API=1 ./run test tests/core/test_plugin_api.py` writes docs/plugin-api.txt anew; then add a line to
CHANGELOG.md that says what changed, with the fingerprint that the test asks for. A change that breaks plugins needs a
new API_VERSION as well (docs/write-a-plugin.md, "When the API changes").
"""

from __future__ import annotations

import dataclasses
import enum
import hashlib
import importlib
import inspect
import os
import re
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import msgspec
import pydantic

from chairward import API_VERSION

ROOT = Path(__file__).resolve().parents[2]
SNAPSHOT = ROOT / "docs" / "plugin-api.txt"
MODULES = ("messages", "stages", "components", "hookspecs", "shared_state", "testing")


def public_api() -> str:
    """Every public name of the API's modules with its fields, methods and signatures, a line each."""
    lines = [f"API {API_VERSION}"]
    for name in MODULES:
        module = importlib.import_module(f"chairward.{name}")
        names = getattr(module, "__all__", None) or [n for n in vars(module) if not n.startswith("_")]
        for public in sorted(names):
            thing = getattr(module, public)
            if getattr(thing, "__module__", module.__name__).startswith(module.__name__):
                lines += [f"{name}.{line}" for line in described(public, thing)]
    return "\n".join(lines) + "\n"


def described(name: str, thing: Any) -> Iterator[str]:
    """One line for a name, and one for each of its members that a plugin can see."""
    if inspect.isclass(thing):
        yield f"{name}: class"
        for field in fields_of(thing):
            yield f"{name}.{field}"
        for member, function in sorted(vars(thing).items()):
            if inspect.isfunction(function) and not member.startswith(("_", "test_")):
                yield f"{name}.{member}{signature(function)}"
    elif inspect.isfunction(thing):
        yield f"{name}{signature(thing)}"
    elif isinstance(thing, int | float | str | bytes | tuple | frozenset):
        yield f"{name} = {thing!r}"
    else:
        yield name


def fields_of(cls: type) -> list[str]:
    """Name and type of each field, in order."""
    if issubclass(cls, enum.Enum):
        return [f"{member.name} = {member.value!r}" for member in cls]
    if issubclass(cls, msgspec.Struct):
        return [f"{f.name}: {written(f.type)}" for f in msgspec.structs.fields(cls)]
    if dataclasses.is_dataclass(cls):
        return [f"{f.name}: {written(f.type)}" for f in dataclasses.fields(cls)]
    if issubclass(cls, pydantic.BaseModel):
        return [f"{n}: {written(f.annotation)}" for n, f in cls.model_fields.items()]
    return []


def signature(function: Any) -> str:
    """As written, whatever Python version prints it."""
    return written(inspect.signature(function))


def written(kind: Any) -> str:
    """A type as text that is the same in every Python version."""
    text = kind if isinstance(kind, str) else str(kind)
    return re.sub(r"<class '([^']*)'>", r"\1", text).replace("typing.", "").replace("pathlib._local.", "pathlib.")


def test_every_change_of_the_plugin_api_is_noted() -> None:
    api = public_api()
    if os.environ.get("CHAIRWARD_WRITE_API") == "1":
        SNAPSHOT.write_text(api, encoding="utf-8")
    before = SNAPSHOT.read_text(encoding="utf-8")
    gone = sorted(set(before.splitlines()) - set(api.splitlines()))
    new = sorted(set(api.splitlines()) - set(before.splitlines()))
    assert api == before, f"the plugin API has changed; gone: {gone}; new: {new}; {__doc__}"
    fingerprint = hashlib.sha256(api.encode()).hexdigest()[:12]
    noted = (ROOT / "CHANGELOG.md").read_text(encoding="utf-8")
    assert f"plugin API {API_VERSION} ({fingerprint})" in noted, (
        f"CHANGELOG.md must say what changed for plugins, with: plugin API {API_VERSION} ({fingerprint})"
    )


def test_nothing_that_a_plugin_sees_is_left_without_a_word() -> None:
    bare = []
    for name in MODULES:
        module = importlib.import_module(f"chairward.{name}")
        for public, thing in vars(module).items():
            own = getattr(thing, "__module__", "") == module.__name__
            seen = own and not public.startswith("_") and (inspect.isclass(thing) or inspect.isfunction(thing))
            if seen and not (thing.__doc__ or "").strip():
                bare.append(f"{name}.{public}")
    assert bare == []

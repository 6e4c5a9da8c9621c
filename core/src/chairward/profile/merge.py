"""Person over chair, only ever towards the safer side.

Each field that a person may set is marked, `Annotated[int, Safer.HIGHER, Field(...)]`; a field without a mark is the
integrator's alone. A value that would loosen is refused with file, key, value and bound; nothing is clipped silently.
"""

from __future__ import annotations

import json
from collections.abc import Collection, Mapping
from datetime import date, time
from enum import Enum
from typing import Any, TypeVar

from pydantic import BaseModel, ValidationError

from chairward.profile.errors import ProfileError, dotted, sentence, shown

M = TypeVar("M", bound=BaseModel)


class Safer(Enum):
    """Which way a person may move a field that the integrator has set; the value is how an error says it."""

    HIGHER = "at least"
    LOWER = "at most"
    SUBSET = "only some of"
    FREE = "anything"


def mark_of(model: type[BaseModel], key: str) -> Safer | None:
    """The field's mark; None: the integrator's alone."""
    return next((m for m in model.model_fields[key].metadata if isinstance(m, Safer)), None)


def looser(mark: Safer | None, chair: Any, person: Any) -> bool:
    """Would the person's value allow more than the chair's?"""
    if mark is Safer.FREE or person == chair:
        return False
    if mark is Safer.HIGHER:
        return not person >= chair
    if mark is Safer.LOWER:
        return not person <= chair
    if mark is Safer.SUBSET:
        return not set(person) <= set(chair)
    return True


class WrongError(Exception):
    """One wrong value: the key ("" for the table as a whole) and what to say behind it."""

    def __init__(self, key: str, text: str) -> None:
        super().__init__(f"{key} {text}")
        self.key, self.text = key, text


def parse(model: type[M], raw: Mapping[str, Any]) -> M:
    """The model made from TOML values: types are not guessed ("600" is no number). Raises WrongError."""
    try:
        return model.model_validate_json(json.dumps(raw, default=_as_text), strict=True)
    except ValidationError as error:
        path, text = sentence(error, model, raw)
        raise WrongError(dotted(path), text) from None
    except (ValueError, RecursionError) as error:
        raise WrongError("", str(error) or "is nested too deeply") from None


def validated(model: type[M], raw: Mapping[str, Any], where: str) -> M:
    """As `parse`, but raises ProfileError. where: "chairs/sim.toml: limits." or "chairs/sim.toml: ", before the key."""
    try:
        return parse(model, raw)
    except WrongError as wrong:
        raise ProfileError(placed(wrong, where)) from None


def placed(wrong: WrongError, where: str) -> str:
    """The sentence for a wrong value in the table that begins with `where`."""
    return f"{where}{wrong.key} {wrong.text}" if wrong.key else f"{where.rstrip(': .')}: {wrong.text}"


def merge(chair: M, person: Mapping[str, Any], where: str) -> M:
    """The chair's table with the person's values in it. Raises ProfileError for each that would loosen.

    where: as in `validated`. Types, ranges and how values go together are checked by the model itself.
    """
    model = type(chair)
    merged = validated(model, {**chair.model_dump(mode="json"), **person}, where)
    for key in person:
        mark, old, new = mark_of(model, key), getattr(chair, key), getattr(merged, key)
        if looser(mark, old, new):
            raise ProfileError(f"{where}{key} = {shown(person[key])}, {bound(mark, old)}")
    return merged


def bound(mark: Safer | None, chair: Any) -> str:
    """How an error names what the chair allows."""
    value = (
        ", ".join(sorted(map(str, chair))) if isinstance(chair, Collection) and not isinstance(chair, str) else chair
    )
    if mark is None:
        return f"but only the integrator may set this (the chair has {value}): remove the line"
    return f"but this chair allows {mark.value} {value}"


def _as_text(value: object) -> str:
    """TOML's dates and times as JSON has them."""
    if isinstance(value, date | time):
        return value.isoformat()
    raise ValueError(f"{shown(value)} is a {type(value).__name__}, which no profile has")

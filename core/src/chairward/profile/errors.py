"""What a wrong profile says: one sentence with file, key, value, what is allowed and what to do."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from pydantic import BaseModel, ValidationError

LONGEST_SHOWN = 60
LONGEST_SENTENCE = 1000


class ProfileError(ValueError):
    """A chair file, person file or `--set` that cannot be used; its text is one readable sentence on one line."""

    def __init__(self, text: str) -> None:
        line = " ".join(text.split())
        super().__init__(line if len(line) <= LONGEST_SENTENCE else line[: LONGEST_SENTENCE - 3] + "...")


def shown(value: object) -> str:
    """The value as people read it in an error: one line, short, never raising (an int can be too long to print)."""
    try:
        text = repr(value)
    except (ValueError, RecursionError):
        return "..."
    text = " ".join(text.split())
    return text if len(text) <= LONGEST_SHOWN else text[: LONGEST_SHOWN - 3] + "..."


def at(raw: Any, path: Sequence[int | str]) -> object:
    """What stands at a path of keys and indices in nested TOML values; None when nothing does."""
    for step in path:
        if isinstance(raw, list):
            raw = dict(enumerate(raw))
        if not isinstance(raw, Mapping) or step not in raw:
            return None
        raw = raw[step]
    return raw


def dotted(path: Sequence[int | str]) -> str:
    """A path of keys as TOML writes it."""
    return ".".join(str(step) for step in path)


def sentence(error: ValidationError, model: type[BaseModel], raw: Mapping[str, Any]) -> tuple[list[int | str], str]:
    """The path of the first mistake in `raw` and what to say about it ("= 'x': input should be ...").

    Mistyped keys come first, missing ones last: the one is the likeliest cause of the other.
    """
    problems = error.errors(include_url=False)
    first = min(problems, key=lambda p: {"extra_forbidden": 0, "missing": 2}.get(p["type"], 1))
    path = _in_raw(raw, first["loc"])
    more = f" ({len(problems) - 1} more like it)" if len(problems) > 1 else ""
    if first["type"] == "extra_forbidden":
        known = _known_keys(model, path[:-1])
        return path, f"is not a setting here: remove or correct it{' (known: ' + known + ')' if known else ''}{more}"
    if first["type"] == "missing":
        return path, f"is missing: add it{more}"
    message = " ".join(str(first["msg"]).split()).removeprefix("Value error, ").rstrip(".")
    if first["type"] != "value_error":
        message = message[:1].lower() + message[1:]
    if not path:
        return path, message + more
    return path, f"= {shown(at(raw, path))}: {message}{more}"


def _in_raw(raw: object, loc: Sequence[int | str]) -> list[int | str]:
    """pydantic's location without what is not in the file (names of union members, "[key]" marks)."""
    path: list[int | str] = []
    for step in loc:
        here = at(raw, path)
        if isinstance(here, Mapping):
            if step in here or step == loc[-1]:
                path.append(step)
        elif isinstance(here, list) and isinstance(step, int):
            path.append(step)
    return [step for step in path if step != "[key]"]


def _known_keys(model: type[BaseModel], path: Sequence[int | str]) -> str:
    """The keys a table may have, as far as plain nested models tell; "" elsewhere."""
    for step in path:
        field = model.model_fields.get(str(step))
        if field is None:
            return ""
        annotation = field.annotation
        if not (isinstance(annotation, type) and issubclass(annotation, BaseModel)):
            return ""
        model = annotation
    return ", ".join(field.alias or name for name, field in model.model_fields.items())

"""What a wrong profile says: one sentence with file, key, value, what is allowed and what to do."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from pydantic import BaseModel, ValidationError
from pydantic_core import ErrorDetails

NAME = r"^[a-z0-9][a-z0-9_-]*$"
WORD = r"^[^\x00-\x1f\x7f]*\S[^\x00-\x1f\x7f]*$"
LANGUAGE = r"^[A-Za-z]{2,3}(-[A-Za-z0-9]{2,8})*$"
PATTERNS = {
    NAME: "use small letters, digits, - and _",
    WORD: "use letters, no line breaks",
    LANGUAGE: 'use a language code such as "en" or "pt-BR"',
}
"""What the patterns of the models mean, in plain words."""
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

    Mistyped keys come first, missing ones last: the one is the likeliest cause of the other. Where several kinds of
    value are allowed, what is nearest to one of them counts, and all are named.
    """
    problems = [(p["type"], _in_raw(raw, p), p) for p in error.errors(include_url=False)]
    kind, path, first = min(problems, key=lambda p: ({"extra_forbidden": 0, "missing": 2}.get(p[0], 1), -len(p[1])))
    more = len({dotted(p[1]) for p in problems if p[1] != path[: len(p[1])]})
    others = f" ({more} more like it)" if more else ""
    if kind == "extra_forbidden":
        known = _known_keys(model, path[:-1])
        return path, f"is not a setting here: remove or correct it{' (known: ' + known + ')' if known else ''}{others}"
    if kind == "missing":
        return path, f"is missing: add it{others}"
    allowed = list(dict.fromkeys(_plain(p) for _, where, p in problems if where == path))
    text = " or ".join([allowed[0], *(other.removeprefix("input should be ") for other in allowed[1:])])
    if first["loc"] and first["loc"][-1] == "[key]":
        return path, f"cannot be called so: {text}{others}"
    return path, f"= {shown(at(raw, path))}: {text}{others}" if path else text + others


def _plain(problem: ErrorDetails) -> str:
    """pydantic's words, with patterns and counts in plain ones."""
    if problem["type"] == "string_pattern_mismatch":
        return PATTERNS.get(problem["ctx"]["pattern"], f"must match {problem['ctx']['pattern']}")
    if problem["type"] == "too_short":
        return f"needs at least {problem['ctx']['min_length']}"
    text = " ".join(str(problem["msg"]).split()).rstrip(".")
    for json, toml in (("a valid array", "a list"), ("an object", "a table"), ("a valid dictionary", "a table")):
        text = text.replace(json, toml)
    if problem["type"] == "value_error":
        return text.removeprefix("Value error, ")
    return text[:1].lower() + text[1:]


def _in_raw(raw: object, problem: ErrorDetails) -> list[int | str]:
    """Where the problem is in the file: pydantic's location without names of union members and "[key]" marks."""
    path: list[int | str] = []
    absent = problem["type"] in ("missing", "extra_forbidden")
    for index, step in enumerate(problem["loc"]):
        here = at(raw, path)
        if isinstance(here, Mapping):
            if step in here or (absent and index == len(problem["loc"]) - 1):
                path.append(step)
        elif isinstance(here, list) and isinstance(step, int):
            path.append(step)
    return path


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

"""Settings of components: the chair file's, the person's choices and `--set`, checked by the component's own class.

A string "@microphone.manifest" means the value of that other setting; relative paths start at the file that names them
(at the current folder for `--set`); "{run}" is left for the run to fill in.
"""

from __future__ import annotations

import os
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, get_args

from pydantic import BaseModel
from pydantic_core import PydanticUndefined, to_jsonable_python

from chairward.components import Component, Settings
from chairward.plan import Part
from chairward.profile.errors import ProfileError, shown
from chairward.profile.merge import WrongError, bound, looser, mark_of, parse, placed
from chairward.profile.models import Choice, Interval

REFERENCE = re.compile(r"^@([A-Za-z0-9_-]+)\.([A-Za-z0-9_]+)$")
RUN = "{run}"


@dataclass(frozen=True, slots=True)
class Layer:
    """Values from one place. where: how errors call it, up to the key. base: where its relative paths start.

    asks: these are a person's wishes, allowed only as far as the integrator has left the choice.
    """

    values: Mapping[str, Any]
    where: str
    base: Path
    asks: bool = False


@dataclass(frozen=True, slots=True)
class Slot:
    """A place in the chair where a component works ("lane.front.eyes"). Later layers win.

    home: how errors call the place for a key that nobody has set. lane: "" outside lanes.
    """

    component: Component
    layers: tuple[Layer, ...]
    where: str
    home: str
    lane: str = ""

    def origin(self, key: str) -> str:
        """The place that decides a key, up to the key."""
        return next((layer.where for layer in reversed(self.layers) if key in layer.values), self.home)


Choices = Mapping[str, Mapping[str, Choice]]


def parts(slots: Sequence[Slot], choices: Choices, chair_label: str) -> list[Part]:
    """One checked Part for each slot, in order. Raises ProfileError."""
    return [
        Part(
            component=slot.component.name,
            settings=_checked(slot, slots, choices, chair_label),
            plugin=slot.component.plugin,
        )
        for slot in slots
    ]


def _checked(slot: Slot, slots: Sequence[Slot], choices: Choices, chair_label: str) -> dict[str, Any]:
    """The slot's settings as JSON values."""
    model = slot.component.settings
    result = _validate(slot, _raw(slot, slots, slot.layers))
    asking = [layer for layer in slot.layers if layer.asks]
    if asking:
        given = _validate(slot, _raw(slot, slots, [layer for layer in slot.layers if not layer.asks]))
        offered = choices.get(slot.component.name, {})
        for layer in asking:
            for key in layer.values:
                _allowed(model, key, getattr(given, key), getattr(result, key), offered.get(key), layer)
    for key in choices.get(slot.component.name, {}):
        if key not in model.model_fields:
            raise ProfileError(
                f"{chair_label}: choices.{slot.component.name}.{key} is not a setting of '{slot.component.name}' "
                f"(it has: {', '.join(model.model_fields) or 'none'}): correct or remove it"
            )
    dumped: dict[str, Any] = result.model_dump(mode="json")
    return dumped


def _allowed(model: type[BaseModel], key: str, chair: Any, person: Any, offered: Choice | None, layer: Layer) -> None:
    """Raise ProfileError when a person's value is neither offered by the chair nor on a marked field's safer side."""
    text = f"{layer.where}{key} = {shown(layer.values[key])}"
    if person == chair or offered == "any":
        return
    if isinstance(offered, Interval):
        if isinstance(person, bool) or not isinstance(person, int | float) or not offered.min <= person <= offered.max:
            raise ProfileError(f"{text}, but this chair offers {offered.min:g} to {offered.max:g}")
        return
    if offered is not None:
        if to_jsonable_python(person) not in offered:
            raise ProfileError(f"{text}, but this chair offers only {', '.join(map(str, offered))}")
        return
    mark = mark_of(model, key)
    if looser(mark, chair, person):
        raise ProfileError(f"{text}, {bound(mark, chair)}")


def _validate(slot: Slot, raw: Mapping[str, Any]) -> Settings:
    """The component's settings made from raw values; the error names the layer of the key that is wrong."""
    try:
        return parse(slot.component.settings, raw)
    except WrongError as wrong:
        where = slot.origin(wrong.key.partition(".")[0]) if wrong.key else slot.home
        raise ProfileError(placed(wrong, where)) from None


def _raw(slot: Slot, slots: Sequence[Slot], layers: Sequence[Layer]) -> dict[str, Any]:
    """Layers laid over one another, paths absolute, references filled in."""
    result: dict[str, Any] = {}
    for layer in layers:
        for key, value in layer.values.items():
            result[key] = _over(result.get(key), _placed(slot.component.settings, key, value, layer.base))
    filled = {key: _filled(value, slot, slots, f"{slot.origin(key)}{key}", ()) for key, value in result.items()}
    return {key: value for key, value in filled.items() if value is not None}


def _over(weaker: Any, stronger: Any) -> Any:
    """Tables are laid over one another key by key, everything else is replaced."""
    if not isinstance(weaker, Mapping) or not isinstance(stronger, Mapping):
        return stronger
    return {**weaker, **{key: _over(weaker.get(key), value) for key, value in stronger.items()}}


def _placed(model: type[BaseModel], key: str, value: Any, base: Path) -> Any:
    """A relative path made absolute, in fields that are paths."""
    if isinstance(value, list):
        return [_placed(model, key, item, base) for item in value]
    field = model.model_fields.get(key)
    if not isinstance(value, str) or field is None or not _holds_path(field.annotation):
        return value
    if not value or RUN in value or REFERENCE.fullmatch(value) or "\0" in value:
        return value
    return os.path.normpath(base / os.path.expanduser(value))


def _holds_path(annotation: Any) -> bool:
    """Is the field a path, or one of several paths?"""
    if isinstance(annotation, type) and issubclass(annotation, Path):
        return True
    return any(_holds_path(part) for part in get_args(annotation))


def _filled(value: Any, slot: Slot, slots: Sequence[Slot], where: str, seen: tuple[str, ...]) -> Any:
    """The value, or what it refers to; None where the other setting has none (then the default stands)."""
    found = REFERENCE.fullmatch(value) if isinstance(value, str) else None
    if found is None:
        return value
    name, key = found.groups()
    start = f"{where} = {shown(value)}"
    if value in seen:
        raise ProfileError(f"{start}: refers to itself: write the value")
    others = [s for s in slots if s.component.name == name]
    other = next((s for s in others if s.lane == slot.lane), others[0] if others else None)
    if other is None:
        known = ", ".join(sorted({s.component.name for s in slots}))
        raise ProfileError(f"{start}: this chair uses no component '{name}' (it uses: {known})")
    field = other.component.settings.model_fields.get(key)
    if field is None:
        known = ", ".join(other.component.settings.model_fields) or "none"
        raise ProfileError(f"{start}: '{name}' has no setting '{key}' (it has: {known})")
    for layer in reversed(other.layers):
        if key in layer.values:
            placed = _placed(other.component.settings, key, layer.values[key], layer.base)
            return _filled(placed, other, slots, where, (*seen, value))
    default = field.get_default(call_default_factory=True, validated_data={})
    if default is PydanticUndefined:
        raise ProfileError(f"{start}: {name}.{key} has no value yet: set it")
    return to_jsonable_python(default)

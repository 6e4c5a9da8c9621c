"""What is refused whatever the limits say: words that could mean motion for stop, no stop device, and on a chair that
somebody sits in, everything simulated."""

from __future__ import annotations

import unicodedata
from collections.abc import Iterator, Mapping, Sequence
from typing import Any

from chairward.components import DriveSettings
from chairward.messages import Command, Intent, Way
from chairward.plan import ChairKind, Part
from chairward.profile.errors import ProfileError, shown
from chairward.profile.lanes import Lane
from chairward.profile.models import Chair, LimitsTable, Person, StoppingTable
from chairward.profile.settings import RUN, Slot

FILE_KINDS = frozenset({"manifest", "folder", "file", "files", "wav", "images"})
"""Values of a source's `kind` setting that mean recorded input."""


def same_word(word: str) -> str:
    """What two spellings of one word have in common: case, width, accents' encoding and spaces do not count."""
    return " ".join(unicodedata.normalize("NFKC", word).casefold().split())


def words(person: Person, person_label: str, chair: Chair, limits: LimitsTable, *, listens: bool) -> None:
    """Refuse words that are dangerous or useless. listens: the chair has a recognizer of words."""
    seen: dict[str, str] = {}
    reserved = {same_word(word) for word in chair.stop_words}
    for word, command in person.words.items():
        key = f"{person_label}: words.{shown(word)} = '{command}'"
        plain = same_word(word)
        if plain in seen:
            raise ProfileError(f"{key}: this word is there already as {shown(seen[plain])}: keep one of them")
        seen[plain] = word
        if plain in reserved and command not in (Command.STOP, Command.HELP):
            raise ProfileError(f"{key}: a stop word must never mean motion: map it to 'stop' or remove it")
        if command not in limits.commands:
            allowed = ", ".join(sorted(limits.commands))
            raise ProfileError(f"{key}: limits.commands allows only {allowed}: remove the word or allow the command")
    if listens and Command.STOP not in person.words.values():
        raise ProfileError(f"{person_label}: words has no word for 'stop': add one, for example stop = \"stop\"")


def leaves(table: Mapping[str, Any], path: str = "") -> Iterator[tuple[str, Any]]:
    """Every value in nested tables and lists, with its dotted key."""
    for key, value in table.items():
        for item in value if isinstance(value, list) else [value]:
            if isinstance(item, Mapping):
                yield from leaves(item, f"{path}{key}.")
            else:
                yield f"{path}{key}", item


def stop_device(chair_label: str, lanes: Sequence[Lane]) -> None:
    """Refuse words (which stay in force when nobody says anything) without a second, live means of stopping."""
    gives_words = any(
        kind == "recognizer" or Intent in component.gives for lane in lanes for kind, component in lane.components
    )
    if gives_words and not any(lane.table.stop_device for lane in lanes):
        raise ProfileError(
            f"{chair_label}: no lane has stop_device = true, and a chair is not driven by voice alone: "
            "add a lane with a key, switch or panel as its stop device"
        )


def drive(slot: Slot, part: Part, limits: LimitsTable, stopping: StoppingTable) -> None:
    """Refuse a drive that cannot do what the chair's limits ask of it, or brakes less than the proof assumes.

    Read from settings by these names, where a drive has them; 0 says that the controller decides by itself.
    """
    least = {
        "full_speed_mm_s": ("limits.forward_mm_s", limits.forward_mm_s),
        "full_forward_mm_s": ("limits.forward_mm_s", limits.forward_mm_s),
        "full_backward_mm_s": ("limits.backward_mm_s", limits.backward_mm_s),
        "full_turn_deg_s": ("limits.turn_deg_s", limits.turn_deg_s),
        "decel_mm_s2": ("stopping.decel_mm_s2", stopping.decel_mm_s2),
        "stop_decel_mm_s2": ("stopping.decel_mm_s2", stopping.decel_mm_s2),
    }
    for key, (name, bound) in least.items():
        value = part.settings.get(key)
        if isinstance(value, int | float) and 0 < value < bound:
            raise ProfileError(
                f"{slot.origin(key)}{key} = {value:g}: less than {name} = {bound}: lower {name} or correct the drive"
            )


def silence(slot: Slot, part: Part, chair: Chair) -> str:
    """Why this drive may not drive yet: nobody has measured that it stops on silence, and no relay does it; "" when it
    may. Where nothing real is behind it (a simulator, files) there is nothing to measure.

    Raises ProfileError where it stops later than the proof of distances assumes.
    """
    if chair.kind in (ChairKind.SIMULATOR, ChairKind.FILES):
        return ""
    place = slot.home.rstrip(".")
    if not issubclass(slot.component.settings, DriveSettings):
        raise ProfileError(
            f"{place}: this drive cannot tell that it stops on silence: its plugin's settings must be a "
            "chairward.components.DriveSettings"
        )
    settings = slot.component.settings.model_validate(part.settings)
    if unproved := settings.silence_unproved():
        return f"{place}: {unproved}".replace("check drive'", f"check drive --chair {chair.name}'")
    measured, stopping = settings.silence_stop_ms or 0, chair.stopping
    if measured > stopping.watchdog_ms + stopping.wire_ms:
        raise ProfileError(
            f"{slot.origin('silence_stop_ms')}silence_stop_ms = {measured}: more than stopping.watchdog_ms + wire_ms = "
            f"{stopping.watchdog_ms + stopping.wire_ms}, which the proof of distances rests on: raise "
            f"stopping.watchdog_ms to {measured - stopping.wire_ms}"
        )
    return ""


def covers_ahead(chair_label: str, lanes: Sequence[Lane]) -> None:
    """Refuse a chair that could never go forward because nothing looks there."""
    if not any(Way.AHEAD in lane.table.covers for lane in lanes):
        raise ProfileError(f"{chair_label}: no lane with a distance sensor covers 'ahead': add one, nothing could move")


def ridden(chair: Chair, label: str, lanes: Sequence[Lane], slots: Sequence[Slot], parts: Sequence[Part]) -> None:
    """On kind = "chair" refuse thesis methods, simulated and recorded input, companions, no hardware stop, and settings
    that their component calls unfit."""
    if chair.kind is not ChairKind.CHAIR:
        return
    on = 'a chair somebody sits in (kind = "chair")'
    if not chair.hardware_stop.strip():
        raise ProfileError(
            f"{label}: hardware_stop is missing: name the stop of this chair that needs no software "
            '(for example "red switch on the left armrest, opens the contactor")'
        )
    for name, companion in chair.companion.items():
        raise ProfileError(
            f"{label}: companion.{name}.component = '{companion.component}': a companion stands in for the real world "
            f"and is refused on {on}: remove it"
        )
    for lane in lanes:
        name = lane.name
        if lane.source.name.startswith("sim_"):
            raise ProfileError(f"{label}: lane.{name}.source = '{lane.source.name}': is simulated, refused on {on}")
        if lane.table.ends_run:
            raise ProfileError(f"{label}: lane.{name}.ends_run = true: is for recorded input, refused on {on}")
    sources = {lane.source.name for lane in lanes}
    for slot, part in zip(slots, parts, strict=True):
        settings = slot.component.settings.model_validate(part.settings)
        if unfit := settings.unfit_to_ride():
            key, why = unfit
            text = f"{slot.origin(key)}{key} = {shown(getattr(settings, key))}"
            raise ProfileError(f"{text}: {why}; refused on {on}")
        for key, value in leaves(part.settings):
            text = f"{slot.origin(key.partition('.')[0])}{key} = {shown(value)}"
            if isinstance(value, str) and value.startswith("thesis"):
                raise ProfileError(f"{text}: thesis methods miss obstacles and are refused on {on}: choose another")
            if isinstance(value, str) and RUN in value:
                raise ProfileError(f"{text}: a device in the run's folder is simulated, refused on {on}")
            if part.component in sources and key == "kind" and value in FILE_KINDS:
                raise ProfileError(f"{text}: recorded input is refused on {on}: use a live device")

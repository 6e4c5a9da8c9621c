"""New profile files with every choice explained, and JSON schemas for editors; both made from the models alone."""

from __future__ import annotations

from typing import Any

from pydantic_core import to_jsonable_python

from chairward.messages import Command
from chairward.plugins import Registry
from chairward.profile.merge import Safer, mark_of
from chairward.profile.models import Chair, LimitsTable, Person, StoppingTable
from chairward.profile.settings import REFERENCE

PERSON = """\
# {name}: what this person decides, inside what the chair allows.
# Check it with: chairward profile check {name}
name = "{name}"
chair = ["{chair}"]                  # the chairs this was set up for
{drive}language = "en"

[words]                             # what is said = what it means; add your own
{words}
[limits]                            # take the # away to set one; only towards the safer side
{limits}
# [settings.voice_dtw]              # settings of plugins, as far as the chair file offers the choice
"""

CHAIR = """\
# {name}: what the integrator decides. Check it with: chairward profile check {name}
name = "{name}"
kind = "robot"                      # simulator, files, robot (nobody sits on it) or chair
# hardware_stop = "..."             # the stop that needs no software: a chair must have one
# person = "..."                    # who drives when nobody is named

[footprint]                         # measure: from the middle of the drive axle, feet and turning parts included
front_mm = 500
rear_mm = 500
half_width_mm = 320

[limits]                            # the bounds; a person may only move them towards the safer side
{limits}
[stopping]                          # measured facts, the proof of distances rests on them
{stopping}
[lane.front]                        # a source, then its stages in order
source = "cameras"
stages = ["stereo_range", "vision_obstacle"]
freshness_ms = 200                  # a report may be this old
covers = ["ahead"]                  # the ways this lane watches
pose = {{ x_mm = 450, z_mm = 400, pitch_deg = 0 }}

[lane.voice]
source = "microphone"
stages = ["voice_dtw"]
freshness_ms = 400

[lane.keys]                         # nobody drives by voice alone: a key or switch that stops
source = "keys"
stop_device = true
may = ["stop", "arm", "reset"]
freshness_ms = 400

[drive.pic_serial]                  # the drives offered; a person picks one; measure: chairward check drive
port = "/dev/ttyUSB0"

# [settings.stereo_range]           # settings of plugins by name: see chairward profile schema chair
# [choices.voice_dtw]               # settings that a person may choose: a list, {{ min = 1, max = 2 }} or "any"
"""


REFERENCE_SCHEMA = {"type": "string", "pattern": REFERENCE.pattern, "description": "the value of another setting"}


def _lines(model: type[LimitsTable | StoppingTable], values: LimitsTable | StoppingTable, *, marked: bool) -> str:
    """One commented line a field: key = value, which way it may move, what it is."""
    lines = []
    for key, field in model.model_fields.items():
        mark = mark_of(model, key)
        if marked and mark is None:
            continue
        value = to_jsonable_python(getattr(values, key))
        if value in (None, ""):
            continue
        shown = "[" + ", ".join(f'"{v}"' for v in sorted(value)) + "]" if isinstance(value, list) else value
        moves = f" ({mark.value} this)" if marked and mark in (Safer.HIGHER, Safer.LOWER, Safer.SUBSET) else ""
        lines.append(f"# {key} = {shown}".ljust(34) + f"  # {field.description}{moves}\n")
    return "".join(lines)


def new_person(name: str, chair: Chair) -> str:
    """A person file for a chair: valid as it stands, with every limit that may be set in a comment."""
    drive = f'drive = "{next(iter(chair.drive))}"'.ljust(36) + f"# offered: {', '.join(chair.drive)}\n"
    usual = chair.limits.commands - {Command.RESET, Command.CONFIRM}
    words = "".join(f'{command} = "{command}"\n' for command in Command if command in usual)
    limits = _lines(LimitsTable, chair.limits, marked=True)
    return PERSON.format(name=name, chair=chair.name, drive=drive, words=words, limits=limits)


def new_chair(name: str) -> str:
    """A chair file to begin with: a robot with two webcams, a microphone, a stop key and the serial drive."""
    return CHAIR.format(
        name=name,
        limits=_lines(LimitsTable, LimitsTable(), marked=False),
        stopping=_lines(StoppingTable, StoppingTable(), marked=False),
    )


def chair_schema(registry: Registry) -> dict[str, Any]:
    """JSON schema of chair files, with the settings of every installed component."""
    schema = Chair.model_json_schema(ref_template="#/$defs/{model}")
    schema["properties"]["settings"]["properties"] = _settings_schemas(schema, registry)
    drives = {name: {"$ref": f"#/$defs/settings-{name}"} for name in registry.components["drive"]}
    schema["properties"]["drive"]["properties"] = drives
    return {"$schema": "https://json-schema.org/draft/2020-12/schema", **schema}


def person_schema(registry: Registry) -> dict[str, Any]:
    """JSON schema of person files: only the limits that a person may set, none of them required."""
    schema = Person.model_json_schema()
    limits = LimitsTable.model_json_schema()
    schema.setdefault("$defs", {}).update(limits.get("$defs", {}))
    marked = {key: limits["properties"][key] for key in LimitsTable.model_fields if mark_of(LimitsTable, key)}
    schema["properties"]["limits"] = {"type": "object", "properties": marked, "additionalProperties": False}
    schema["properties"]["settings"]["properties"] = _settings_schemas(schema, registry)
    return {"$schema": "https://json-schema.org/draft/2020-12/schema", **schema}


def _settings_schemas(schema: dict[str, Any], registry: Registry) -> dict[str, Any]:
    """Put every component's settings among the definitions; nothing is required, a person file may add it."""
    references = {}
    for components in registry.components.values():
        for name, component in components.items():
            own = component.settings.model_json_schema(ref_template=f"#/$defs/{name}-{{model}}")
            for key, definition in own.pop("$defs", {}).items():
                schema.setdefault("$defs", {})[f"{name}-{key}"] = definition
            own.pop("required", None)
            own["properties"] = {k: {"anyOf": [v, REFERENCE_SCHEMA]} for k, v in own.get("properties", {}).items()}
            schema["$defs"][f"settings-{name}"] = own
            references[name] = {"$ref": f"#/$defs/settings-{name}"}
    return references

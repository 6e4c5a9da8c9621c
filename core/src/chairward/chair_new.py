"""A new chair file by interview: few questions, each device tried before anything is saved, every choice explained.

The file is the commented one of `chairward profile new chair`, with the answers put in; so what was not asked stands in
it too, with its default and what it means.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Container, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Protocol

import tomlkit

from chairward.doctor import Finding
from chairward.doctor.examine import look_at
from chairward.plan import ChairKind
from chairward.plugins import Registry
from chairward.profile import ProfileError, files, write
from chairward.profile.load import load_chair

Value = str | int | float | bool
ASKED = ("profile", "cameras", "microphone", "controller", "bus", "bus traffic")
"""Checks of what the interview asks for."""
COMMENT_COLUMN = 36
"""Where the comments of a new chair file begin."""


@dataclass(frozen=True, slots=True)
class Question:
    """One thing that is asked. key: its name in an answers file. choices: the only answers, where there are such.

    only: asked only where this is true of the answers so far.
    """

    key: str
    text: str
    default: Value
    choices: tuple[str, ...] = ()
    only: Callable[[Mapping[str, Value]], bool] = lambda _: True


@dataclass(frozen=True, slots=True)
class Group:
    """Questions that belong together; then the doctor looks at these places of the chair."""

    title: str
    questions: tuple[Question, ...]
    places: tuple[str, ...] = ()


class Person(Protocol):
    """Who answers."""

    def answer(self, question: Question) -> Value:
        """The answer."""

    def again(self, group: Group, wrong: Sequence[Finding]) -> bool:
        """Something of this group does not work: ask the group again (True), or keep it as it is (False)."""

    def tell(self, text: str) -> None:
        """A line to read."""


def _has_voice(answers: Mapping[str, Value]) -> bool:
    return answers.get("voice") == "yes"


def _is_chair(answers: Mapping[str, Value]) -> bool:
    return answers.get("kind") == ChairKind.CHAIR


def _uses(drive: str) -> Callable[[Mapping[str, Value]], bool]:
    return lambda answers: answers.get("drive") == drive


def _speaks_dbc(answers: Mapping[str, Value]) -> bool:
    return _uses("can")(answers) and answers.get("can.dialect") == "dbc"


def groups(devices: Path = Path("/dev")) -> list[Group]:
    """The interview. devices: where cameras, inputs and serial ports are listed."""
    cameras = _names(devices / "v4l/by-id", "*index0") or ["0", "2"]
    return [
        Group(
            "The chair",
            (
                Question("kind", "What is it? robot: nobody sits on it", "robot", ("robot", "chair")),
                Question("footprint.front_mm", "From the drive axle to the tips of the feet, mm", 500),
                Question("footprint.rear_mm", "From the drive axle to the rearmost part, mm", 500),
                Question("footprint.half_width_mm", "From the middle to the outermost part, mm", 320),
                Question(
                    "hardware_stop", "Which stop does this chair have that needs no software?", "", only=_is_chair
                ),
            ),
        ),
        Group(
            "The two cameras",
            (
                Question("cameras.left", f"Left camera (there: {', '.join(cameras)})", cameras[0]),
                Question("cameras.right", "Right camera", cameras[-1]),
                Question("pose.x_mm", "How far before the axle are they, mm", 450),
                Question("pose.z_mm", "How high above the floor, mm", 400),
                Question("pose.pitch_deg", "How many degrees do they look down", 0),
            ),
            ("front",),
        ),
        Group(
            "Voice",
            (
                Question("voice", "Is it driven by words?", "yes", ("yes", "no")),
                Question("microphone.device", "Microphone: part of its name; empty: the default", "", only=_has_voice),
            ),
            ("voice",),
        ),
        Group(
            "The stop device: a key or switch in the person's reach",
            (Question("keys.device", "Its device (terminal, or a path below /dev/input/by-id)", "terminal"),),
            ("machine",),
        ),
        Group(
            "The drive",
            (
                Question("drive", "What drives the wheels?", "pic_serial", ("pic_serial", "can")),
                Question(
                    "pic_serial.port",
                    "Serial port",
                    (_names(devices / "serial/by-id", "*") or ["/dev/ttyUSB0"])[0],
                    only=_uses("pic_serial"),
                ),
                Question("can.dialect", "CAN dialect", "rnet", ("rnet", "cia402", "dbc"), only=_uses("can")),
                Question("can.dbc.file", "The controller's DBC file", "controller.dbc", only=_speaks_dbc),
                Question(
                    "can.dbc.forward", "Its signal for forward, Message.Signal", "Drive.Forward", only=_speaks_dbc
                ),
                Question("can.dbc.turn", "Its signal for turning left, Message.Signal", "Drive.Turn", only=_speaks_dbc),
                Question("can.channel", "CAN interface", "can0", only=_uses("can")),
                Question("forward_mm_s", "Highest forward speed, mm/s", 300),
                Question("decel_mm_s2", "Deceleration when it stops, measured, mm/s2", 600),
                Question("slope_percent", "Steepest slope it may go down, percent", 0),
            ),
            ("drive",),
        ),
    ]


def _names(folder: Path, pattern: str) -> list[str]:
    return [str(path) for path in sorted(folder.glob(pattern))] if folder.is_dir() else []


def interview(name: str, person: Person, registry: Registry, folder: Path, asked: Sequence[Group]) -> str:
    """Ask, try, and give the text of the chair file. folder: where it is tried meanwhile.

    Raises ProfileError where the answers together make no chair that can be proven to stop.
    """
    answers: dict[str, Value] = {}
    for group in asked:
        person.tell(group.title)
        while True:
            for question in group.questions:
                if question.only(answers):
                    answers[question.key] = person.answer(question)
            wrong = [f for f in tried(name, answers, registry, folder, group.places) if not f.ok and f.needed]
            for finding in wrong:
                person.tell(f"  {finding.check}: {finding.what}\n    {finding.fix}")
            if not wrong or not person.again(group, wrong):
                break
            for question in group.questions:
                answers.pop(question.key, None)
    text = chair_text(name, answers)
    _load(name, text, str(answers["drive"]), registry, folder)
    return text


def tried(
    name: str, answers: Mapping[str, Value], registry: Registry, folder: Path, places: Sequence[str]
) -> list[Finding]:
    """What the doctor finds at these places of the chair as far as it is known."""
    if not places:
        return []
    drive = str(answers.get("drive", "pic_serial"))
    try:
        plan = _load(name, chair_text(name, answers), drive, registry, folder)
    except ProfileError as error:
        return [Finding("profile", False, str(error), "answer that differently")]
    return [found for found in look_at(registry, plan, places) if _matters(found)]


def _matters(found: Finding) -> bool:
    """The calibration comes later; and of all device paths only the stop device's is asked for here."""
    return found.what.startswith("keys.") if found.check == "devices" else found.check in ASKED


def _load(name: str, text: str, drive: str, registry: Registry, folder: Path) -> Any:
    """The plan of a chair file that is not saved yet. Raises ProfileError."""
    path = folder / "chairs" / f"{name}.toml"
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(text, encoding="utf-8")
    return load_chair(files.read(path), drive, registry).plan


def chair_text(name: str, answers: Mapping[str, Value]) -> str:
    """The commented chair file with these answers, each in the place that the file has for it."""
    put: dict[tuple[str, str], Value] = {
        (table, key): answers[asked]
        for table, key, asked in (
            ("", "kind", "kind"),
            ("", "hardware_stop", "hardware_stop"),
            *(("footprint", key, f"footprint.{key}") for key in ("front_mm", "rear_mm", "half_width_mm")),
            *(("limits", key, "forward_mm_s") for key in ("forward_mm_s", "arc_mm_s")),
            *(("stopping", key, key) for key in ("decel_mm_s2", "slope_percent")),
        )
        if answers.get(asked, "") != ""
    }
    file: Any = tomlkit.parse(_uncommented(write.new_chair(name), put))
    for (table, key), value in put.items():
        _put(file[table] if table else file, key, value)
    for key in ("x_mm", "z_mm", "pitch_deg"):
        _put(file["lane"]["front"]["pose"], key, answers.get(f"pose.{key}"))
    if answers.get("voice") == "no":
        del file["lane"]["voice"]
    _drive(file, answers)
    settings = tomlkit.table(is_super_table=True)
    cameras = tomlkit.table()
    for side in ("left", "right"):
        _put(cameras, side, _device(answers.get(f"cameras.{side}")))
    _put(settings, "cameras", cameras)
    for component in ("microphone", "keys"):
        if answers.get(f"{component}.device"):
            device = tomlkit.table()
            device.add("device", answers[f"{component}.device"])
            settings.add(component, device)
    file.add("settings", settings)
    return tomlkit.dumps(file)


def _uncommented(text: str, keys: Container[tuple[str, str]]) -> str:
    """The text with the lines "# key = ..." of these (table, key) taken out of their comments."""
    table, lines = "", []
    for line in text.splitlines(keepends=True):
        if found := re.match(r"\[([^]]*)\]", line):
            table = found[1]
        found = re.match(r"# (\w+) = ", line)
        lines.append(line[2:] if found and (table, found[1]) in keys else line)
    return "".join(lines)


def _drive(file: Any, answers: Mapping[str, Value]) -> None:
    """The one drive that was chosen."""
    drive = str(answers.get("drive", "pic_serial"))
    if drive not in file["drive"]:
        file["drive"].clear()
        file["drive"].add(drive, tomlkit.table())
    for key in ("port", "dialect", "channel"):
        _put(file["drive"][drive], key, answers.get(f"{drive}.{key}"))
    if _speaks_dbc(answers):
        table = tomlkit.table()
        for key in ("file", "forward", "turn"):
            _put(table, key, answers.get(f"can.dbc.{key}"))
        file["drive"][drive].add("dbc", table)
    forward = answers.get("forward_mm_s")
    if drive == "can" and isinstance(forward, int | float):
        file["drive"][drive].add("full_forward_mm_s", max(float(forward), 500.0))


def _device(answer: Value | None) -> Value | None:
    """A camera's number, or its name."""
    return int(answer) if isinstance(answer, str) and answer.isdigit() else answer


def _put(table: Any, key: str, value: Any) -> None:
    """Set a key, its comment kept; nothing was answered: leave it."""
    if value is None:
        return
    old = table.get(key) if key in table else None
    item = tomlkit.item(value)
    if old is not None and getattr(old, "trivia", None) is not None and old.trivia.comment:
        item.comment(old.trivia.comment.lstrip("# "))
        item.trivia.comment_ws = " " * max(1, COMMENT_COLUMN - len(f"{key} = {item.as_string()}"))
    table[key] = item

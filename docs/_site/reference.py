"""Reference pages, made from the models, messages, hooks, commands and benchmark results themselves."""

from __future__ import annotations

import inspect
import json
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import msgspec
import typer.main

from chairward import hookspecs, messages
from chairward.cli import app as cli
from chairward.components import Settings
from chairward.plugins import KINDS, Registry, discover


def commands() -> str:
    """Every command and sub-command with its options."""
    cli.add_plugin_commands(discover())
    root = typer.main.get_command(cli.app)
    lines = ["# Commands", "", "`./run chairward COMMAND --help` prints the same.", ""]
    for path, command in walk(root, ("chairward",)):
        if subcommands(command) and not [p for p in command.params if "--help" not in p.opts]:
            continue
        lines += [f"## `{' '.join(path)}`", "", first_line(command.help), ""]
        rows = [row for parameter in command.params if (row := option_row(parameter))]
        if rows:
            lines += ["| option | what it does | default |", "| --- | --- | --- |", *rows, ""]
    return "\n".join(lines)


def walk(command: Any, path: tuple[str, ...]) -> Iterator[tuple[tuple[str, ...], Any]]:
    """The command and all below it."""
    yield path, command
    for name, below in sorted(subcommands(command).items()):
        yield from walk(below, (*path, name))


def subcommands(command: Any) -> dict[str, Any]:
    """Of a group; empty for a command."""
    return dict(getattr(command, "commands", {}))


def option_row(parameter: Any) -> str:
    """One row of a table; empty for --help."""
    if "--help" in parameter.opts:
        return ""
    named = parameter.param_type_name == "option"
    name = ", ".join([*parameter.opts, *parameter.secondary_opts]) if named else str(parameter.name).upper()
    default = "" if parameter.default in (None, False, ()) or callable(parameter.default) else f"`{parameter.default}`"
    return f"| `{name}` | {cell(getattr(parameter, 'help', '') or '')} | {default} |"


def settings() -> str:
    """The settings of every component."""
    registry = discover()
    lines = ["# Settings", "", "What `[settings.COMPONENT]` in a chair file may say. Types and ranges are checked.", ""]
    for kind in KINDS:
        for name, component in sorted(registry.components[kind].items()):
            lines += [f"## {kind} `{name}`", "", f"{component.summary} (plugin `{component.plugin}`)", ""]
            lines += settings_table(component.settings)
    return "\n".join(lines)


def settings_table(model: type[Settings]) -> list[str]:
    """One row a field."""
    properties = model.model_json_schema().get("properties", {})
    if not properties:
        return ["Nothing to set.", ""]
    rows = [
        f"| `{name}` | {cell(said.get('description', ''))} | {bounds(said)} | {default_of(said)} |"
        for name, said in properties.items()
    ]
    return ["| setting | what it is | allowed | default |", "| --- | --- | --- | --- |", *rows, ""]


def bounds(said: dict[str, Any]) -> str:
    """The range or choices of a field."""
    parts = [said, *said.get("anyOf", [])]
    choices = [value for part in parts for value in part.get("enum", [])]
    if choices:
        return ", ".join(f"`{value}`" for value in choices)
    signs = {"minimum": ">=", "exclusiveMinimum": ">", "maximum": "<=", "exclusiveMaximum": "<"}
    return " ".join(f"{sign} {part[key]}" for part in parts for key, sign in signs.items() if key in part)


def default_of(said: dict[str, Any]) -> str:
    """The default, as it would be written."""
    return f"`{cell(json.dumps(said['default'], ensure_ascii=False))}`" if "default" in said else "must be given"


def message_page() -> str:
    """Every message with its fields."""
    lines = ["# Messages", "", cell((messages.__doc__ or "").strip()), ""]
    structs = [thing for thing in vars(messages).values() if is_message(thing)]
    for struct in structs:
        lines += [f"## {struct.__name__}", "", "```text", inspect.getdoc(struct) or "", "```", ""]
        lines += ["| field | type | default |", "| --- | --- | --- |"]
        for field in msgspec.structs.fields(struct):
            default = "" if field.default is msgspec.NODEFAULT else f"`{field.default!r}`"
            kind = str(getattr(field.type, "__name__", field.type)).replace("msgspec.", "")
            lines.append(f"| `{field.name}` | `{cell(kind)}` | {cell(default)} |")
        lines.append("")
    return "\n".join(lines)


def is_message(thing: object) -> bool:
    """A struct of chairward.messages itself."""
    return isinstance(thing, type) and issubclass(thing, msgspec.Struct) and thing.__module__ == messages.__name__


def hooks() -> str:
    """The hooks, then the interfaces behind them."""
    lines = ["# Hooks and interfaces", "", cell((hookspecs.__doc__ or "").strip()), ""]
    lines += ["| hook | what it returns |", "| --- | --- |"]
    for name, function in vars(hookspecs).items():
        if name.startswith("chairward_"):
            lines.append(f"| `{name}` | {first_line(function.__doc__)} |")
    return "\n".join([*lines, "", "::: chairward.components", "", "::: chairward.stages", ""])


def contracts() -> str:
    """The contract classes and each promise in them."""
    from chairward import testing

    lines = ["# Contracts", "", "`chairward.testing`: what the tests of a plugin inherit. Each line is a promise.", ""]
    for name in testing.__all__:
        cls = getattr(testing, name)
        if not name.endswith("Contract"):
            continue
        tests = [test for test in dir(cls) if test.startswith("test_")]
        lines += [f"## {name}", "", f"{first_line(cls.__doc__)} {len(tests)} tests.", ""]
        lines += [*(f"* {test.removeprefix('test_').replace('_', ' ')}" for test in tests), ""]
    return "\n".join(lines)


def performance(results: Path) -> str:
    """A table for each file of benchmarks/results: written by the benchmark of that name, never by hand."""
    lines = ["# Performance", "", "Made from `benchmarks/results/*.json`, as the benchmarks wrote them.", ""]
    for path in sorted(results.glob("*.json")):
        data = json.loads(path.read_text(encoding="utf-8"))
        lines += [f"## {path.stem}", "", cell(str(data.get("what", ""))), "", "| figure | value |", "| --- | --- |"]
        rows = [f"| {name} | {value} |" for name, value in flat(data) if name != "what"]
        lines += [*rows[:80], *([f"| ... | {len(rows) - 80} more in the file |"] if len(rows) > 80 else []), ""]
    return "\n".join(lines)


def flat(data: Any, path: str = "") -> Iterator[tuple[str, str]]:
    """(name, value) of every figure; long lists of raw values are left in the file."""
    if isinstance(data, dict):
        for key, value in data.items():
            if key != "raw":
                yield from flat(value, f"{path} {key}".strip())
    elif isinstance(data, list):
        if len(data) <= 12:
            for number, value in enumerate(data, start=1):
                yield from flat(value, f"{path} {number}".strip())
    else:
        yield cell(path), cell(str(data))


def first_line(text: str | None) -> str:
    """The first paragraph, on one line."""
    return cell(inspect.cleandoc(text or "").split("\n\n")[0])


def cell(text: str) -> str:
    """Text that keeps a Markdown table whole."""
    return " ".join(text.replace("|", "\\|").split())


def every_name(registry: Registry) -> Iterator[tuple[str, str, str]]:
    """What must be found in the reference, as (page, section, name): hooks, settings, message fields, commands."""
    for name in vars(hookspecs):
        if name.startswith("chairward_"):
            yield "hooks", "", name
    for kind in KINDS:
        for component in registry.components[kind].values():
            for name in component.settings.model_fields:
                yield "settings", f"{kind} {component.name}", name
    for struct in [thing for thing in vars(messages).values() if is_message(thing)]:
        for field in msgspec.structs.fields(struct):
            yield "messages", struct.__name__, field.name
    for path, command in walk(typer.main.get_command(cli.app), ("chairward",)):
        if not subcommands(command):
            yield "commands", " ".join(path), " ".join(path)

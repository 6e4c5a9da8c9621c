"""`chairward profile check|show|new|schema`: look at, check and begin chair and person files."""

from __future__ import annotations

import json
import sys
from collections.abc import Iterator
from enum import StrEnum
from pathlib import Path
from typing import Annotated, Any

import msgspec
import typer
from rich.console import Console
from rich.table import Table

from chairward import profile
from chairward.plugins import Registry, discover
from chairward.profile import ProfileError, files, write
from chairward.profile.files import ProfileFile
from chairward.profile.load import Loaded, check_chair, read_chair, read_person

app = typer.Typer(name="profile", no_args_is_help=True, help="Chair files (integrator) and person files (person).")

WIDE = 250
"""Columns of `show` where nobody looks at a terminal: every row on one line."""
Folder = Annotated[Path | None, typer.Option("--profiles", help="folder with chairs/ and people/")]
Sets = Annotated[list[str] | None, typer.Option("--set", help="component.key=value, validated like the files")]


class What(StrEnum):
    """The two kinds of profile."""

    CHAIR = "chair"
    PERSON = "person"


@app.command()
def check(
    names: Annotated[list[str] | None, typer.Argument(help="names or paths of chair and person files")] = None,
    every: Annotated[bool, typer.Option("--all", help="all profiles there are")] = False,
    profiles: Folder = None,
) -> None:
    """Load and prove profiles: one line for each file; exit code 1 when one is wrong."""
    folder = files.directory(profiles)
    if not names and not every:
        typer.echo("chairward: name the profiles to check, or say --all", err=True)
        raise typer.Exit(2)
    if every:
        names = [str(path) for kind in ("chairs", "people") for path in sorted((folder / kind).glob("*.toml"))]
        if not names:
            typer.echo(f"chairward: there are no profiles in {folder}", err=True)
            raise typer.Exit(1)
    registry = discover()
    wrong = 0
    for name in names or []:
        try:
            for line in _checked(name, folder, registry):
                typer.echo(line)
        except ProfileError as error:
            wrong += 1
            typer.echo(f"WRONG  {error}")
    raise typer.Exit(1 if wrong else 0)


def _checked(name: str, folder: Path, registry: Registry) -> Iterator[str]:
    """A line for each file of that name that is right. Raises ProfileError for the first that is wrong."""
    for file in _files(name, folder):
        if _is_chair(file):
            loaded = check_chair(file, registry)
            if file.values.get("person") is not None:
                profile.load_traced(file.path, None, [], registry, folder)
            yield f"ok     {file.label}: {loaded.proof}{_not_yet(loaded)}"
            continue
        proofs = [
            f"{chair}: {profile.load_traced(chair, file.path, [], registry, folder).proof}"
            for chair in read_person(file).chairs
        ]
        yield f"ok     {file.label}: {'; '.join(proofs)}"


def _not_yet(loaded: Loaded) -> str:
    """What is right, and still may not drive."""
    return f"; may not drive yet: {loaded.unmeasured}" if loaded.unmeasured else ""


def _files(name: str, folder: Path) -> list[ProfileFile]:
    """The file of a path; of a bare name the chair and the person called so."""
    if name.endswith(".toml") or "/" in name:
        return [files.read(files.find("chairs", name, folder))]
    chairs, people = files.names("chairs", folder), files.names("people", folder)
    if name not in (*chairs, *people):
        raise ProfileError(
            f"there is no profile '{name}' in {folder} (chairs: {', '.join(chairs)}; people: {', '.join(people)}): "
            "correct the name"
        )
    found = [files.find("chairs", name, folder)] if name in chairs else []
    found += [files.find("people", name, folder)] if name in people else []
    return [files.read(path) for path in found]


def _is_chair(file: ProfileFile) -> bool:
    """By its folder, else by what stands in it."""
    if file.path.parent.name in ("chairs", "people"):
        return file.path.parent.name == "chairs"
    return "lane" in file.values or "kind" in file.values


@app.command()
def show(
    chair: str,
    person: Annotated[str | None, typer.Argument(help="default: the chair file's own")] = None,
    sets: Sets = None,
    as_json: Annotated[bool, typer.Option("--json", help="the whole plan as JSON")] = False,
    profiles: Folder = None,
) -> None:
    """What a chair file, a person file and --set come to, and where each value came from."""
    try:
        loaded = profile.load_traced(chair, person, sets or [], discover(), profiles)
    except ProfileError as error:
        typer.echo(f"chairward: {error}", err=True)
        raise typer.Exit(1) from None
    plan = msgspec.to_builtins(loaded.plan, order="deterministic")
    if as_json:
        proof = msgspec.to_builtins(loaded.proof)
        typer.echo(json.dumps({"plan": plan, "proof": proof, "origin": loaded.origin}, indent=1, ensure_ascii=False))
        return
    console = Console(width=None if sys.stdout.isatty() else WIDE, markup=False, highlight=False)
    console.print(f"{plan['chair']} ({plan['kind']}), driven by {plan['person']}: {loaded.proof}")
    table = Table(box=None, pad_edge=False)
    for heading in ("what", "value", "from"):
        table.add_column(heading, overflow="fold")
    for key, value, origin in _rows(plan, loaded.origin):
        table.add_row(key, value, origin)
    console.print(table)


def _rows(plan: dict[str, Any], origin: dict[str, str]) -> Iterator[tuple[str, str, str]]:
    """Key, value and where it came from, of everything a reader may ask about."""
    for word, command in plan["words"].items():
        yield f"words.{word}", str(command), "/".join(Path(plan["person_file"]).parts[-2:])
    for key, value in plan["limits"].items():
        where = origin.get(f"limits.{key}") or origin.get(f"limits.{key.removesuffix('_ns')}_ms", "")
        yield f"limits.{key}", _short(value), where
    parts = {f"drive.{plan['drive']['component']}": plan["drive"]}
    for lane in plan["lanes"]:
        yield f"lane.{lane['name']}", " -> ".join(p["component"] for p in (lane["source"], *lane["stages"])), ""
        parts |= {f"lane.{lane['name']}.{part['component']}": part for part in (lane["source"], *lane["stages"])}
    for kind in ("companion", "observer"):
        parts |= {f"{kind}.{name}": part for name, part in plan[f"{kind}s"].items()}
    for place, part in parts.items():
        for key, value in part["settings"].items():
            yield f"{place}.{key}", _short(value), origin.get(f"{place}.{key}", "")


def _short(value: object) -> str:
    """A value on one line, as JSON writes it."""
    return value if isinstance(value, str) else json.dumps(value, ensure_ascii=False)


@app.command()
def new(
    what: What,
    name: str,
    chair: Annotated[str, typer.Option(help="person: the chair it is for")] = "sim",
    profiles: Folder = None,
) -> None:
    """Write a commented file to begin with; a file that is there already is never touched."""
    folder = files.directory(profiles)
    path = folder / ("chairs" if what is What.CHAIR else "people") / f"{name}.toml"
    try:
        if not files.is_name(name):
            raise ProfileError(f"'{name}' cannot be a profile's name: use small letters, digits, - and _")
        if what is What.CHAIR:
            text = write.new_chair(name)
        else:
            text = write.new_person(name, read_chair(files.read(files.find("chairs", chair, folder))))
        path.parent.mkdir(parents=True, exist_ok=True)
        with path.open("x", encoding="utf-8") as file:
            file.write(text)
    except FileExistsError:
        typer.echo(f"chairward: {path} is there already and was not touched: choose another name", err=True)
        raise typer.Exit(1) from None
    except (OSError, ProfileError) as error:
        typer.echo(f"chairward: {error}", err=True)
        raise typer.Exit(1) from None
    typer.echo(f"{path}: written; edit it, then run: chairward profile check {name}")


@app.command()
def schema(what: What) -> None:
    """The JSON schema of chair or person files, for editors that complete and check TOML."""
    make = write.chair_schema if what is What.CHAIR else write.person_schema
    typer.echo(json.dumps(make(discover()), indent=1, ensure_ascii=False))

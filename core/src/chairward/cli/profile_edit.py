"""`chairward profile people|limits|set`: who may drive a chair, what they may set, and setting it, checked first."""

from __future__ import annotations

import json
from typing import Annotated, Any

import typer
from rich.console import Console
from rich.table import Table

from chairward.cli.profile import Folder, app
from chairward.plugins import discover
from chairward.profile import ProfileError, edit, files
from chairward.profile.load import load_files, read_chair, read_person

__all__ = ["app"]

Json = Annotated[bool, typer.Option("--json", help="as JSON")]
SAFER = {"higher": "at least", "lower": "at most", "subset": "only some of", "free": ""}


@app.command()
def people(
    chair: Annotated[str, typer.Argument(help="chairs/NAME.toml or a path")],
    profiles: Folder = None,
    as_json: Json = False,
) -> None:
    """Whose person files name a chair, and whether the chair allows what they say."""
    folder, registry, rows = files.directory(profiles), discover(), []
    try:
        chair_file = files.read(files.find("chairs", chair, folder))
        name = read_chair(chair_file).name
        for who in files.names("people", folder):
            row: dict[str, Any] = {"name": who, "about": "", "language": "", "words": {}, "why": ""}
            try:
                file = files.read(files.find("people", who, folder))
                person = read_person(file)
                if name not in person.chairs:
                    continue
                row |= {"about": person.about, "language": person.language, "words": dict(person.words)}
                row["proof"] = str(load_files(chair_file, file, registry).proof)
            except ProfileError as error:
                row["why"] = str(error)
            rows.append(row)
    except ProfileError as error:
        raise _failed(error) from None
    if as_json:
        typer.echo(json.dumps({"chair": name, "people": rows}, ensure_ascii=False, indent=1))
        return
    for row in rows:
        typer.echo(f"{row['name']}: {row['why'] or row['proof']}")


@app.command()
def limits(
    chair: Annotated[str, typer.Argument(help="chairs/NAME.toml or a path")],
    person: Annotated[str, typer.Argument(help="people/NAME.toml or a path")],
    profiles: Folder = None,
    as_json: Json = False,
) -> None:
    """What a person may set on a chair, and within which bounds."""
    folder, registry = files.directory(profiles), discover()
    try:
        chair_file = files.read(files.find("chairs", chair, folder))
        person_file = files.read(files.find("people", person, folder))
        rows = list(edit.limit_rows(chair_file, person_file))
        choices = list(edit.choice_rows(chair_file, person_file, registry))
        proof = str(load_files(chair_file, person_file, registry).proof)
    except ProfileError as error:
        raise _failed(error) from None
    if as_json:
        told = {"chair": chair, "person": person, "proof": proof, "limits": rows, "choices": choices}
        typer.echo(json.dumps(told, ensure_ascii=False, indent=1))
        return
    table = Table("limit", "own", "chair allows", "what it is", box=None, pad_edge=False)
    for row in rows:
        own = "" if row["own"] is None else str(row["own"])
        table.add_row(row["key"], own, f"{SAFER[row['safer']]} {row['chair']}".strip(), row["description"])
    for row in choices:
        own = "" if row["own"] is None else str(row["own"])
        what = str(row["schema"].get("description", ""))
        table.add_row(f"settings.{row['component']}.{row['key']}", own, json.dumps(row["choice"]), what)
    Console(markup=False).print(table)


@app.command("set")
def set_(
    person: Annotated[str, typer.Argument(help="people/NAME.toml or a path")],
    values: Annotated[
        list[str],
        typer.Argument(help="limits.stop_mm=700, words.forward=front, language=hi; limits.lease_s= takes out"),
    ],
    try_only: Annotated[bool, typer.Option("--try", help="only say whether it would be allowed")] = False,
    profiles: Folder = None,
    as_json: Json = False,
) -> None:
    """Change a person file, comments kept; nothing is written unless every chair that it names allows it."""
    try:
        found = edit.edit(person, edit.changes(values), discover(), files.directory(profiles), write=not try_only)
    except (ProfileError, OSError) as error:
        if as_json:
            typer.echo(json.dumps({"ok": False, "why": str(error)}, ensure_ascii=False))
            raise typer.Exit(1) from None
        raise _failed(error) from None
    if as_json:
        typer.echo(json.dumps({"ok": True, "proof": found}, ensure_ascii=False))
        return
    for chair, proof in found.items():
        typer.echo(f"ok     {person} on {chair}: {proof}")


def _failed(error: Exception) -> typer.Exit:
    typer.echo(f"chairward: {error}", err=True)
    return typer.Exit(1)

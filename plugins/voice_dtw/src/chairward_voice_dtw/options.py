"""What the commands of `chairward words` have in common: options, folders, and how a refusal is told."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

Person = Annotated[str, typer.Option("--person", help="whose words")]
Folder = Annotated[
    Path | None, typer.Option("--dir", help="folder of the person's recordings (default: the user's data folder)")
]

WordSet = Annotated[
    str,
    typer.Option("--set", help="another set of recordings of the same person: tired, hoarse; empty: the usual voice"),
]

StopWord = Annotated[str, typer.Option("--stop-word", help="the word that means stop")]


def people_dir() -> Path:
    """The folder with one folder for each person: what `chairward.profile` uses too."""
    import platformdirs

    return Path(platformdirs.user_data_dir("chairward")) / "people"


def person_dir(person: str, folder: Path | None) -> Path:
    """Where a person's recordings are kept. Raises StoreError."""
    from chairward_voice_dtw.store import folder_of

    return folder_of(people_dir(), person) if folder is None else folder


def fail(error: Exception) -> typer.Exit:
    """One sentence on stderr, exit code 1."""
    said = str(error)
    if isinstance(error, OSError):
        said = f"{error.filename} cannot be written ({error.strerror}): choose another folder by --dir"
    typer.echo(f"chairward words: {said}", err=True)
    return typer.Exit(1)

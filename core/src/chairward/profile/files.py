"""Finding and reading profile files, and taking `--set` apart."""

from __future__ import annotations

import os
import re
import tomllib
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal

import platformdirs

from chairward.profile.errors import NAME, ProfileError, shown

Kind = Literal["chairs", "people"]
LARGEST_FILE_BYTES = 1_000_000


@dataclass(frozen=True, slots=True)
class ProfileFile:
    """A TOML file that was read: where it is, how errors call it, and its values."""

    path: Path
    label: str
    values: dict[str, Any]


@dataclass(frozen=True, slots=True)
class Override:
    """One `--set table.key=value`; table is "" for a key of the person ("drive", "language").

    key may be dotted ("rnet.takeover"): then it reaches into a table of the component's settings.
    """

    table: str
    key: str
    value: Any

    @property
    def values(self) -> dict[str, Any]:
        """The change as a table."""
        value = self.value
        *outer, first = reversed(self.key.split("."))
        for step in outer:
            value = {step: value}
        return {first: value}

    @property
    def where(self) -> str:
        """How errors call it, up to the key."""
        return f"--set {self.table}." if self.table else "--set "


def directory(given: Path | None = None) -> Path:
    """The folder with chairs/ and people/: given, $CHAIRWARD_PROFILES, found upward from here, or the user's own.

    Where the user has none yet, and this program runs from a checkout, the checkout's.
    """
    if given is not None:
        return given
    if named := os.environ.get("CHAIRWARD_PROFILES"):
        return Path(named)
    here = Path.cwd()
    for folder in (here, *here.parents):
        if (folder / "profiles" / "chairs").is_dir():
            return folder / "profiles"
    own = Path(platformdirs.user_config_path("chairward"))
    checkout = Path(__file__).resolve().parents[4] / "profiles"
    return checkout if not (own / "chairs").is_dir() and (checkout / "chairs").is_dir() else own


def names(kind: Kind, folder: Path) -> list[str]:
    """The profiles of a kind that are there, sorted."""
    return sorted(path.stem for path in (folder / kind).glob("*.toml"))


def is_name(text: str) -> bool:
    """Can a profile be called so?"""
    return re.fullmatch(NAME, text) is not None and len(text) <= 40


def find(kind: Kind, given: str | Path, folder: Path) -> Path:
    """The file of a bare name ("sim") or of a path (with a slash or .toml). Raises ProfileError."""
    text = os.fspath(given)
    if isinstance(given, Path) or text.endswith(".toml") or "/" in text:
        path = Path(text)
        if "\0" in text or not path.is_file():
            raise ProfileError(f"{shown(text)}: there is no such file: check the path")
        return path
    path = folder / kind / f"{text}.toml"
    if not is_name(text) or not path.is_file():
        known = ", ".join(names(kind, folder)) or "none"
        raise ProfileError(f"there is no profile {shown(text)} in {folder / kind} (there: {known}): correct the name")
    return path


def read(path: Path) -> ProfileFile:
    """Read one TOML file. Raises ProfileError with the line of a mistake."""
    path = path.absolute()
    label = f"{path.parent.name}/{path.name}"
    try:
        data = path.read_bytes()
    except OSError as error:
        raise ProfileError(f"{label}: cannot be read: {error.strerror or error}") from None
    if len(data) > LARGEST_FILE_BYTES:
        raise ProfileError(f"{label}: has {len(data)} bytes, a profile has at most {LARGEST_FILE_BYTES}")
    try:
        return ProfileFile(path, label, tomllib.loads(data.decode()))
    except UnicodeDecodeError as error:
        line = data[: error.start].count(b"\n") + 1
        raise ProfileError(f"{label}, line {line}: is not UTF-8 text: save the file as UTF-8") from None
    except RecursionError:
        raise ProfileError(f"{label}: is nested too deeply: simplify it") from None
    except ValueError as error:
        text = " ".join(str(error).split())
        found = re.search(r" ?\((?:at )?line (\d+), column (\d+)\)", text)
        spot = f", line {found[1]}, column {found[2]}" if found else ""
        raise ProfileError(
            f"{label}{spot}: is not valid TOML: {text.replace(found[0], '') if found else text}"
        ) from None


def overrides(sets: Sequence[str]) -> list[Override]:
    """Take `component.key=value` apart; the value is TOML, or a bare string. Raises ProfileError."""
    result = []
    for text in sets:
        name, equals, value = text.partition("=")
        table, dot, key = name.strip().partition(".")
        if not dot:
            table, key = "", table
        if not equals or not key or (not table and key not in ("drive", "language")):
            raise ProfileError(f"--set {shown(text)}: write component.key=value, for example stereo_range.method=sgbm")
        result.append(Override(table, key, toml_value(value.strip())))
    return result


def toml_value(text: str) -> Any:
    """A TOML value; whatever is not one (a path, a word, a date) is a string as it stands."""
    try:
        parsed = tomllib.loads(f"value = {text}")
    except (ValueError, RecursionError):
        return text
    value = parsed.get("value")
    return value if len(parsed) == 1 and isinstance(value, bool | int | float | str | list | dict) else text

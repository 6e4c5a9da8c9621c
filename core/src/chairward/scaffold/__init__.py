"""A new plugin to begin with: four small files that pass their contract tests, or fail with a sentence that teaches."""

from __future__ import annotations

import keyword
import re
from collections.abc import Mapping
from importlib import resources
from pathlib import Path
from string import Template

KINDS = ("sensor", "recognizer", "drive", "source", "observer")


class ScaffoldError(ValueError):
    """One sentence: what is wrong with the name, the kind or the place, and what to do."""


def files(name: str, kind: str) -> Mapping[Path, str]:
    """Path (relative) -> text of the four files of a new plugin. Raises ScaffoldError."""
    if kind not in KINDS:
        raise ScaffoldError(f"kind '{kind}': choose one of {', '.join(KINDS)}")
    if not re.fullmatch(r"[a-z][a-z0-9]*(_[a-z0-9]+)*", name) or keyword.iskeyword(name):
        raise ScaffoldError(f"name '{name}': use small letters, digits and single underscores, such as garden_sonar")
    words = {
        "name": name,
        "dist": f"chairward-{name.replace('_', '-')}",
        "package": f"chairward_{name}",
        "Name": "".join(part.capitalize() for part in name.split("_")),
        "title": name.replace("_", " ").capitalize(),
        "kind": kind,
        "needs": ', "pyserial>=3.5"' if kind in ("sensor", "source", "drive") else "",
    }
    return {
        Path("pyproject.toml"): _filled("pyproject.toml", words),
        Path("README.md"): _filled(f"{kind}.README.md", words),
        Path("src") / words["package"] / "__init__.py": _filled(f"{kind}.py", words),
        Path("tests") / f"test_{name}.py": _filled(f"test_{kind}.py", words),
    }


def write(name: str, kind: str, into: Path) -> Path:
    """Write the files into a new folder of the plugin's name; its path. Raises ScaffoldError."""
    made = files(name, kind)
    folder = into / f"chairward_{name}"
    if folder.exists():
        raise ScaffoldError(f"{folder} exists already: choose another name or place")
    try:
        for path, text in made.items():
            (folder / path).parent.mkdir(parents=True, exist_ok=True)
            (folder / path).write_text(text, encoding="utf-8")
    except OSError as error:
        raise ScaffoldError(f"{folder} cannot be written ({error.strerror}): choose another place by --to") from error
    return folder


def _filled(template: str, words: Mapping[str, str]) -> str:
    text = resources.files(__package__).joinpath("templates", f"{template}.tmpl").read_text(encoding="utf-8")
    return Template(text).substitute(words)

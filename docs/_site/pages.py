"""MkDocs hook: adds the generated reference, the plugins' own READMEs and the project's files as pages.

A link is written as it works in the checkout; here it is turned to where its target stands on the site. What is not on
the site (source files) becomes plain text.
"""

from __future__ import annotations

import os
import re
import sys
from pathlib import Path
from typing import Any

from mkdocs.structure.files import File, Files

ROOT = Path(__file__).resolve().parents[2]
LINK = re.compile(r"(!?)\[([^\]]*)\]\(([^)\s#]+)(#[^)\s]*)?\)")

sys.path.insert(0, str(Path(__file__).parent))
import reference  # noqa: E402 - beside this file; mkdocs loads hooks by path


def sources() -> dict[str, Path]:
    """Page on the site -> the file of the checkout that it shows."""
    pages = {f"plugins/{path.parent.name}.md": path for path in sorted(ROOT.glob("plugins/*/README.md"))}
    pages |= {f"examples/{path.parent.name}.md": path for path in sorted(ROOT.glob("examples/*/README.md"))}
    return {**pages, "contributing.md": ROOT / "CONTRIBUTING.md", "changelog.md": ROOT / "CHANGELOG.md"}


REFERENCE = {
    ROOT / "core/src/chairward/hookspecs.py": "reference/hooks.md",
    ROOT / "core/src/chairward/components.py": "reference/hooks.md",
    ROOT / "core/src/chairward/messages.py": "reference/messages.md",
    ROOT / "core/src/chairward/testing": "reference/contracts.md",
    ROOT / "benchmarks/results": "reference/performance.md",
}
"""What a reference page is made from -> the page: a link to the one leads to the other on the site."""


def on_config(config: Any) -> Any:
    """Fill in the list of plugins."""
    for entry in config["nav"]:
        if "Plugins" in entry:
            entry["Plugins"] = [page for page in sources() if page.startswith(("plugins/", "examples/"))]
    return config


def on_files(files: Files, config: Any) -> Files:
    """Add the pages that are not files of docs/."""
    made = {
        "reference/commands.md": reference.commands(),
        "reference/settings.md": reference.settings(),
        "reference/messages.md": reference.message_page(),
        "reference/hooks.md": reference.hooks(),
        "reference/contracts.md": reference.contracts(),
        "reference/performance.md": reference.performance(ROOT / "benchmarks" / "results"),
    }
    made |= {page: path.read_text(encoding="utf-8") for page, path in sources().items()}
    for page, text in made.items():
        files.append(File.generated(config, page, content=text))
    return files


def on_page_markdown(markdown: str, page: Any, config: Any, files: Files) -> str:
    """Turn links from where they point in the checkout to where their target is on the site."""
    del config
    here = sources().get(page.file.src_uri, ROOT / "docs" / page.file.src_uri)
    targets = REFERENCE | {path: site for site, path in sources().items()}

    def turned(found: re.Match[str]) -> str:
        picture, text, target, anchor = found[1], found[2], found[3], found[4] or ""
        if ":" in target:
            return found[0]
        path = Path(os.path.normpath(here.parent / target))
        site = targets.get(path)
        if site is None and path.is_relative_to(ROOT / "docs"):
            site = path.relative_to(ROOT / "docs").as_posix()
        if site is None or files.get_file_from_path(site) is None:
            if not path.exists():
                raise FileNotFoundError(f"{here}: the link to {target} leads nowhere")
            return text
        there = os.path.relpath(site, Path(page.file.src_uri).parent)
        return f"{picture}[{text}]({there}{anchor})"

    return LINK.sub(turned, markdown)

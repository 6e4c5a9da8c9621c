"""The docs are true: the site builds without a warning, names all there is, and its commands do what they say."""

from __future__ import annotations

import html
import os
import re
import shlex
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
import typer.main

from chairward.cli import app as cli
from chairward.plugins import discover

ROOT = Path(__file__).resolve().parents[2]
PAGES = [*ROOT.glob("docs/*.md"), *ROOT.glob("plugins/*/README.md"), ROOT / "README.md", ROOT / "CONTRIBUTING.md"]
PREFIX = re.compile(r"^\s*(?:\./run chairward|chairward) (?P<rest>\S.*)$")

ELSEWHERE = {
    "plugins grade": "tests/end_to_end/test_third_party.py",
    "check drive": "tests/core/check",
    "profile new": "tests/core/profile/test_profile_cli.py",
    "run --chair files": "tests/end_to_end/test_recorded_input.py",
    "run --chair screen": "tests/plugins/dashboard/test_dashboard_chair.py",
    "run --chair prototype": "tests/end_to_end/test_sentences.py",
    "demo --headless --for 60s": "tests/end_to_end/test_demo.py",
    "can monitor": "tests/plugins/drive_can",
    "sim rnet": "tests/plugins/drive_can",
    "pic monitor": "tests/plugins/drive_pic_serial",
    "sim pic": "tests/plugins/drive_pic_serial",
    "words": "tests/plugins/voice_dtw",
    "new-plugin": "tests/end_to_end/test_third_party.py",
}
"""Commands that need a device or minutes: which test runs them."""
NOT_ZERO = {
    "doctor --chair prototype": 1,
    "demo --set limits.stop_mm=500": 2,
    "demo --set pic_serial.port=/dev/ttyUSB7": None,
    "pic find": None,
}
"""Exit codes other than 0 that the pages themselves announce; None where it depends on the machine."""


def written() -> list[str]:
    """Every command line in a fenced or indented block of a page, comments taken off, each once."""
    found: dict[str, None] = {}
    for page in PAGES:
        for line in page.read_text(encoding="utf-8").splitlines():
            if match := PREFIX.match(line):
                found[re.split(r"\s{2,}|\s#", match["rest"])[0].strip()] = None
    return list(found)


COMMANDS = written()


def is_notation(line: str) -> bool:
    """Usage in general terms ([PERSON], chair|person), not a command as somebody would type it."""
    return bool(re.search(r"[|\[]|\.\.\.", line))


def words_of(line: str) -> list[str]:
    return [word for word in shlex.split(line) if not re.search(r"[|\[\]]|\.\.\.", word)]


@pytest.fixture(scope="module")
def root_command() -> Any:
    cli.add_plugin_commands(discover())
    return typer.main.get_command(cli.app)


@pytest.mark.parametrize("line", COMMANDS)
def test_every_command_in_the_docs_exists_with_its_options(line: str, root_command: Any) -> None:
    command, words = root_command, words_of(line)
    while words and words[0] in getattr(command, "commands", {}):
        command = command.commands[words.pop(0)]
    assert command is not root_command, f"no such command: {line}"
    known = {option for parameter in command.params for option in [*parameter.opts, *parameter.secondary_opts]}
    used = {word.split("=")[0] for word in words if word.startswith("--")}
    assert used <= known | {"--help"}, f"{line}: no option {sorted(used - known)}"


def runs_here(line: str) -> bool:
    return (not is_notation(line) and not any(line.startswith(start) for start in ELSEWHERE)) or line.endswith("--help")


@pytest.fixture(scope="module")
def recording(tmp_path_factory: pytest.TempPathFactory, command: Callable[..., Any]) -> Path:
    path: Path = tmp_path_factory.mktemp("docs") / "FILE.mcap"
    ended = command("demo", "--headless", "--for", "5s", "--json", "--record", str(path))
    assert ended.code == 0, ended.err[-2000:]
    return path


@pytest.mark.timeout(240)
@pytest.mark.parametrize("line", [line for line in COMMANDS if runs_here(line)])
def test_commands_in_the_docs_do_what_is_said(
    line: str, command: Callable[..., Any], recording: Path, tmp_path: Path
) -> None:
    places = {"FILE.mcap": str(recording), "SOMEWHERE": str(tmp_path), "home.png": str(tmp_path / "home.png")}
    words = [places.get(word, word) for word in shlex.split(line)]
    if words[0] == "demo" and "--help" not in words:
        words = [word for word in words if word not in ("--headless", "--json")]
        if "--for" in words:
            del words[words.index("--for") : words.index("--for") + 2]
        words += ["--headless", "--json", "--no-record", "--for", "3s"]
    ended = command(*words, timeout_s=200.0)
    expected = next((code for start, code in NOT_ZERO.items() if line.startswith(start)), 0)
    assert expected is None or ended.code == expected, f"{line}: {ended.code}: {ended.err[-2000:]}{ended.out[-500:]}"
    assert "Traceback" not in ended.err


def test_commands_that_are_run_elsewhere_are_run_there() -> None:
    for start, place in ELSEWHERE.items():
        assert (ROOT / place).exists(), place
        assert any(line.startswith(start) for line in COMMANDS), f"'{start}' is in no page any more"


@pytest.fixture(scope="module")
def site(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The site, built as strictly as mkdocs can."""
    folder = tmp_path_factory.mktemp("site")
    done = subprocess.run(
        [sys.executable, "-m", "mkdocs", "build", "--strict", "--quiet", "--site-dir", str(folder)],
        cwd=ROOT,
        env={**os.environ, "NO_MKDOCS_2_WARNING": "1"},
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 0, done.stdout[-3000:] + done.stderr[-3000:]
    return folder


@pytest.mark.timeout(300)
def test_the_site_builds_without_a_warning_and_fetches_nothing(site: Path) -> None:
    pages = list(site.rglob("*.html"))
    assert len(pages) > 20
    for page in pages:
        loaded = re.findall(
            r"<(?:script|img|iframe)[^>]+src=\"(https?:[^\"]+)|<link[^>]+href=\"(https?:[^\"]+)\"[^>]+stylesheet",
            page.read_text(encoding="utf-8"),
        )
        assert loaded == [], f"{page}: {loaded}"


@pytest.mark.timeout(300)
def test_every_hook_setting_command_and_message_field_is_on_the_site(site: Path, root_command: Any) -> None:
    sys.path.insert(0, str(ROOT / "docs" / "_site"))
    try:
        import reference  # type: ignore[import-not-found]
    finally:
        sys.path.pop(0)
    text = " ".join(page.read_text(encoding="utf-8") for page in site.rglob("*.html"))
    said = set(re.findall(r"[\w-]+", html.unescape(re.sub(r"<[^>]+>", " ", text))))
    missing = [name for name in reference.every_name(discover()) for word in name.split() if word not in said]
    assert missing == []

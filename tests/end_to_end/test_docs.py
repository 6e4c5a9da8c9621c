"""The docs are true: the site builds without a warning, names all there is, and its commands do what they say."""

from __future__ import annotations

import html
import os
import re
import shlex
import shutil
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any
from urllib.parse import unquote

import pytest
import typer.main
from typer.testing import CliRunner

from chairward import hookspecs, plan, records
from chairward.cli import app as cli
from chairward.components import Context
from chairward.plugins import discover
from chairward.recording import Recorder, RecorderSettings
from chairward.testing.observer_contract import ride
from chairward.testing.ride import chair_plan
from chairward_voice_dtw.audio import read_wav
from chairward_voice_dtw.store import WordStore

ROOT = Path(__file__).resolve().parents[2]
PAGES = [*ROOT.glob("docs/*.md"), *ROOT.glob("plugins/*/README.md"), ROOT / "README.md", ROOT / "CONTRIBUTING.md"]
WORDS = ROOT / "plugins/simulator/src/chairward_simulator/words"
PREFIX = re.compile(r"^\s*(?:\./run chairward|chairward) (?P<rest>\S.*)$")

ELSEWHERE = {
    "plugins grade": "tests/end_to_end/test_third_party.py",
    "check drive": "tests/core/check",
    "run --chair files": "tests/end_to_end/test_recorded_input.py",
    "run --chair screen": "tests/plugins/dashboard/test_dashboard_chair.py",
    "run --chair prototype": "tests/end_to_end/test_sentences.py",
    "demo --headless --for 60s": "tests/end_to_end/test_demo.py",
    "demo --set pic_serial.port=": "tests/end_to_end/test_sentences.py",
    "can monitor --interface": "tests/plugins/drive_can",
    "sim rnet": "tests/plugins/drive_can",
    "pic monitor PORT": "tests/plugins/drive_pic_serial",
    "sim pic": "tests/plugins/drive_pic_serial",
    "words record": "tests/plugins/voice_dtw",
    "words evaluate": "tests/plugins/voice_dtw",
}
"""Commands that need a device, or minutes, or never end: which test runs them."""
TYPED = {
    "profile check NAME... | --all": "profile check --all",
    "profile show CHAIR [PERSON]": "profile show sim demo",
    "profile schema chair|person": "profile schema person",
    "pic monitor PORT [--record FILE]": "pic monitor PORT --record FILE",
    "sim pic [--engine model|gpsim] [--link PATH]": "sim pic --engine gpsim --link PATH",
    "profile new person NAME": "profile new person maria",
    "profile new chair NAME": "profile new chair hers",
}
"""What is said in general terms, as somebody would type it."""
AT_ONCE = re.compile(r"words|profile|pic monitor|pic flash-help|can|new-plugin|plugins|.*--help$")
"""Commands that only read and write files, or only tell: run in this process, the others in one of their own."""
NOT_ZERO = {
    "doctor --chair prototype": 1,
    "demo --set limits.stop_mm=500": 2,
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


@pytest.fixture(scope="module")
def root_command() -> Any:
    cli.add_plugin_commands(discover())
    return typer.main.get_command(cli.app)


@pytest.mark.parametrize("line", COMMANDS)
def test_every_command_in_the_docs_exists_with_all_it_needs_and_no_option_it_lacks(
    line: str, root_command: Any
) -> None:
    command, words = root_command, shlex.split(TYPED.get(line, line))
    while words and words[0] in getattr(command, "commands", {}):
        command = command.commands[words.pop(0)]
    assert command is not root_command, f"no such command: {line}"
    if words != ["--help"]:
        command.make_context(line, words)  # raises for an unknown option and for a missing one


def runs_here(line: str) -> bool:
    return line.endswith("--help") or not any(line.startswith(start) for start in ELSEWHERE)


@pytest.fixture
def place(tmp_path: Path) -> Callable[[str], list[str]]:
    """What a word of a page stands for on this machine."""
    say, taught = (sorted(WORDS.glob(f"{folder}/left_*.wav")) for folder in ("say", "templates"))
    seen, exchange = tmp_path / "seen.log", tmp_path / "exchange.txt"
    seen.write_text("(1763800000.000000) can0 02000000#6400\n")
    exchange.write_text("0.1 < 00\n")
    places = {
        "SOMEWHERE": [str(tmp_path)],
        "home.png": [str(tmp_path / "home.png")],
        "seen.log": [str(seen)],
        "FILE": [str(exchange)],
        "try.wav": [str(say[0])],
        "left_*.wav": [str(path) for path in taught],
    }

    def stands_for(word: str) -> list[str]:
        if word == "FILE.mcap":
            return [str(recording(tmp_path))]
        return places.get(word, [word])

    return stands_for


def recording(folder: Path) -> Path:
    """Two seconds of a ride, as the recorder keeps them. (A whole demo is replayed in test_demo.py.)"""
    plan.write(chair_plan(), folder / "plan.json")
    context = Context(lane="recorder", run_dir=folder, chair_dir=folder)
    recorder = Recorder(RecorderSettings(path=Path("FILE.mcap")), context)
    for record in ride(100):
        recorder.observe(records.encode(record))
    recorder.close()
    return folder / "FILE.mcap"


@pytest.fixture
def home(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A home in which asha has recorded two words, and profiles of one's own."""
    monkeypatch.setenv("XDG_DATA_HOME", str(tmp_path))
    store = WordStore(tmp_path / "chairward" / "people" / "asha")
    for word in ("left", "stop"):
        store.replace(word, [read_wav(path)[0] for path in sorted(WORDS.glob(f"templates/{word}_*.wav"))])


@pytest.mark.timeout(240)
@pytest.mark.parametrize("line", [line for line in COMMANDS if runs_here(line) and not AT_ONCE.match(line)])
def test_commands_in_the_docs_do_what_is_said(
    line: str, command: Callable[..., Any], place: Callable[[str], list[str]]
) -> None:
    words = [typed for word in shlex.split(line) for typed in place(word)]
    if words[0] == "demo" and "--help" not in words:
        words = [word for word in words if word not in ("--headless", "--json")]
        if "--for" in words:
            del words[words.index("--for") : words.index("--for") + 2]
        words += ["--headless", "--json", "--no-record", "--for", "3s"]
    ended = command(*words, timeout_s=200.0)
    expected = next((code for start, code in NOT_ZERO.items() if line.startswith(start)), 0)
    assert expected is None or ended.code == expected, f"{line}: {ended.code}: {ended.err[-2000:]}{ended.out[-500:]}"
    assert "Traceback" not in ended.err


@pytest.mark.timeout(240)
@pytest.mark.parametrize("line", [line for line in COMMANDS if runs_here(line) and AT_ONCE.match(line)])
@pytest.mark.usefixtures("root_command", "home")
def test_commands_that_need_no_process_of_their_own_do_what_is_said(
    line: str, place: Callable[[str], list[str]], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    words = [typed for word in shlex.split(TYPED.get(line, line)) for typed in place(word)]
    if words[:2] == ["profile", "new"]:
        monkeypatch.setenv("CHAIRWARD_PROFILES", str(shutil.copytree(ROOT / "profiles", tmp_path / "profiles")))
    ended = CliRunner().invoke(cli.app, words)
    assert ended.exit_code == 0, f"{line}: {ended.output[-2000:]} {ended.exception}"


def test_commands_that_are_run_elsewhere_are_run_there() -> None:
    for start, place in ELSEWHERE.items():
        assert (ROOT / place).exists(), place
        assert any(line.startswith(start) for line in COMMANDS), f"'{start}' is in no page any more"


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.relative_to(ROOT).as_posix())
def test_every_link_of_a_page_leads_somewhere_in_the_checkout(page: Path) -> None:
    links = re.findall(r"\]\(([^)\s#]+)[^)]*\)", page.read_text(encoding="utf-8"))
    assert [link for link in links if ":" not in link and not (page.parent / unquote(link)).exists()] == []


def test_every_screenshot_is_shown_on_the_page_of_the_screens() -> None:
    shown = re.findall(r"!\[[^\]]+\]\(screenshots/([\w.-]+)\)", (ROOT / "docs/screens.md").read_text(encoding="utf-8"))
    assert sorted(shown) == sorted(path.name for path in ROOT.glob("docs/screenshots/*"))


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


def sections(page: Path) -> dict[str, set[str]]:
    """What stands as code under each heading of a page of the site; "": before the first."""
    found = {}
    for part in page.read_text(encoding="utf-8").split("<h2"):
        heading, _, _ = part.rpartition("</h2>")
        named = html.unescape(re.sub(r"<[^>]+>", "", heading.partition(">")[2]))
        found[named] = {html.unescape(code) for code in re.findall(r"<code>(.*?)</code>", part)}
    return found


@pytest.mark.timeout(300)
def test_every_hook_setting_command_and_message_field_is_in_its_own_section_of_the_reference(
    site: Path, root_command: Any
) -> None:
    sys.path.insert(0, str(ROOT / "docs" / "_site"))
    try:
        import reference  # type: ignore[import-not-found]
    finally:
        sys.path.pop(0)
    names = list(reference.every_name(discover()))
    pages = {page: sections(site / "reference" / page / "index.html") for page in {page for page, _, _ in names}}
    assert len(names) > 200
    assert [name for name in names if name[2] not in pages[name[0]].get(name[1], set())] == []


def test_the_table_of_hooks_has_every_hook() -> None:
    table = (ROOT / "docs" / "write-a-plugin.md").read_text(encoding="utf-8")
    assert re.findall(r"^\| `(chairward_\w+)`", table, re.MULTILINE) == [
        name for name in vars(hookspecs) if name.startswith("chairward_")
    ]

"""A new plugin begins with four small, whole files; a wrong name or place is one sentence and writes nothing."""

from __future__ import annotations

import ast
import os
import subprocess
import sys
import tomllib
from pathlib import Path

import pytest
from typer.testing import CliRunner

from chairward.cli.app import app
from chairward.scaffold import KINDS, ScaffoldError, files, write


@pytest.mark.parametrize("kind", KINDS)
def test_four_files_that_python_and_pip_understand(kind: str, tmp_path: Path) -> None:
    folder = write("garden_sonar", kind, tmp_path)
    made = sorted(str(path.relative_to(folder)) for path in folder.rglob("*") if path.is_file())
    code, test = "src/chairward_garden_sonar/__init__.py", "tests/test_garden_sonar.py"
    assert made == sorted(["README.md", "pyproject.toml", code, test])
    for path in (code, test):
        ast.parse((folder / path).read_text())
    project = tomllib.loads((folder / "pyproject.toml").read_text())["project"]
    assert project["entry-points"]["chairward.plugins"] == {"garden_sonar": "chairward_garden_sonar"}


@pytest.mark.parametrize("kind", KINDS)
def test_no_placeholder_is_left(kind: str) -> None:
    assert all("$" not in text for text in files("garden_sonar", kind).values())


BEGINS: dict[str, tuple[str, int, str]] = {
    # kind: (which of its tests, their exit code, what they say)
    "sensor": ("how_far_away", 1, "450 mm ahead did not come"),
    "drive": ("frozen", 1, "is not written yet"),
    "recognizer": ("each_command", 0, "1 passed"),
    "source": ("items_of_its_kind", 0, "1 passed"),
    "observer": ("", 0, " passed"),
}


@pytest.fixture(scope="module")
def begun(tmp_path_factory: pytest.TempPathFactory) -> dict[str, tuple[int, str]]:
    """Exit code and words of those tests of each kind of new plugin; side by side, for they mostly wait."""
    running = {}
    for kind, (tests, _, _) in BEGINS.items():
        folder = write(f"new_{kind}", kind, tmp_path_factory.mktemp(kind))
        command = [sys.executable, "-m", "pytest", "-q", "-x", "-p", "no:cacheprovider", "-k", tests]
        environment = {**os.environ, "PYTHONPATH": str(folder / "src")}
        pipe = subprocess.PIPE
        running[kind] = subprocess.Popen(command, cwd=folder, env=environment, stdout=pipe, stderr=pipe, text=True)
    said = {kind: "".join(process.communicate(timeout=110)) for kind, process in running.items()}
    return {kind: (running[kind].returncode, text) for kind, text in said.items()}


@pytest.mark.parametrize("kind", KINDS)
def test_a_new_plugin_is_green_or_red_with_a_sentence_that_says_what_is_to_do(
    kind: str, begun: dict[str, tuple[int, str]]
) -> None:
    _, code, says = BEGINS[kind]
    assert begun[kind][0] == code, begun[kind][1][-2000:]
    assert says in begun[kind][1]


def test_a_working_range_sensor_takes_at_most_sixty_lines() -> None:
    code = files("sonar", "sensor")[Path("src/chairward_sonar/__init__.py")]
    assert len(code.splitlines()) <= 60


@pytest.mark.parametrize("name", ["Garden", "garden-sonar", "9lives", "class", "", "a__b", "x" * 3 + "_"])
def test_a_name_that_python_cannot_use_is_refused(name: str, tmp_path: Path) -> None:
    with pytest.raises(ScaffoldError, match="small letters"):
        write(name, "sensor", tmp_path)
    assert list(tmp_path.iterdir()) == []


def test_an_unknown_kind_is_refused_with_those_there_are(tmp_path: Path) -> None:
    with pytest.raises(ScaffoldError, match="sensor, recognizer, drive, source, observer"):
        write("sonar", "camera", tmp_path)


def test_what_is_there_already_is_not_touched(tmp_path: Path) -> None:
    write("sonar", "sensor", tmp_path)
    with pytest.raises(ScaffoldError, match="exists already"):
        write("sonar", "observer", tmp_path)


def test_a_place_that_cannot_be_written_is_one_sentence(tmp_path: Path) -> None:
    (tmp_path / "file").touch()
    ended = CliRunner().invoke(app, ["new-plugin", "okay", "--kind", "sensor", "--to", str(tmp_path / "file")])
    assert ended.exit_code == 2
    assert f"{tmp_path}/file/chairward_okay cannot be written (Not a directory): choose another place" in ended.output


@pytest.mark.parametrize("name", ["voice_dtw", "sim_cameras"])
def test_the_name_of_an_installed_plugin_or_component_is_refused(name: str, tmp_path: Path) -> None:
    ended = CliRunner().invoke(app, ["new-plugin", name, "--kind", "sensor", "--to", str(tmp_path)])
    assert ended.exit_code == 2
    assert f"something named '{name}' is installed already" in ended.output
    assert list(tmp_path.iterdir()) == []


def test_the_sensor_in_the_docs_is_the_one_that_is_made() -> None:
    page = Path(__file__).resolve().parents[2] / "docs" / "write-a-plugin.md"
    assert files("garden_sonar", "sensor")[Path("src/chairward_garden_sonar/__init__.py")] in page.read_text()

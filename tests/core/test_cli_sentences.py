"""What a person mistypes at the command line is answered by one sentence with the file and what to do."""

from __future__ import annotations

import json
from pathlib import Path

import pytest
from typer.testing import CliRunner

from chairward import plan, profile
from chairward.cli.app import app
from chairward.components import Context
from chairward.plugins import discover
from chairward.recording import Recorder, RecorderSettings


@pytest.fixture(scope="module")
def recording(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """One that holds a plan and nothing else."""
    folder = tmp_path_factory.mktemp("drive")
    plan.write(profile.load("sim", None, [], discover()), folder / "plan.json")
    Recorder(RecorderSettings(path=Path("r.mcap")), Context(lane="r", run_dir=folder, chair_dir=folder)).close()
    return folder / "r.mcap"


@pytest.mark.parametrize(
    ("words", "says"),
    [
        ("record inspect {}/nope.mcap", "{}/nope.mcap: there is no such file: check the path"),
        ("record inspect {}", "{}: is a folder: name a file in it"),
        ("record export {}/nope.mcap --to {}/out", "{}/nope.mcap: there is no such file: check the path"),
        ("record export RECORDING --to {}/file/x", "--to: {}/file/x cannot be written (not a directory): choose"),
        ("record redact RECORDING {}/file/x.mcap", "the copy: {}/file cannot be written (is no folder): choose"),
        ("replay {}/nope.mcap", "{}/nope.mcap: there is no such file: check the path"),
        ("replay RECORDING --what-if careful --picture {}/file/x.svg", "--picture: {}/file cannot be written"),
        ("chair new box --profiles {} --answers {}/nope.toml", "{}/nope.toml: there is no such file: check the path"),
        ("chair new box --profiles {} --answers {}/file", "{}/file: is not TOML (Expected '=' after a key"),
    ],
)
def test_a_place_that_is_not_there_is_one_sentence(words: str, says: str, recording: Path, tmp_path: Path) -> None:
    (tmp_path / "file").write_text("not TOML at all")
    line = words.replace("{}", str(tmp_path)).replace("RECORDING", str(recording))
    ended = CliRunner().invoke(app, line.split())
    assert ended.exit_code in (1, 2)
    assert isinstance(ended.exception, SystemExit)
    assert f"chairward: {says.replace('{}', str(tmp_path))}" in ended.output
    assert "Errno" not in ended.output
    assert len(ended.output.splitlines()) == 1


def test_a_rule_that_a_plugin_keeps_is_given_no_reason_why_not(tmp_path: Path) -> None:
    folder = Path(__file__).resolve().parents[2] / "plugins" / "microphone"
    arguments = ["plugins", "grade", "microphone", "--folder", str(folder), "--tests", str(tmp_path), "--json"]
    ended = CliRunner().invoke(app, arguments)
    assert ended.exit_code == 0, ended.output
    rules = json.loads(ended.stdout)["rules"]
    assert {rule["why"] for rule in rules if rule["kept"]} == {""}
    assert all(rule["why"] for rule in rules if rule["kept"] is False)

"""Changing a person file from a program: comments stay, what is unsafe is refused with the loader's own sentence."""

from __future__ import annotations

import json
import shutil
import tomllib
from pathlib import Path

import pytest
from typer.testing import CliRunner

from chairward.cli.profile_edit import app
from chairward.profile import ProfileError, edit

SHIPPED = Path(__file__).resolve().parents[3] / "profiles"


@pytest.fixture
def profiles(tmp_path: Path) -> Path:
    """A copy of the shipped profiles; what they point to stays where it is."""
    folder = tmp_path / "profiles"
    shutil.copytree(SHIPPED, folder)
    for file in folder.glob("*/*.toml"):
        text = file.read_text(encoding="utf-8")
        file.write_text(text.replace('"../../', f'"{SHIPPED.parent}/'), encoding="utf-8")
    return folder


def run(profiles: Path, *arguments: str, code: int = 0) -> str:
    result = CliRunner().invoke(app, [*arguments, "--profiles", str(profiles)])
    assert result.exit_code == code, result.output
    return result.output


def test_a_change_keeps_every_comment_and_every_other_line(profiles: Path) -> None:
    file = profiles / "people" / "careful.toml"
    before = file.read_text(encoding="utf-8").splitlines()
    assert "ok     careful on sim: stops in" in run(profiles, "set", "careful", "limits.stop_mm=900")
    after = file.read_text(encoding="utf-8").splitlines()
    changed = [(old, new) for old, new in zip(before, after, strict=True) if old != new]
    assert len(changed) == 1
    assert changed[0][1].startswith("stop_mm = 900")


def test_words_of_any_script_and_with_dots_can_be_set_and_taken_out(profiles: Path) -> None:
    file = profiles / "people" / "careful.toml"
    run(profiles, "set", "careful", "words.आगे=front", "words.go on. now=front", "words.a=b=left")
    words = tomllib.loads(file.read_text(encoding="utf-8"))["words"]
    assert (words["आगे"], words["go on. now"], words["a=b"]) == ("front", "front", "left")
    run(profiles, "set", "careful", "words.आगे=")
    assert "आगे" not in tomllib.loads(file.read_text(encoding="utf-8"))["words"]


@pytest.mark.parametrize(
    ("change", "sentence"),
    [
        ("limits.stop_mm=500", "limits.stop_mm = 500"),
        ("limits.forward_mm_s=600", "but this chair allows at most 500"),
        ("limits.gap_limit_ms=400", "only the integrator may set this"),
        ("words.stop=front", "stop"),
        ("words.stop=", "stop"),
        ("limits.stop_mm=far", "limits.stop_mm"),
        ("settings.voice_dtw.threshold=-3", "threshold"),
        ("footprint.front_mm=1", "footprint"),
    ],
)
def test_what_the_loader_refuses_is_not_written_and_its_sentence_is_told(
    profiles: Path, change: str, sentence: str
) -> None:
    file = profiles / "people" / "careful.toml"
    before = file.read_bytes()
    told = json.loads(run(profiles, "set", "careful", change, "--json", code=1))
    assert told["ok"] is False
    assert sentence in told["why"]
    assert file.read_bytes() == before
    assert [path.name for path in file.parent.iterdir() if path.suffix != ".toml"] == []


def test_trying_writes_nothing(profiles: Path) -> None:
    file = profiles / "people" / "careful.toml"
    before = file.read_bytes()
    assert json.loads(run(profiles, "set", "careful", "limits.stop_mm=900", "--try", "--json"))["ok"] is True
    assert file.read_bytes() == before


@pytest.mark.parametrize("text", ["stop_mm", "limits.=3", "=3", "limits=3", "settings.voice_dtw=3", "name=other"])
def test_a_change_that_names_no_value_is_refused(text: str) -> None:
    with pytest.raises(ProfileError, match="write key=value"):
        edit.changes([text])


def test_people_of_a_chair_are_listed_with_why_one_cannot_drive_it(profiles: Path) -> None:
    (profiles / "people" / "demo.toml").write_text('name = "demo"\nchair = "screen"\n', encoding="utf-8")
    (profiles / "people" / "torn.toml").write_text("name = ", encoding="utf-8")
    found = {row["name"]: row for row in json.loads(run(profiles, "people", "screen", "--json"))["people"]}
    assert found.keys() == {"demo", "torn", "careful"}
    assert not found["careful"]["why"]
    assert "word" in found["demo"]["why"]
    assert "is not valid TOML" in found["torn"]["why"]
    assert "careful: stops in" in run(profiles, "people", "sim")


def test_limits_tell_the_chairs_bound_and_the_persons_own_value(profiles: Path) -> None:
    told = json.loads(run(profiles, "limits", "sim", "careful", "--json"))
    rows = {row["key"]: row for row in told["limits"]}
    assert (rows["stop_mm"]["chair"], rows["stop_mm"]["own"], rows["stop_mm"]["safer"]) == (600, 800, "higher")
    assert rows["lease_warn_s"]["safer"] == "free"
    assert "gap_limit_ms" not in rows, "what only the integrator may set is not offered"
    assert {(row["component"], row["key"]) for row in told["choices"]} >= {("voice_dtw", "threshold")}
    assert all(row["description"] for row in rows.values())
    assert "at least 600" in " ".join(run(profiles, "limits", "sim", "careful").split())

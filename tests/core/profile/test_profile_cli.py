"""`chairward profile check|show|new|schema`."""

from __future__ import annotations

import json
import tomllib
from pathlib import Path

import jsonschema
import pytest
from typer.testing import CliRunner

from chairward.cli.profile import app

PROFILES = Path(__file__).resolve().parents[3] / "profiles"


def run(*arguments: str, folder: Path | None = PROFILES, code: int = 0) -> str:
    more = [] if folder is None else ["--profiles", str(folder)]
    result = CliRunner().invoke(app, [*arguments, *more])
    assert result.exit_code == code, result.output
    return result.output


def test_check_all_prints_one_line_for_each_file_and_ends_well() -> None:
    lines = run("check", "--all").splitlines()
    assert len(lines) == len(list(PROFILES.glob("*/*.toml")))
    assert all(line.startswith("ok     ") for line in lines)


def test_check_names_what_is_wrong_and_ends_badly(tmp_path: Path) -> None:
    (tmp_path / "chairs").mkdir()
    good = (PROFILES / "chairs" / "sim.toml").read_text(encoding="utf-8").replace('person = "demo"', "")
    good = good.replace("../../plugins", str(PROFILES.parent / "plugins"))
    (tmp_path / "chairs" / "sim.toml").write_text(good, encoding="utf-8")
    (tmp_path / "chairs" / "bad.toml").write_text(
        good.replace('name = "sim"', 'name = "bad"').replace("forward_mm_s = 500", "forward_mm_s = 1400"),
        encoding="utf-8",
    )
    lines = run("check", "--all", folder=tmp_path, code=1).splitlines()
    assert [line[:24] for line in lines] == ["WRONG  chairs/bad.toml: ", "ok     chairs/sim.toml: "]
    assert "limits.forward_mm_s = 1400" in lines[0]
    assert "at most" in lines[0]
    assert run("check", "sim", folder=tmp_path).startswith("ok     chairs/sim.toml")
    assert "there is no profile 'smi'" in run("check", "smi", folder=tmp_path, code=1)


def test_check_of_a_chair_looks_at_the_person_it_names(tmp_path: Path) -> None:
    (tmp_path / "chairs").mkdir()
    text = (PROFILES / "chairs" / "prototype.toml").read_text(encoding="utf-8")
    (tmp_path / "chairs" / "prototype.toml").write_text(text, encoding="utf-8")
    assert "there is no profile 'demo'" in run("check", "prototype", folder=tmp_path, code=1)


def test_check_takes_paths_and_names_of_people() -> None:
    path = PROFILES / "people" / "careful.toml"
    assert run("check", str(path)) == run("check", "careful")
    assert run("check", "rnet", "asha").count("ok     ") == 2


def test_check_of_nothing_is_a_wrong_call(tmp_path: Path) -> None:
    assert "name the profiles to check" in run("check", code=2)
    assert "there are no profiles" in run("check", "--all", folder=tmp_path, code=1)


def test_show_tells_what_comes_from_where() -> None:
    text = run("show", "sim", "careful", "--set", "limits.stop_mm=900")
    rows = {line.split()[0]: line.split()[1:] for line in text.splitlines()[2:]}
    assert rows["limits.stop_mm"] == ["900", "--set"]
    assert rows["limits.forward_mm_s"] == ["250.0", "people/careful.toml"]
    assert rows["limits.steer_deg_s"] == ["10.0", "chairs/sim.toml"]
    assert rows["drive.pic_serial.full_speed_mm_s"] == ["700.0", "chairs/sim.toml"]
    assert rows["words.front"] == ["front", "people/careful.toml"]


def test_show_json_is_the_whole_plan() -> None:
    shown = json.loads(run("show", "sim", "--json"))
    assert shown["plan"]["person"] == "demo"
    assert shown["plan"]["limits"]["stop_mm"] == 600
    assert shown["proof"]["nearest_mm"] >= 450
    assert shown["origin"]["limits.steer_deg_s"] == "chairs/sim.toml"


def test_show_of_a_wrong_profile_is_one_sentence() -> None:
    text = run("show", "sim", "demo", "--set", "limits.stop_mm=10", code=1)
    assert text.startswith("chairward: --set limits.stop_mm = 10: ")
    assert text.count("\n") == 1


def test_a_new_person_is_right_as_written_and_never_overwrites(tmp_path: Path) -> None:
    (tmp_path / "chairs").mkdir()
    chair = (PROFILES / "chairs" / "prototype.toml").read_text(encoding="utf-8").replace('person = "demo"', "")
    (tmp_path / "chairs" / "prototype.toml").write_text(chair, encoding="utf-8")
    run("new", "person", "maria", "--chair", "prototype", folder=tmp_path)
    assert run("check", "maria", folder=tmp_path).startswith("ok     people/maria.toml: prototype: ")
    path = tmp_path / "people" / "maria.toml"
    before = path.read_text(encoding="utf-8")
    assert "was not touched" in run("new", "person", "maria", "--chair", "prototype", folder=tmp_path, code=1)
    assert path.read_text(encoding="utf-8") == before


def test_every_limit_in_a_new_person_file_may_be_uncommented(tmp_path: Path) -> None:
    (tmp_path / "chairs").mkdir()
    chair = (PROFILES / "chairs" / "prototype.toml").read_text(encoding="utf-8").replace('person = "demo"', "")
    (tmp_path / "chairs" / "prototype.toml").write_text(chair, encoding="utf-8")
    run("new", "person", "maria", "--chair", "prototype", folder=tmp_path)
    path = tmp_path / "people" / "maria.toml"
    lines = path.read_text(encoding="utf-8").splitlines()
    start = next(i for i, line in enumerate(lines) if line.startswith("[limits]"))
    opened = [line.removeprefix("# ") if i > start and " = " in line else line for i, line in enumerate(lines)]
    path.write_text("\n".join(opened), encoding="utf-8")
    assert len(tomllib.loads("\n".join(opened))["limits"]) > 20
    assert run("check", "maria", folder=tmp_path).startswith("ok     ")


def test_a_new_chair_is_right_as_written(tmp_path: Path) -> None:
    run("new", "chair", "robot2", folder=tmp_path)
    assert run("check", "robot2", folder=tmp_path).startswith("ok     chairs/robot2.toml: ")


@pytest.mark.parametrize("name", ["", "../x", "A", "a b", "x" * 41])
def test_a_name_that_cannot_be_one_writes_nothing(tmp_path: Path, name: str) -> None:
    assert "cannot be a profile's name" in run("new", "chair", name, folder=tmp_path, code=1)
    assert list(tmp_path.rglob("*")) == []


@pytest.mark.parametrize(("what", "kind"), [("chair", "chairs"), ("person", "people")])
def test_the_schema_for_editors_fits_every_shipped_file_and_no_mistyped_key(what: str, kind: str) -> None:
    schema = json.loads(run("schema", what, folder=None))
    checker = jsonschema.Draft202012Validator(schema)
    checker.check_schema(schema)
    for path in (PROFILES / kind).glob("*.toml"):
        values = json.loads(json.dumps(tomllib.loads(path.read_text(encoding="utf-8")), default=str))
        assert list(checker.iter_errors(values)) == [], path
        assert not checker.is_valid({**values, "limts": {}})
        assert not checker.is_valid({**values, "limits": {"stop_mn": 700}})

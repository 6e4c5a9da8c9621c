"""A chair file, a person file and --set come to one plan."""

from __future__ import annotations

import inspect
import os
from pathlib import Path

import msgspec
import pytest

from chairward import plan, profile
from chairward.facts import MS, Limits
from chairward.messages import Button, Command, Way
from chairward.profile.limits import resolve


def test_the_plan_names_every_required_vote_by_lane_and_stage(house) -> None:
    house.chair["lane"]["rear"] = {"source": "sonar", "covers": ["behind"], "freshness_ms": 150}
    house.chair["lane"]["tilt"] = {"source": "tilt", "freshness_ms": 500}
    house.chair["lane"]["front"]["stages"] = ["ranger", "mapper", "guardian"]
    house.chair["lane"]["hand"] = {"source": "stick", "freshness_ms": 120}
    limits = house.load().limits
    assert set(limits.sensors) == {"front/ranger", "front/guardian", "rear/sonar"}
    assert limits.sensors["rear/sonar"].covers == {Way.BEHIND}
    assert limits.sensors["rear/sonar"].freshness_ns == 150 * MS
    assert set(limits.vetoers) == {"front/guardian", "tilt/tilt"}
    assert set(limits.recognizers) == {"voice/words", "hand/stick"}
    assert set(limits.stop_devices) == {"panel/button"}
    assert limits.stop_devices["panel/button"].freshness_ns == 300 * MS


def test_the_plan_carries_lanes_words_and_drive(house) -> None:
    house.chair["lane"]["front"]["pose"] = {"x_mm": 450, "z_mm": 400, "pitch_deg": 10.5}
    loaded = house.load()
    assert [lane.name for lane in loaded.lanes] == ["front", "voice", "panel"]
    assert [part.component for part in loaded.lanes[0].stages] == ["ranger", "mapper"]
    assert (loaded.lanes[0].pose.z_mm, loaded.lanes[0].pose.pitch_deg) == (400, 10.5)
    assert loaded.lanes[2].may == {Button.STOP, Button.ARM}
    assert loaded.words == {"go": "front", "stop": "stop"}
    assert loaded.drive.component == "wheels"
    assert (loaded.drive.settings["port"], loaded.drive.settings["rate"]) == ("/dev/ttyUSB0", 57600)
    assert loaded.person_dir.endswith("asha")


def test_a_plan_survives_being_written_for_the_processes_of_the_run(house, tmp_path: Path) -> None:
    loaded = house.load()
    plan.write(loaded, tmp_path / "plan.json")
    assert plan.read(tmp_path / "plan.json") == loaded


def test_a_person_is_the_chairs_own_when_nobody_is_named(house) -> None:
    house.write()
    assert profile.load("test", None, [], house.registry, house.folder).person == "asha"


def test_profiles_are_found_by_path_by_environment_and_upward(house, monkeypatch, tmp_path: Path) -> None:
    house.write()
    by_path = profile.load(house.chair_file, str(house.person_file), [], house.registry)
    monkeypatch.setenv("CHAIRWARD_PROFILES", str(house.folder))
    assert profile.load("test", "asha", [], house.registry) == by_path
    monkeypatch.delenv("CHAIRWARD_PROFILES")
    (tmp_path / "deep" / "down").mkdir(parents=True)
    monkeypatch.chdir(tmp_path / "deep" / "down")
    assert profile.load("test", "asha", [], house.registry) == by_path


def test_where_nothing_is_set_up_the_users_own_folder_counts_and_before_that_the_checkouts(
    monkeypatch, tmp_path
) -> None:
    monkeypatch.delenv("CHAIRWARD_PROFILES", raising=False)
    monkeypatch.setenv("XDG_CONFIG_HOME", str(tmp_path / "config"))
    monkeypatch.chdir(tmp_path)
    assert (profile.files.directory() / "chairs" / "sim.toml").is_file()
    (tmp_path / "config" / "chairward" / "chairs").mkdir(parents=True)
    assert profile.files.directory() == tmp_path / "config" / "chairward"


def test_recordings_of_a_person_stand_in_the_users_own_data_and_not_in_the_project(
    house, monkeypatch, tmp_path
) -> None:
    monkeypatch.setenv("XDG_DATA_HOME", str(tmp_path / "data"))
    assert house.load().person_dir == str(tmp_path / "data" / "chairward" / "people" / "asha")


# settings -----------------------------------------------------------------------------------------------------------
def test_lane_settings_win_over_general_ones_and_set_wins_over_both(house) -> None:
    house.chair["settings"] = {"ranger": {"window": 5, "method": "bm"}}
    house.chair["lane"]["front"]["settings"] = {"ranger": {"window": 7}}
    settings = house.load().lanes[0].stages[0].settings
    assert (settings["window"], settings["method"]) == (7, "bm")
    assert house.load("ranger.window=11").lanes[0].stages[0].settings["window"] == 11


def test_relative_paths_start_at_the_chair_file_and_those_of_set_at_the_current_folder(
    house, monkeypatch, tmp_path: Path
) -> None:
    monkeypatch.chdir(tmp_path)
    house.chair["settings"] = {"eyes": {"manifest": "../data/m.csv", "pair": ["a.png", "/b.png"]}}
    settings = house.load().lanes[0].source.settings
    assert settings["manifest"] == str(house.folder / "data" / "m.csv")
    assert settings["pair"] == [str(house.folder / "chairs" / "a.png"), "/b.png"]
    assert house.load("eyes.manifest=m.csv").lanes[0].source.settings["manifest"] == str(tmp_path / "m.csv")
    home = house.load("eyes.manifest=~/m.csv").lanes[0].source.settings["manifest"]
    assert home == os.path.expanduser("~/m.csv")


def test_the_runs_folder_is_left_for_the_run_to_fill_in(house) -> None:
    house.chair["drive"]["wheels"]["port"] = "{run}/pic"
    house.chair["settings"] = {"eyes": {"manifest": "{run}/m.csv"}}
    loaded = house.load()
    assert loaded.drive.settings["port"] == "{run}/pic"
    assert loaded.lanes[0].source.settings["manifest"] == "{run}/m.csv"
    assert plan.fill_run_dir(loaded.drive.settings, Path("/tmp/r"))["port"] == "/tmp/r/pic"


def test_a_reference_takes_the_value_of_another_setting_wherever_that_comes_from(house, tmp_path: Path) -> None:
    house.chair["settings"] = {"ranger": {"truth": "@eyes.manifest"}, "words": {"speaker": "@ears.speaker"}}
    assert house.load().lanes[0].stages[0].settings["truth"] is None
    loaded = house.load(f"eyes.manifest={tmp_path}/m.csv", "ears.speaker=kim")
    assert loaded.lanes[0].stages[0].settings["truth"] == str(tmp_path / "m.csv")
    assert loaded.lanes[1].stages[0].settings["speaker"] == "kim"


def test_set_reaches_into_tables_and_takes_toml_values_and_bare_strings(house) -> None:
    house.person["drive"] = "bus"
    loaded = house.load("bus.rnet.takeover=follow", "bus.channel=can1", "words.threshold=2", 'ears.speaker="a b"')
    assert loaded.drive.settings["rnet"] == {"takeover": "follow", "device": 1}
    assert loaded.drive.settings["channel"] == "can1"
    assert loaded.lanes[1].stages[0].settings["threshold"] == 2.0
    assert loaded.lanes[1].source.settings["speaker"] == "a b"


def test_set_changes_drive_and_language(house) -> None:
    loaded = house.load("drive=bus", "language=hi")
    assert (loaded.drive.component, loaded.language) == ("bus", "hi")


def test_set_limits_is_a_persons_change(house) -> None:
    loaded = house.traced("limits.stop_mm=800", "limits.avoid_mm=900", "limits.forward_mm_s=300")
    assert (loaded.plan.limits.stop_mm, loaded.plan.limits.forward_mm_s) == (800, 300)
    assert loaded.origin["limits.stop_mm"] == "--set"


def test_a_companion_or_observer_runs_only_with_its_drive(house) -> None:
    house.chair["companion"] = {"pic": {"component": "puppet", "with_drive": "wheels", "settings": {"speaker": "x"}}}
    house.chair["observer"] = {"log": {"component": "diary"}, "bus": {"component": "diary", "with_drive": "bus"}}
    loaded = house.load()
    assert set(loaded.observers) == {"log"}
    assert loaded.companions["pic"].settings["speaker"] == "x"
    assert loaded.observers["log"].component == "diary"
    assert house.load("drive=bus").companions == {}
    assert set(house.load("drive=bus").observers) == {"log", "bus"}


# limits -------------------------------------------------------------------------------------------------------------
def test_a_person_makes_the_chair_slower_and_more_careful(house) -> None:
    house.person["limits"] = {
        "forward_mm_s": 250,
        "stop_mm": 700,
        "turn_deg_s": 8,
        "commands": ["front", "stop", "help"],
    }
    house.chair["limits"] = {"steer_deg_s": 10}
    loaded = house.traced()
    limits = loaded.plan.limits
    assert (limits.forward_mm_s, limits.caps.forward_mm_s, limits.arc_mm_s) == (250, 250, 250)
    assert limits.steer_deg_s == 8, "the chair's own steering is never faster than the person turns"
    assert limits.commands == {Command.FRONT, Command.STOP, Command.HELP}
    assert loaded.origin["limits.stop_mm"] == "people/asha.toml"
    assert loaded.origin["limits.steer_deg_s"] == "chairs/test.toml"


def test_a_blind_turn_is_so_slow_that_the_toes_stay_under_their_limit(house) -> None:
    limits = house.load().limits
    assert limits.unseen.forward_mm_s == 0
    toes_mm = (450**2 + 300**2) ** 0.5
    assert limits.unseen.left_deg_s * 3.14159265 / 180 * toes_mm == pytest.approx(150)
    assert limits.turn_clear_mm >= toes_mm - 300


def test_the_reaction_is_the_sum_of_all_delays_of_the_chair_file(house) -> None:
    assert house.load().limits.reaction_s == pytest.approx(0.45)
    house.chair["lane"]["rear"] = {"source": "sonar", "covers": ["behind"], "freshness_ms": 300}
    house.chair["stopping"] |= {"watchdog_ms": 100, "tick_ms": 10, "wire_ms": 6, "sensing_ms": 34}
    assert house.load().limits.reaction_s == pytest.approx(0.45), "the slowest sensor counts"


def test_deceleration_is_what_the_slope_leaves_of_it(house) -> None:
    house.chair["stopping"] |= {"decel_mm_s2": 1500, "slope_percent": 9}
    house.chair["drive"]["wheels"]["decel_mm_s2"] = 1500
    assert house.load().limits.decel_mm_s2 == pytest.approx(1500 - 9806.65 * 0.09)


def test_no_limit_of_the_rules_is_left_to_its_default() -> None:
    source = inspect.getsource(resolve)
    assert [field.name for field in msgspec.structs.fields(Limits) if f" {field.name}=" not in source] == []

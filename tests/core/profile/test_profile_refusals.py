"""A wrong profile is refused with one sentence that names file, key, value, what is allowed and what to do."""

from __future__ import annotations

from pathlib import Path

import pytest

from chairward import profile
from chairward.plugins import discover


# words --------------------------------------------------------------------------------------------------------------
def test_no_word_for_stop_is_refused(house) -> None:
    house.person["words"] = {"go": "front"}
    assert house.refused().startswith("people/asha.toml: words has no word for 'stop'")


@pytest.mark.parametrize("word", ["stop", "Stop", " STOP ", "ｓｔｏｐ", "halt"])
def test_a_stop_word_that_means_motion_is_refused(house, word: str) -> None:
    house.person["words"] = {"ruko": "stop", word: "front"}
    message = house.refused()
    assert message.startswith(f"people/asha.toml: words.{word!r} = 'front'")
    assert "must never mean motion" in message


def test_a_stop_word_that_the_integrator_has_reserved_never_means_motion(house) -> None:
    house.chair["stop_words"] = ["stop", "ruko"]
    house.person["words"]["Ruko"] = "back"
    assert "words.'Ruko' = 'back'" in house.refused()


@pytest.mark.parametrize("word", ["Go", "go ", "ＧＯ"])
def test_a_word_that_is_there_twice_is_refused(house, word: str) -> None:
    house.person["words"][word] = "back"
    assert f"people/asha.toml: words.{word!r} = 'back': this word is there already as 'go'" in house.refused()


def test_a_word_twice_in_the_same_spelling_is_refused_with_its_line(house) -> None:
    house.write()
    text = house.person_file.read_text(encoding="utf-8").replace('stop = "stop"', 'stop = "stop"\nstop = "front"')
    house.person_file.write_text(text, encoding="utf-8")
    with pytest.raises(profile.ProfileError, match=r"^people/asha\.toml, line \d+, column \d+: is not valid TOML"):
        profile.load("test", "asha", [], house.registry, house.folder)


def test_an_unknown_command_is_refused_with_those_there_are(house) -> None:
    house.person["words"]["dance"] = "waltz"
    message = house.refused()
    assert message.startswith("people/asha.toml: words.dance = 'waltz': ")
    assert "'front'" in message


def test_a_word_for_a_command_that_is_not_allowed_is_refused(house) -> None:
    house.person["limits"] = {"commands": ["stop", "help"]}
    assert "people/asha.toml: words.'go' = 'front': limits.commands allows only help, stop" in house.refused()


def test_stop_and_help_cannot_be_taken_away(house) -> None:
    house.person["limits"] = {"commands": ["front", "help"]}
    assert "people/asha.toml: limits: commands must keep 'stop'" in house.refused()


# who may what -------------------------------------------------------------------------------------------------------
@pytest.mark.parametrize(
    ("key", "value", "says"),
    [
        ("stop_mm", 650, "limits.stop_mm = 650, but this chair allows at least 700"),
        ("forward_mm_s", 501, "limits.forward_mm_s = 501, but this chair allows at most 500"),
        ("lease_s", 9.5, "limits.lease_s = 9.5, but this chair allows at most 8.0"),
        ("commands", ["back", "front", "stop", "help"], "but this chair allows only some of front, help, stop"),
        ("drive_freshness_ms", 150, "limits.drive_freshness_ms = 150, but only the integrator may set this"),
        ("stop_mm", 500, "limits.stop_mm = 500: input should be greater than or equal to 600"),
        ("stop_mm", "fast", "limits.stop_mm = 'fast': input should be a valid integer"),
        ("stop_mm", 700.5, "limits.stop_mm = 700.5: input should be a valid integer"),
        ("forward_mm_s", True, "limits.forward_mm_s = True: input should be a valid integer"),
        ("lease_s", float("nan"), "limits.lease_s = nan: "),
        ("lease_s", float("inf"), "limits.lease_s = inf: "),
        ("stop_mn", 700, "limits.stop_mn is not a setting here: remove or correct it (known: stop_mm"),
    ],
)
def test_a_person_cannot_loosen_a_limit(house, key: str, value: object, says: str) -> None:
    house.chair["limits"] |= {"stop_mm": 700, "commands": ["front", "stop", "help"]}
    house.person["limits"] = {key: value}
    message = house.refused()
    assert message.startswith("people/asha.toml: limits.")
    assert says in message


def test_set_cannot_loosen_a_limit_either(house) -> None:
    house.chair["limits"]["stop_mm"] = 700
    assert house.refused("limits.stop_mm=650") == "--set limits.stop_mm = 650, but this chair allows at least 700"


def test_limits_that_do_not_go_together_are_refused_with_what_to_do(house) -> None:
    house.person["limits"] = {"stop_mm": 800}
    assert house.refused() == "people/asha.toml: limits: avoid_mm = 750 must be above stop_mm = 800: raise avoid_mm too"


def test_a_table_of_the_integrator_in_a_person_file_is_refused(house) -> None:
    house.person["stopping"] = {"decel_mm_s2": 5000}
    assert house.refused().startswith("people/asha.toml: stopping is the integrator's alone")


def test_a_drive_the_chair_does_not_offer_is_refused(house) -> None:
    house.person["drive"] = "jet"
    assert house.refused() == "people/asha.toml: drive = 'jet', but this chair offers only wheels, bus"
    assert house.refused("drive=ship") == "--set drive = 'ship', but this chair offers only wheels, bus"


def test_a_choice_of_drives_has_to_be_made(house) -> None:
    del house.person["drive"]
    assert "people/asha.toml: drive is missing: this chair offers wheels, bus" in house.refused()


def test_a_person_is_refused_on_a_chair_that_was_not_set_up_for_them(house) -> None:
    house.person["chair"] = ["other"]
    assert house.refused().startswith("people/asha.toml: chair = other, but this chair is 'test'")


def test_a_person_may_set_of_a_component_only_what_the_chair_offers_or_a_mark_allows(house) -> None:
    house.person["settings"] = {"ranger": {"window": 5}}
    assert "people/asha.toml: settings.ranger.window = 5, but only the integrator may set this" in house.refused()
    house.chair["choices"] = {
        "ranger": {"window": [5, 9]},
        "words": {"threshold": {"min": 0, "max": 2}, "speaker": "any"},
    }
    assert house.load().lanes[0].stages[0].settings["window"] == 5
    house.person["settings"] = {"words": {"threshold": 1.5, "speaker": "kim"}}
    assert house.load().lanes[1].stages[0].settings["speaker"] == "kim"
    house.person["settings"] = {"words": {"threshold": 2.5}}
    assert house.refused() == "people/asha.toml: settings.words.threshold = 2.5, but this chair offers 0 to 2"
    house.person["settings"] = {"ranger": {"window": 7}}
    assert house.refused() == "people/asha.toml: settings.ranger.window = 7, but this chair offers only 5, 9"
    house.person["settings"] = {"ranger": {"minimum": 20}}
    assert house.load().lanes[0].stages[0].settings["minimum"] == 20
    house.person["settings"] = {"ranger": {"minimum": 5}}
    assert house.refused() == "people/asha.toml: settings.ranger.minimum = 5, but this chair allows at least 10"


# plugins and settings -----------------------------------------------------------------------------------------------
@pytest.mark.parametrize(
    ("change", "says"),
    [
        ({"lane": {"front": {"source": "radar"}}}, "chairs/test.toml: lane.front.source = 'radar': no plugin offers a"),
        ({"lane": {"front": {"source": "eyes", "stages": ["xray"]}}}, "chairs/test.toml: lane.front.stages: no plugin"),
        ({"companion": {"pic": {"component": "ghost"}}}, "chairs/test.toml: companion.pic.component = 'ghost': no"),
        ({"observer": {"log": {"component": "ghost"}}}, "chairs/test.toml: observer.log.component = 'ghost': no"),
    ],
)
def test_a_component_that_nobody_offers_is_refused_by_name(house, change: dict[str, object], says: str) -> None:
    house.chair |= change
    message = house.refused()
    assert message.startswith(says)
    assert "installed: " in message


def test_a_drive_that_is_not_installed_is_refused_only_to_whom_it_drives(house) -> None:
    house.chair["drive"]["jet"] = {}
    house.load()
    assert house.refused("drive=jet").startswith(
        "chairs/test.toml: drive = 'jet': no plugin offers a drive named 'jet'"
    )


def test_a_refused_plugin_says_why(house) -> None:
    house.registry = discover([], {"eyes": object()})
    message = house.refused()
    assert message.startswith("chairs/test.toml: lane.front.source = 'eyes': source 'eyes': its plugin was refused: ")


@pytest.mark.parametrize(
    ("settings", "says"),
    [
        ({"ranger": {"method": "x"}}, "settings.ranger.method = 'x': input should be 'sgbm', 'bm' or 'thesis_code'"),
        ({"ranger": {"window": 99}}, "settings.ranger.window = 99: input should be less than or equal to 31"),
        (
            {"ranger": {"windwo": 9}},
            "settings.ranger.windwo is not a setting here: remove or correct it (known: method",
        ),
        ({"radar": {"x": 1}}, "settings.radar: this chair uses no component 'radar' (it uses: "),
        ({"ears": {"speaker": "@words.nobody"}}, "settings.ears.speaker = '@words.nobody': 'words' has no setting"),
        ({"ears": {"speaker": "@radar.x"}}, "settings.ears.speaker = '@radar.x': this chair uses no component 'radar'"),
        ({"ears": {"speaker": "@ears.speaker"}}, "settings.ears.speaker = '@ears.speaker': refers to itself"),
        ({"bus": {"rnet": {"device": 99}}}, "settings.bus.rnet.device = 99: input should be less than or equal to 15"),
    ],
)
def test_a_wrong_setting_is_refused_with_file_and_key(house, settings: dict[str, object], says: str) -> None:
    house.chair["settings"] = settings
    assert house.refused().startswith(f"chairs/test.toml: {says}")


def test_the_error_names_the_layer_that_is_wrong(house) -> None:
    house.chair["settings"] = {"ranger": {"window": 5}}
    house.chair["lane"]["front"]["settings"] = {"ranger": {"window": 1}}
    assert house.refused().startswith("chairs/test.toml: lane.front.settings.ranger.window = 1: ")
    assert house.refused("ranger.window=2").startswith("--set ranger.window = 2: ")
    del house.chair["lane"]["front"]["settings"]
    house.chair["drive"]["wheels"] = {"rate": "fast"}
    assert house.refused().startswith("chairs/test.toml: drive.wheels.rate = 'fast': ")
    house.chair["drive"]["wheels"] = {}
    assert house.refused() == "chairs/test.toml: drive.wheels.port is missing: add it"
    house.chair["drive"] = {"wheels": {"port": "x"}, "bus": {"channel": "none"}}
    assert house.refused() == "chairs/test.toml: drive.bus: channel = 'none' needs a bridge"


def test_settings_and_choices_for_nothing_are_refused(house) -> None:
    house.chair["lane"]["front"]["settings"] = {"words": {}}
    assert "chairs/test.toml: lane.front.settings.words: this lane has no 'words'" in house.refused()
    del house.chair["lane"]["front"]["settings"]
    house.chair["choices"] = {"ranger": {"sharpness": [1]}}
    assert "chairs/test.toml: choices.ranger.sharpness is not a setting of 'ranger'" in house.refused()


@pytest.mark.parametrize("text", ["", "x", "=", "stop=1", "ranger.=1", ".window=1", "ranger.window"])
def test_a_set_that_is_not_one_says_how_to_write_it(house, text: str) -> None:
    assert house.refused(text).startswith(f"--set {text!r}: write component.key=value")


def test_a_set_for_nothing_is_refused(house) -> None:
    assert house.refused("radar.x=1").startswith("--set radar.x: this chair uses no component 'radar'")


@pytest.mark.parametrize(
    ("table", "key", "value", "says"),
    [
        ("chair", "kind", "boat", "kind = 'boat': input should be 'simulator', 'files', 'robot' or 'chair'"),
        ("chair", "lane", {}, "lane = {}: needs at least 1"),
        ("chair", "lane", {"Front Eyes": {"source": "eyes"}}, "lane.Front Eyes cannot be called so: use small letters"),
        ("chair", "choices", {"words": {"speaker": 3}}, "choices.words.speaker = 3: input should be a list or a table"),
        ("chair", "choices", {"words": {"speaker": {"min": "a", "max": 1}}}, "choices.words.speaker.min = 'a': input"),
        ("person", "language", "english!", "language = 'english!': use a language code such as"),
        ("person", "words", {"a\nb": "stop"}, "words.a b cannot be called so: use letters, no line breaks"),
        ("person", "limits", 3, "limits = 3: input should be a table"),
        ("person", "chair", ["A b"], "chair.0 = 'A b': use small letters, digits, - and _"),
    ],
)
def test_the_sentence_uses_plain_words(house, table: str, key: str, value: object, says: str) -> None:
    getattr(house, table)[key] = value
    assert house.refused().partition(": ")[2].startswith(says)


def test_what_set_cannot_reach_is_said(house) -> None:
    message = house.refused("footprint.front_mm=3")
    assert message.startswith("--set footprint.front_mm: stands in the chair file alone")


# files --------------------------------------------------------------------------------------------------------------
def test_a_name_that_is_not_there_is_refused_with_those_that_are(house) -> None:
    house.write()
    for chair, person, says in (("tset", "asha", "(there: test)"), ("test", "asah", "(there: asha)")):
        with pytest.raises(profile.ProfileError, match="there is no profile") as caught:
            profile.load(chair, person, [], house.registry, house.folder)
        assert says in str(caught.value)
    for path in ("nowhere/x.toml", "../asha", "\0.toml"):
        with pytest.raises(profile.ProfileError, match="there is no such file"):
            profile.load("test", path, [], house.registry, house.folder)


def test_a_name_that_is_not_the_files_is_refused(house) -> None:
    house.person["name"] = "maria"
    assert house.refused() == "people/asha.toml: name = 'maria': must be the file's name, 'asha'"


def test_nobody_named_anywhere_is_refused(house) -> None:
    del house.chair["person"]
    house.write()
    with pytest.raises(
        profile.ProfileError, match=r"^chairs/test\.toml: names no person: say who drives \(there: asha"
    ):
        profile.load("test", None, [], house.registry, house.folder)


@pytest.mark.parametrize(
    ("data", "says"),
    [
        (b'name = "test"\nkind = \n', "chairs/test.toml, line 2, column 8: is not valid TOML: Invalid value"),
        (b"name = 'a'\nname = 'b'\n", "chairs/test.toml, line 2, column 11: is not valid TOML: Cannot overwrite"),
        (b"\n\n\xff", "chairs/test.toml, line 3: is not UTF-8 text"),
        (b"x = " + b"[" * 5000, "chairs/test.toml: is nested too deeply"),
        (b"#" * 1_000_001, "chairs/test.toml: has 1000001 bytes"),
        (b"", "chairs/test.toml: name is missing: add it (4 more like it)"),
        (b"lane = 3", "chairs/test.toml: "),
    ],
)
def test_a_broken_file_is_refused_with_its_line(house, data: bytes, says: str) -> None:
    house.write()
    house.chair_file.write_bytes(data)
    with pytest.raises(profile.ProfileError) as caught:
        profile.load("test", "asha", [], house.registry, house.folder)
    assert str(caught.value).startswith(says)


def test_a_file_that_cannot_be_read_is_refused(house, tmp_path: Path) -> None:
    with pytest.raises(profile.ProfileError, match="cannot be read"):
        profile.files.read(tmp_path)

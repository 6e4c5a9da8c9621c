"""A chair file that is wrong, or not enough for somebody who sits in the chair, is refused with one sentence."""

from __future__ import annotations

import pytest


# stop device --------------------------------------------------------------------------------------------------------
def test_voice_alone_without_a_stop_device_is_refused(house) -> None:
    del house.chair["lane"]["panel"]
    assert house.refused().startswith("chairs/test.toml: no lane has stop_device = true")
    house.chair["lane"]["voice"] = {"source": "clap"}
    assert house.refused().startswith("chairs/test.toml: no lane has stop_device = true")


def test_a_held_stick_needs_no_stop_device_for_it_stops_when_let_go(house) -> None:
    del house.chair["lane"]["panel"]
    house.chair["lane"]["voice"] = {"source": "stick"}
    assert set(house.load().limits.recognizers) == {"voice/stick"}


def test_a_drive_that_cannot_do_what_the_limits_ask_is_refused(house) -> None:
    house.chair["drive"]["wheels"] |= {"full_speed_mm_s": 400}
    assert house.refused() == (
        "chairs/test.toml: drive.wheels.full_speed_mm_s = 400: less than limits.forward_mm_s = 500: "
        "lower limits.forward_mm_s or correct the drive"
    )
    house.person["limits"] = {"forward_mm_s": 400}
    house.load()


def test_a_drive_that_brakes_less_than_the_proof_assumes_is_refused(house) -> None:
    house.chair["drive"]["wheels"] |= {"decel_mm_s2": 550}
    assert "drive.wheels.decel_mm_s2 = 550: less than stopping.decel_mm_s2 = 600" in house.refused()
    house.chair["drive"]["wheels"]["decel_mm_s2"] = 0
    house.load()


@pytest.mark.parametrize("kind", ["robot", "chair"])
def test_a_drive_that_nobody_has_measured_to_stop_on_silence_is_refused(house, kind: str) -> None:
    house.ridden()
    house.chair["kind"] = kind
    house.chair["drive"]["wheels"] = {"port": "/dev/ttyUSB0"}
    assert house.refused() == (
        "chairs/test.toml: drive.wheels: nobody has measured that this controller stops when commands stop; run "
        "'chairward check drive --chair test' with the wheels off the ground, or name a watchdog_relay"
    )
    house.chair["drive"]["wheels"]["watchdog_relay"] = "K1 in the motor supply"
    house.load()


@pytest.mark.parametrize("kind", ["simulator", "files"])
def test_where_nothing_real_is_behind_the_drive_there_is_nothing_to_measure(house, kind: str) -> None:
    house.chair["kind"] = kind
    house.chair["drive"]["wheels"] = {"port": "/dev/ttyUSB0"}
    house.load()


@pytest.mark.parametrize(("measured_ms", "fits"), [(250, True), (251, False)])
def test_a_drive_that_stops_later_than_250_ms_after_silence_needs_a_relay(house, measured_ms: int, fits: bool) -> None:
    house.chair["stopping"]["watchdog_ms"] = 251
    house.chair["limits"]["forward_mm_s"] = 300
    house.chair["drive"]["wheels"]["silence_stop_ms"] = measured_ms
    if not fits:
        assert "at most 250 ms are allowed; name a watchdog_relay in its motor supply" in house.refused()
        house.chair["drive"]["wheels"]["watchdog_relay"] = "K1"
    house.load()


def test_a_silence_longer_than_the_proof_of_distances_assumes_is_refused(house) -> None:
    house.chair["drive"]["wheels"]["silence_stop_ms"] = 230
    assert house.refused() == (
        "chairs/test.toml: drive.wheels.silence_stop_ms = 230: more than stopping.watchdog_ms + wire_ms = 204, which "
        "the proof of distances rests on: raise stopping.watchdog_ms to 226"
    )


def test_a_measured_silence_without_its_date_is_refused(house) -> None:
    del house.chair["drive"]["wheels"]["silence_stop_measured"]
    assert "silence_stop_ms and silence_stop_measured belong together" in house.refused()


def test_a_measured_deceleration_below_the_proofs_is_refused(house) -> None:
    house.chair["drive"]["wheels"]["stop_decel_mm_s2"] = 550
    assert "drive.wheels.stop_decel_mm_s2 = 550: less than stopping.decel_mm_s2 = 600" in house.refused()


def test_a_person_cannot_say_that_a_drive_was_measured(house) -> None:
    house.ridden()
    house.person["settings"] = {"wheels": {"silence_stop_ms": 10}}
    assert "people/asha.toml: settings.wheels.silence_stop_ms" in house.refused()


def test_a_stop_device_must_have_a_button_and_be_entitled_to_stop(house) -> None:
    house.chair["lane"]["panel"]["may"] = ["arm"]
    assert house.refused() == "chairs/test.toml: lane.panel.may must name 'stop': the lane is a stop device"
    house.chair["lane"]["panel"] |= {"may": ["stop"], "source": "ears"}
    assert "chairs/test.toml: lane.panel.stop_device = true, but source 'ears' has no button" in house.refused()


# a chair somebody sits in -------------------------------------------------------------------------------------------
def test_a_chair_that_is_right_is_not_refused(house) -> None:
    house.ridden()
    assert house.load().kind == "chair"


def test_a_chair_without_a_named_hardware_stop_is_refused(house) -> None:
    house.ridden()
    house.chair["hardware_stop"] = " "
    assert house.refused().startswith("chairs/test.toml: hardware_stop is missing")


def test_thesis_methods_are_refused_on_a_chair_wherever_they_come_from(house) -> None:
    house.ridden()
    house.chair["settings"] = {"ranger": {"method": "thesis_code"}}
    message = house.refused()
    assert message.startswith("chairs/test.toml: settings.ranger.method = 'thesis_code': thesis methods")
    house.chair["settings"] = {}
    house.chair["choices"] = {"words": {"engine": ["default", "thesis_text"]}}
    house.person["settings"] = {"words": {"engine": "thesis_text"}}
    assert house.refused().startswith("people/asha.toml: settings.words.engine = 'thesis_text': thesis methods")
    house.chair["kind"] = "robot"
    assert house.load().lanes[1].stages[0].settings["engine"] == "thesis_text"


def test_what_a_component_calls_unfit_is_refused_on_a_chair_only(house) -> None:
    house.chair["settings"] = {"words": {"threshold": -4.5}}
    house.load()
    house.ridden()
    assert house.refused() == (
        "chairs/test.toml: settings.words.threshold = -4.5: hears too much: choose more; refused on a chair somebody "
        'sits in (kind = "chair")'
    )


def test_simulated_input_is_refused_on_a_chair(house) -> None:
    house.ridden()
    house.chair["lane"]["front"]["source"] = "sim_eyes"
    assert house.refused().startswith("chairs/test.toml: lane.front.source = 'sim_eyes': is simulated")


def test_recorded_input_is_refused_on_a_chair(house) -> None:
    house.ridden()
    house.chair["settings"] = {"eyes": {"kind": "manifest"}}
    assert house.refused().startswith("chairs/test.toml: settings.eyes.kind = 'manifest': recorded input is refused")


def test_input_that_ends_is_refused_on_a_chair(house) -> None:
    house.ridden()
    house.chair["lane"]["front"]["ends_run"] = True
    assert "chairs/test.toml: lane.front.ends_run = true" in house.refused()


def test_a_simulated_controller_is_refused_on_a_chair(house) -> None:
    house.ridden()
    house.chair["drive"]["wheels"]["port"] = "{run}/pic"
    assert "chairs/test.toml: drive.wheels.port = '{run}/pic'" in house.refused()


def test_a_companion_is_refused_on_a_chair(house) -> None:
    house.ridden()
    house.chair["companion"] = {"pic": {"component": "puppet"}}
    assert "chairs/test.toml: companion.pic.component = 'puppet'" in house.refused()


def test_on_a_chair_set_may_change_only_what_a_person_may(house) -> None:
    assert house.load("ranger.window=11").lanes[0].stages[0].settings["window"] == 11
    house.ridden()
    message = house.refused("ranger.window=11")
    assert message.startswith("--set ranger.window = 11, but only the integrator may set this")
    assert house.load("ranger.minimum=30").lanes[0].stages[0].settings["minimum"] == 30


# lanes --------------------------------------------------------------------------------------------------------------
def test_a_stage_before_what_feeds_it_is_refused_with_what_to_move(house) -> None:
    house.chair["lane"]["front"]["stages"] = ["mapper", "ranger"]
    assert house.refused() == (
        "chairs/test.toml: lane.front: stage 'mapper' needs FloorMap, which 'ranger' gives: move 'ranger' before it"
    )


def test_a_stage_that_nothing_feeds_is_refused_with_who_could(house) -> None:
    house.chair["lane"]["front"]["stages"] = ["mapper"]
    message = house.refused()
    assert "lane.front: stage 'mapper' needs FloorMap, which neither the source 'eyes' nor an earlier stage" in message
    assert "'ranger'" in message
    house.chair["lane"]["front"] |= {"source": "ears", "stages": ["ranger", "mapper"]}
    assert "stage 'ranger' needs StereoFrame" in house.refused()


def test_a_stage_twice_in_a_lane_is_refused(house) -> None:
    house.chair["lane"]["front"]["stages"] = ["ranger", "ranger"]
    assert "chairs/test.toml: lane.front.stages: 'ranger' is named twice" in house.refused()


def test_coverage_without_a_sensor_and_a_sensor_without_coverage_are_refused(house) -> None:
    house.chair["lane"]["voice"]["covers"] = ["behind"]
    assert house.refused().startswith("chairs/test.toml: lane.voice.covers: nothing in this lane gives distances")
    del house.chair["lane"]["voice"]["covers"]
    del house.chair["lane"]["front"]["covers"]
    assert house.refused().startswith("chairs/test.toml: lane.front.covers is missing")


def test_a_chair_that_does_not_look_ahead_is_refused(house) -> None:
    house.chair["lane"]["front"]["covers"] = ["behind"]
    assert house.refused().startswith("chairs/test.toml: no lane with a distance sensor covers 'ahead'")

"""The same program on recorded real pictures and real words, with real bytes to the (simulated) motor controller."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

ROOT = Path(__file__).resolve().parents[2]

pytestmark = [pytest.mark.processes, pytest.mark.needs_shared, pytest.mark.timeout(240)]


def inputs(shared_data: Path) -> list[str]:
    """The recordings, as settings."""
    return [
        *("--set", f"cameras.manifest={shared_data / 'stereo' / 'manifest.csv'}"),
        *("--set", f"microphone.manifest={shared_data / 'voice' / 'manifest.csv'}"),
    ]


@pytest.fixture(scope="module")
def run(command: Callable[..., Any], shared_data: Path) -> Any:
    ended = command("run", "--chair", "files", "--json", "--no-record", *inputs(shared_data), timeout_s=200.0)
    assert ended.code == 0, ended.err[-3000:]
    return ended.json


@pytest.fixture(scope="module")
def long_feet(command: Callable[..., Any], shared_data: Path, tmp_path_factory: pytest.TempPathFactory) -> Any:
    """The robot of the recording turns back 721 mm before its box: a chair whose feet reach 150 mm farther than the
    cameras comes to 571 mm, with "forward" said again and again."""
    chair = tmp_path_factory.mktemp("chair") / "files.toml"
    text = (ROOT / "profiles" / "chairs" / "files.toml").read_text()
    assert "front_mm = 450" in text
    chair.write_text(text.replace("front_mm = 450", "front_mm = 600"))
    ended = command(
        *("run", "--chair", str(chair), "--json", "--no-record", *inputs(shared_data)),
        *("--set", "cameras.kinds=['sequence']", "--set", "cameras.lead_in_s=20"),
        *("--set", "microphone.playlist=['forward']"),
        timeout_s=200.0,
    )
    assert ended.code == 0, ended.err[-3000:]
    return ended.json


def test_real_words_are_heard_and_obeyed(run: Any) -> None:
    assert {"front", "left", "right", "back", "stop"} <= {h["command"] for h in run["commands_heard"]}
    assert {"front", "stop"} <= set(run["commands_obeyed"]), json.dumps(run)[:4000]


def test_distance_seen_is_reported_against_the_truth(run: Any) -> None:
    seen = run["seen_against_truth"]["front/stereo_range"]
    assert seen["stereo_gt"]["with_truth"] >= 10
    assert seen["sequence"]["with_truth"] >= 30
    assert seen["sequence"]["abs_error_median_mm"] is not None


def test_a_robot_that_nobody_has_measured_is_measured_to_40_mm_where_it_is_near(run: Any) -> None:
    sequence = run["seen_against_truth"]["front/stereo_range"]["sequence"]
    assert sequence["measured_near"] >= 15
    assert sequence["near_error_median_mm"] <= 40, json.dumps(sequence)
    assert sequence["near_error_p95_mm"] <= 80, json.dumps(sequence)


def test_the_recording_is_driven_through_and_never_below_600_mm(run: Any) -> None:
    sequence = run["seen_against_truth"]["front/stereo_range"]["sequence"]
    assert sequence["driven_forward"] >= 15, json.dumps(run["seen_against_truth"])
    assert sequence.get("frames_from_600_to_stop", 0) <= 3


def test_the_floor_of_the_recording_tells_the_mount_within_a_second_so_that_both_kinds_of_seeing_see(run: Any) -> None:
    for name, seen in run["seen_against_truth"].items():
        assert seen["sequence"]["blind"] <= 15, name


def test_a_robot_driving_at_a_box_stops_within_three_frames_of_600_mm(long_feet: Any) -> None:
    sequence = long_feet["seen_against_truth"]["front/stereo_range"]["sequence"]
    assert sequence["nearest_seen_mm"] <= 600
    assert sequence["moving_before_600"], json.dumps(long_feet)[:4000]
    assert sequence["frames_from_600_to_stop"] <= 3
    assert any("stop_distance front/stereo_range" in why for s in long_feet["protective_stops"] for why in s["why"])


def test_the_run_ends_with_its_input(run: Any) -> None:
    assert "input of lane 'front' has ended" in run["ended"]

"""The same program on recorded real pictures and real words, with real bytes to the (simulated) motor controller."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

pytestmark = [pytest.mark.processes, pytest.mark.needs_shared, pytest.mark.timeout(240)]


@pytest.fixture(scope="module")
def run(command: Callable[..., Any], shared_data: Path) -> Any:
    ended = command(
        *("run", "--chair", "files", "--json", "--no-record"),
        *("--set", f"cameras.manifest={shared_data / 'stereo' / 'manifest.csv'}"),
        *("--set", f"microphone.manifest={shared_data / 'voice' / 'manifest.csv'}"),
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


def test_a_robot_driving_at_a_box_stops_within_three_frames_of_600_mm(run: Any) -> None:
    sequence = run["seen_against_truth"]["front/stereo_range"]["sequence"]
    assert sequence["moving_before_600"], json.dumps(run["seen_against_truth"])
    assert sequence["frames_from_600_to_stop"] <= 3


def test_the_run_ends_with_its_input(run: Any) -> None:
    assert "input of lane 'front' has ended" in run["ended"]

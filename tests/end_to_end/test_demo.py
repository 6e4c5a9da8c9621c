"""The demo: a chair obeys spoken words and stops by itself in front of things; nothing bypasses the real path."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from chairward.recording import read, read_plan
from chairward.replay import replay

pytestmark = [pytest.mark.processes, pytest.mark.timeout(480)]


@pytest.fixture(scope="module")
def recording(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return tmp_path_factory.mktemp("demo") / "demo.mcap"


@pytest.fixture(scope="module")
def demos(command: Callable[..., Any], recording: Path) -> list[Any]:
    """One minute of it; a second one where the simulated person did not get round the tour in the first.

    What must never happen is asserted of every one, what the demo shows of the last.
    """
    tries: list[Any] = []
    while len(tries) < 2 and not (tries and toured(tries[-1])):
        ended = command("demo", "--headless", "--for", "60s", "--json", "--record", str(recording), timeout_s=200.0)
        assert ended.code == 0, ended.err[-3000:]
        tries.append(ended.json)
    return tries


def toured(demo: Any) -> bool:
    """Whether the person met all that the tour leads to."""
    things = {stop["thing"] for stop in demo["world"]["stopped_before"]}
    return {"person", "cardboard box", "corner wall"} <= things and len(demo["commands_obeyed"]) >= 6


@pytest.fixture(scope="module")
def demo(demos: list[Any]) -> Any:
    """The last of them."""
    return demos[-1]


def story(demo: Any) -> str:
    """For a failure: what happened."""
    return json.dumps({k: v for k, v in demo.items() if k not in ("late_tick_log",)}, indent=1)[:6000]


def test_at_least_six_different_commands_are_heard_and_obeyed(demo: Any) -> None:
    assert len(demo["commands_obeyed"]) >= 6, story(demo)


def test_it_stops_by_itself_before_a_wall_a_box_and_the_person(demo: Any) -> None:
    assert len(demo["protective_stops"]) >= 3, story(demo)
    things = {stop["thing"] for stop in demo["world"]["stopped_before"]}
    assert any("wall" in thing for thing in things), story(demo)
    assert any("box" in thing for thing in things), story(demo)
    assert "person" in things, story(demo)


def test_the_doorway_is_passed_without_a_stop(demo: Any) -> None:
    passed = demo["world"]["doorways_passed"]
    assert passed, story(demo)
    assert passed[0]["stops"] == 0, story(demo)


def test_its_own_motion_never_brings_it_nearer_than_450_mm_and_it_hits_nothing(demos: list[Any]) -> None:
    for demo in demos:
        assert demo["world"]["nearest_ahead_mm"] >= 450, story(demo)
        assert demo["world"]["collisions"] == [], story(demo)


def test_no_cap_is_ever_exceeded(demos: list[Any]) -> None:
    assert all(demo["over_caps"] == 0 for demo in demos)


def test_late_ticks_are_rare_and_each_is_logged(demo: Any) -> None:
    share = 0.03  # the aim is 0.1 %; this is a bound for machines that share their cores
    assert demo["late_ticks"] <= demo["ticks"] * share, story(demo)
    assert len(demo["late_tick_log"]) == demo["late_ticks"]


def test_every_decision_of_it_is_reproduced_from_the_recording(demo: Any, recording: Path) -> None:
    found = replay(recording, read_plan(recording).limits)
    assert demo["missed_records"] == found.missing == 0
    assert found.decisions >= demo["ticks"]
    assert [d.what for d in found.differences] == []


def test_the_recording_holds_the_motor_controllers_answers(demo: Any, recording: Path) -> None:
    assert max(record.facts.drive.speed_mm_s or 0.0 for record in read(recording)) > 300.0

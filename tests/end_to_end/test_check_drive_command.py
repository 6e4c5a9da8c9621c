"""`chairward check drive` on simulated controllers, in processes: it writes what it has measured, or nothing."""

from __future__ import annotations

import json
import subprocess
import sys
import tomllib
from pathlib import Path
from typing import Any

import pytest
import tomlkit

pytestmark = pytest.mark.processes  # in real time

SIM = Path(__file__).resolve().parents[2] / "profiles" / "chairs" / "sim.toml"
SLCAN = {"interface": "slcan", "channel": "{run}/can", "acknowledged": True, "full_backward_mm_s": 500}
FOLLOW = {"takeover": "follow", "hazard_accepted": "two senders, the chair may jerk", "settle_ms": 300}
CONTROLLERS: dict[str, dict[str, Any]] = {
    "pic": {
        "drive": {"pic_serial": {"port": "{run}/pic", "drive_sign": -1}},
        "companion": {"controller": {"component": "sim_pic"}},
        "settings": {},
    },
    "rnet": {
        "drive": {"can": {"dialect": "rnet", **SLCAN, "rnet": FOLLOW}},
        "companion": {"controller": {"component": "sim_can"}},
        "settings": {"sim_can": {"dialect": "rnet"}},
    },
    "cia402": {
        "drive": {"can": {"dialect": "cia402", **SLCAN}},
        "companion": {"controller": {"component": "sim_can"}},
        "settings": {"sim_can": {"dialect": "cia402"}},
    },
}
STEPS = ["connect", "signs", "scale", "controlled stop", "hard stop", "stop on silence", "after silence"]
TRIES = 3
"""A machine that is away for 200 ms while it measures fails a step, as it should."""


@pytest.fixture(params=CONTROLLERS)
def chair(request: pytest.FixtureRequest, tmp_path: Path) -> Path:
    """The simulated chair with that controller and nothing else around it."""
    document = tomlkit.parse(SIM.read_text(encoding="utf-8"))
    for key, value in CONTROLLERS[request.param].items():
        document[key] = value
    del document["choices"]
    document["name"] = "bench"
    path = tmp_path / "chairs" / "bench.toml"
    path.parent.mkdir()
    path.write_text(tomlkit.dumps(document), encoding="utf-8")
    return path


def check(chair: Path, *options: str) -> tuple[int, dict[str, Any]]:
    command = [sys.executable, "-m", "chairward", "check", "drive", "--chair", str(chair), "--json", *options]
    done = subprocess.run(command, capture_output=True, text=True, timeout=100, check=False)
    assert done.stdout, done.stderr
    return done.returncode, json.loads(done.stdout)


def test_check_drive_measures_a_simulated_controller_and_writes_the_chair_file(chair: Path) -> None:
    before = chair.read_text(encoding="utf-8")
    for _ in range(TRIES):
        code, told = check(chair, "--write")
        steps = [step["step"] for step in told["steps"]]
        assert steps == STEPS[: len(steps)]
        assert told["ok"] is (code == 0) is all(step["ok"] for step in told["steps"])
        if told["ok"]:
            break
        assert told["written"] == []
        assert chair.read_text(encoding="utf-8") == before
    else:
        pytest.skip(f"this machine was away too often to measure: {told['steps'][-1]['found']}")
    assert steps == STEPS
    (drive,) = tomllib.loads(chair.read_text(encoding="utf-8"))["drive"].values()
    (was,) = tomllib.loads(before)["drive"].values()
    assert drive["silence_stop_ms"] <= 250
    assert drive["silence_stop_method"] == "pins of the simulated controller"
    assert f"measured {drive['silence_stop_measured']}" in chair.read_text(encoding="utf-8")
    kept = was.keys() - {"drive_sign"}
    assert {key: drive[key] for key in kept} == {key: was[key] for key in kept}
    if "drive_sign" in was:
        assert drive["drive_sign"] == was["drive_sign"] * -1

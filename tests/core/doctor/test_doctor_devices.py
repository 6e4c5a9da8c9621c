"""Each seeded fault of a chair's devices is found and comes with one fix; a healthy chair has none."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any

import pytest
from doctor_faults import FAULTS, everything, inspected
from doctor_world import CHAIR, World, scene

from chairward import profile
from chairward.doctor import advised
from chairward.doctor.examine import site, tasks
from chairward.doctor.place import look


def test_there_are_enough_faults_to_judge_a_doctor_by() -> None:
    assert len(FAULTS) >= 40


@pytest.mark.parametrize("name", FAULTS)
def test_a_seeded_fault_is_found_with_a_fix(name: str, tmp_path: Path) -> None:
    change, check, says = FAULTS[name]
    world = World()
    change(world)
    bad = [f for f in inspected(world, tmp_path, check) if not f.ok]
    assert bad, "nothing was found"
    named = [f for f in bad if f.check in (check, check.split()[0])]
    assert named, bad
    assert any(re.search(says, f"{f.what}: {f.fix}") for f in named), [f.what for f in bad]
    assert all(f.fix or f.check == "profile" for f in named)
    assert all("\n" not in f.what for f in named)


def test_nothing_is_found_on_a_healthy_set_up(tmp_path: Path) -> None:
    found = inspected(World(), tmp_path)
    assert [f for f in found if not f.ok] == []
    assert {"cameras", "calibration", "calibration now", "microphone", "controller"} <= {f.check for f in found}


def test_a_check_that_could_not_look_says_so_and_not_that_nothing_is_wrong(tmp_path: Path) -> None:
    found = {f.check: f for f in inspected(World(calibration_named=False), tmp_path, "calibration")}
    assert not found["calibration now"].tried
    assert "there is no calibration" in found["calibration now"].what
    assert found["cameras"].tried


@pytest.mark.parametrize(
    ("text", "what", "fix"),
    [
        ("there is no profile 'x' in /p: correct the name", "there is no profile 'x' in /p", "correct the name"),
        ("microphone: no sound input: plug one in", "microphone: no sound input", "plug one in"),
        ("left.wav: there is no such file", "left.wav: there is no such file", "do that"),
        ("the probe melted", "the probe melted", "do that"),
    ],
)
def test_a_sentence_that_ends_with_what_to_do_brings_its_own_fix(text: str, what: str, fix: str) -> None:
    assert advised(text, "do that") == (what, fix)


@pytest.mark.parametrize("seed", range(6))
def test_healthy_cameras_are_healthy_whatever_they_look_at(seed: int, tmp_path: Path) -> None:
    world = World(left=scene(0, seed), right=scene(5 + 7 * seed, seed))
    assert [f for f in inspected(world, tmp_path, "cameras") if not f.ok] == []


CAN = {
    "bus missing": ({}, "can0 is not there"),
    "no can interface": ({"type": "1"}, "is no CAN interface"),
    "bus down": ({"type": "280", "operstate": "down"}, "can0 is down"),
    "wrong bit rate": ({"type": "280", "operstate": "up", "can_bittiming/bitrate": "500000"}, "500000 bit/s"),
    "bus off": ({"type": "280", "operstate": "up", "can_state": "BUS-OFF"}, "bus-off"),
}


def can_plan(folder: Path, more: str = 'dialect = "rnet"') -> Any:
    world = World(
        chair=CHAIR.format(at=folder, right="right")
        .replace("[drive.pic_serial]", "[drive.can]")
        .replace(f'port = "{folder}/pic"', f'{more}\ninterface = "socketcan"\nchannel = "can0"')
    )
    world.build(folder)
    return profile.load("box", "me", [], everything(), folder)


@pytest.mark.parametrize("name", [*CAN, "healthy"])
def test_what_the_kernel_says_of_a_can_bus_is_understood(name: str, tmp_path: Path) -> None:
    healthy = {"type": "280", "operstate": "up", "can_bittiming/bitrate": "125000", "can_state": "ERROR-ACTIVE"}
    files, says = CAN.get(name, (healthy, ""))
    plan, registry, root = can_plan(tmp_path), everything(), tmp_path / "root"
    for key, text in files.items():
        file = root / "sys/class/net/can0" / key
        file.parent.mkdir(parents=True, exist_ok=True)
        file.write_text(text)
    task = next(t for t in tasks(registry, plan) if t.check.name == "bus")
    bad = [f for f in look(task, site(task, registry, plan, root, tmp_path)) if not f.ok]
    assert (says in bad[0].what and bad[0].fix) if says else bad == [], bad


@pytest.mark.parametrize(("text", "says"), [(None, "is not there"), ("BO_ what is this", "is no DBC file")])
def test_a_dbc_file_that_cannot_be_used_is_found(text: str | None, says: str, tmp_path: Path) -> None:
    plan, registry = can_plan(tmp_path, 'dialect = "dbc"\ndbc.file = "../chair.dbc"'), everything()
    if text:
        (tmp_path / "chair.dbc").write_text(text)
    task = next(t for t in tasks(registry, plan) if t.check.name == "bus")
    found = look(task, site(task, registry, plan, tmp_path, tmp_path))
    assert any(says in f.what for f in found), found

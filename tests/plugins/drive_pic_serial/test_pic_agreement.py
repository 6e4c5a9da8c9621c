"""The Python model is the firmware: every reply, state, fault and pin equal over random sequences."""

from __future__ import annotations

import random
import shutil
from collections.abc import Iterator
from types import ModuleType

import pytest

from chairward_drive_pic_serial import model, motor
from chairward_drive_pic_serial.agreement import Pair, Step, disagreement, random_step
from chairward_drive_pic_serial.wire import Ask

pytestmark = pytest.mark.needs_gpsim

SEQUENCES = 25
"""Here; benchmarks/hands.py agreement runs 2,000."""


@pytest.fixture
def pair() -> Iterator[Pair]:
    if not (shutil.which("gpsim") and shutil.which("gpasm")):
        pytest.skip("needs gpsim and gpasm: sudo apt-get install gpsim gputils")
    pair = Pair()
    yield pair
    pair.close()


def test_model_and_firmware_agree_over_random_sequences(pair: Pair) -> None:
    for seed in range(SEQUENCES):
        assert disagreement(pair, seed) == ""


def test_the_random_sequences_reach_every_state_and_fault(pair: Pair) -> None:
    states, faults, chance = set(), set(), random.Random(1)
    for _ in range(150):
        states.add(pair.model.registers()[0])
        faults.add(pair.model.registers()[1])
        step = random_step(pair, chance)
        pair.model.set_inputs(stop=step.stop, charger=step.charger, battery=step.battery)
        pair.model.feed(step.data)
        pair.model.advance(4000 + step.ticks * 1000)
    assert states >= {1, 2, 3}
    assert len(faults) >= 4


@pytest.mark.parametrize(
    ("where", "constant", "wrong"),
    [(motor, "DEAD_MS", 19), (model, "TIMEOUT_MS", 196), (motor, "SWITCH_MS", 3), (model, "PARK_MS", 249)],
)
def test_a_model_that_is_off_by_one_millisecond_is_noticed(
    pair: Pair, monkeypatch: pytest.MonkeyPatch, where: ModuleType, constant: str, wrong: int
) -> None:
    monkeypatch.setattr(where, constant, wrong)
    steps = [
        Step(pair.frame(Ask.HELLO, 1, 1)),
        Step(pair.frame(Ask.DRIVE, 0, 0)),
        Step(pair.frame(Ask.DRIVE, 5, 5), ticks=8),
        Step(pair.frame(Ask.DRIVE, -5, -5), ticks=28),
        Step(pair.frame(Ask.DRIVE, 0, 0), ticks=40),
    ]
    seen = [pair.step(step) for step in steps]
    seen += [pair.step(Step(pair.frame(Ask.DRIVE, 0, 0), ticks=130)) for _ in range(2)]
    seen += [pair.step(Step(pair.frame(Ask.DRIVE, 0, 0), ticks=1)) for _ in range(4)]
    seen += [pair.step(Step(ticks=1)) for _ in range(200)]
    assert any(ours != theirs for ours, theirs in seen)

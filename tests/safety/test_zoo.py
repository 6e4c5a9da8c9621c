"""The zoo: whatever a lane's process turns into while the chair drives, the chair is safe, the culprit is named, the
guard's tick is not held up, and the chair drives again once the animal is gone."""

from __future__ import annotations

import time
from collections.abc import Iterator

import pytest
from chairward_zoo import WAYS_TO_FAIL
from rig import MS, Rig, load, running

pytestmark = pytest.mark.processes
LIMIT_NS = 200 * MS
BUSY_MACHINE_NS = 2_000 * MS
"""A safety bound for a machine that shares its cores; the figures are in benchmarks/."""

HARMLESS = {"leak_descriptors", "flood", "scribble"}
"""These may go on driving: they hurt themselves at most, and the pictures that people see."""


@pytest.fixture(scope="module")
def rig(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Rig]:
    """One chair for all animals, one after the other: what one of them does must not outlast it."""
    folder = tmp_path_factory.mktemp("zoo-run")
    with running(load(folder), folder / "run") as rig:
        yield rig


def test_the_zoo_has_at_least_25_animals() -> None:
    assert len(WAYS_TO_FAIL) >= 25


@pytest.mark.timeout(300)
@pytest.mark.parametrize("how", sorted(WAYS_TO_FAIL))
def test_an_animal_beside_a_driving_chair(rig: Rig, how: str) -> None:
    rig.wait(rig.driving, "the chair to drive before the animal turns", 60.0)
    turned_ns = rig.misbehave("front", how)
    try:
        _hold_it_against_the_promises(rig, how, turned_ns)
    finally:
        rig.behave("front")
        if how in ("hang", "spin", "hold_gil", "stop_itself", "close_socket"):
            _end_the_hung(rig)
    rig.wait(rig.driving, f"the chair to drive again after '{how}'", 120.0)


def _hold_it_against_the_promises(rig: Rig, how: str, turned_ns: int) -> None:
    if how in HARMLESS:
        time_over = turned_ns + 1_500 * MS
        rig.wait(lambda: rig.records[-1].facts.now_ns > time_over, "the guard to live through it", 30.0)
    else:
        rig.wait(lambda: rig.first_still_after(turned_ns) is not None, f"a stop because of '{how}'", 10.0)
        still = rig.first_still_after(turned_ns)
        assert still is not None
        assert still.wrote_ns - turned_ns <= LIMIT_NS + BUSY_MACHINE_NS
        rig.wait(lambda: "front" in rig.reasons(turned_ns), "the culprit to be named", 10.0)
    during = [r for r in list(rig.records) if r.facts.now_ns >= turned_ns]
    caps = rig.supervisor.plan.limits.caps
    assert all(abs(r.decision.motion.drive_mm_s) <= caps.forward_mm_s for r in during)
    assert rig.moved_on_silence(turned_ns) == []
    assert max((r.woke_ns - r.due_ns for r in during if r.periodic), default=0) <= BUSY_MACHINE_NS


def _end_the_hung(rig: Rig) -> None:
    """The supervisor ends a lane that does not move for 5 s by itself; here it is ended at once to save time."""
    lane = rig.supervisor.lanes["front"]
    lane.process.kill()
    end = time.monotonic() + 10.0
    while lane.process.poll() is None and time.monotonic() < end:
        time.sleep(0.01)

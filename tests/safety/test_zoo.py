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

SILENT, NO_MESSAGE, OVER = "silent for", "not a valid message", "says more than the guard listens to"
TOLD = {
    "backwards": "must rise",
    "close_socket": "closed the line",
    "command": "may not ask for motion",
    "deep": NO_MESSAGE,
    "eat_memory": "MemoryError",
    "empty": "closed the line",
    "exit": "ended with code 3",
    "flood": OVER,
    "flood_ends": "its input has ended",
    "flood_losses": "was torn out",
    "flood_stops": OVER,
    "flood_supervisor": "floods its line to the supervisor",
    "fork": "ended with code 5",
    "fraction": NO_MESSAGE,
    "frozen": SILENT,
    "future": "in the future",
    "give_descriptors": NO_MESSAGE,
    "half_message": NO_MESSAGE,
    "hang": SILENT,
    "hold_gil": SILENT,
    "huge": NO_MESSAGE,
    "impostor": "no stage 'somebody_else'",
    "infinite": NO_MESSAGE,
    "kill_itself": "killed by SIGKILL",
    "lose": "animal 7 was unplugged",
    "nan": NO_MESSAGE,
    "negative": NO_MESSAGE,
    "oversized": "more than 4096 bytes",
    "past": SILENT,
    "press": "may not press",
    "raise": "the animal bites",
    "random_bytes": NO_MESSAGE,
    "repeat": "must rise",
    "segfault": "killed by SIGSEGV",
    "shout_stop": "'stop' heard",
    "silent": SILENT,
    "spin": SILENT,
    "stop_itself": SILENT,
    "unknown_field": NO_MESSAGE,
    "wall": "100 mm ahead",
    "wrong_type": NO_MESSAGE,
    "wrong_unit": "4 mm ahead",
}
"""How people are told of each, in one line with the name of its lane."""

HARMLESS = {"leak_descriptors", "scribble"}
"""These hurt themselves at most, and the pictures that people see: there is nothing to stop or to name."""

MAY_DRIVE_ON = HARMLESS | {"flood", "flood_supervisor"}
"""Their readings are good: as long as these come in time, they count."""


@pytest.fixture(scope="module")
def rig(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Rig]:
    """One chair for all animals, one after the other: what one of them does must not outlast it."""
    folder = tmp_path_factory.mktemp("zoo-run")
    with running(load(folder), folder / "run") as rig:
        yield rig


def test_the_zoo_has_at_least_25_animals_and_each_that_does_harm_is_to_be_named() -> None:
    assert len(WAYS_TO_FAIL) >= 25
    assert TOLD.keys() | HARMLESS == WAYS_TO_FAIL.keys()


@pytest.mark.timeout(300)
@pytest.mark.parametrize("how", sorted(WAYS_TO_FAIL))
def test_an_animal_beside_a_driving_chair(rig: Rig, how: str) -> None:
    rig.wait(rig.driving, "the chair to drive before the animal turns", 60.0)
    told_before = len(rig.supervisor.events)
    turned_ns = rig.misbehave("front", how)
    try:
        _hold_it_against_the_promises(rig, how, turned_ns)
        if how in TOLD:
            rig.wait(
                lambda: any(
                    "front" in line and TOLD[how] in line for line in rig.reasons(turned_ns, told_before).splitlines()
                ),
                f"'{how}' to be named",
                10.0,
            )
    finally:
        rig.behave("front")
        rig.supervisor.lanes["front"].deaths_in_a_row = 0  # each animal on a day of its own
        if how in ("hang", "spin", "hold_gil", "stop_itself", "close_socket") or how.startswith("flood"):
            _end_its_process(rig)
    rig.wait(rig.driving, f"the chair to drive again after '{how}'", 120.0)


def _hold_it_against_the_promises(rig: Rig, how: str, turned_ns: int) -> None:
    if how in MAY_DRIVE_ON:
        time_over = turned_ns + 1_500 * MS
        rig.wait(lambda: rig.records[-1].facts.now_ns > time_over, "the guard to live through it", 30.0)
    else:
        rig.wait(lambda: rig.first_still_after(turned_ns) is not None, f"a stop because of '{how}'", 10.0)
        still = rig.first_still_after(turned_ns)
        assert still is not None
        assert still.wrote_ns - turned_ns <= LIMIT_NS + BUSY_MACHINE_NS
    during = [r for r in list(rig.records) if r.facts.now_ns >= turned_ns]
    caps = rig.supervisor.plan.limits.caps
    assert all(abs(r.decision.motion.drive_mm_s) <= caps.forward_mm_s for r in during)
    assert rig.moved_on_silence(turned_ns) == []
    assert max((r.woke_ns - r.due_ns for r in during if r.periodic), default=0) <= BUSY_MACHINE_NS


def _end_its_process(rig: Rig) -> None:
    """The supervisor ends a lane that hangs for 5 s by itself (tests/core/test_supervisor.py); here it saves time.

    And a lane that says too much is told of once a process: the next animal needs a new one.
    """
    lane = rig.supervisor.lanes["front"]
    lane.process.kill()
    end = time.monotonic() + 10.0
    while lane.process.poll() is None and time.monotonic() < end:
        time.sleep(0.01)

"""A call for help starts the chosen program: once a call, whatever the chair does, and never in the guard's way."""

from __future__ import annotations

import sys
import time
from pathlib import Path
from typing import Any

import pytest
from msgspec.structs import replace

from chairward import records
from chairward.builtin import chairward_observers
from chairward.components import Context
from chairward.records import Record
from chairward.testing import ObserverContract, ObserverRig
from chairward.testing.observer_contract import ride

WRITES = "import sys; open(sys.argv[1], 'a').write(sys.argv[2] + '\\n')"


class CallHelpRig(ObserverRig):
    """Its program writes a line into a file."""

    component = next(c for c in chairward_observers() if c.name == "call_help")

    def __init__(self, folder: Path, **settings: Any) -> None:
        self.file = folder / "called"
        self.settings = {"command": [sys.executable, "-c", WRITES, str(self.file), "{person} calls"], **settings}
        self.context = Context(lane="help", run_dir=folder, chair_dir=folder, person="asha")

    def close(self) -> None:
        """Nothing is left open."""

    def called(self) -> list[str]:
        return self.file.read_text().splitlines() if self.file.exists() else []


@pytest.fixture
def rig(tmp_path: Path) -> CallHelpRig:
    return CallHelpRig(tmp_path)


class TestCallHelp(ObserverContract):
    """All of the contract."""


def calling(at: set[int]) -> list[bytes]:
    """Two seconds of a ride in which help is called in some ticks."""
    ridden: list[Record] = []
    for record in ride(100):
        decision = replace(record.decision, help=record.tick in at)
        ridden.append(replace(record, decision=decision))
    return [records.encode(record) for record in ridden]


def told(rig: CallHelpRig, at: set[int]) -> list[str]:
    observer = rig.make()
    for data in calling(at):
        observer.observe(data)
    observer.close()
    return rig.called()


def test_a_call_starts_the_program_with_the_persons_name(rig: CallHelpRig) -> None:
    assert told(rig, {50}) == ["asha calls"]


def test_nobody_called_and_nothing_is_started(rig: CallHelpRig) -> None:
    assert told(rig, set()) == []


def test_calls_shortly_after_one_another_are_one(rig: CallHelpRig) -> None:
    assert told(rig, {50, 51, 90}) == ["asha calls"]


def test_a_call_after_the_pause_is_another(tmp_path: Path) -> None:
    assert told(CallHelpRig(tmp_path, again_s=0.5), {10, 90}) == ["asha calls"] * 2


def test_a_program_that_is_not_there_is_named_and_the_run_goes_on(
    tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    assert told(CallHelpRig(tmp_path, command=["no-such-bell"]), {50}) == []
    assert "'no-such-bell' cannot be started" in caplog.text
    assert "call_help.command" in caplog.text


def test_a_program_that_never_ends_holds_nothing_up(tmp_path: Path) -> None:
    observer = CallHelpRig(tmp_path, command=[sys.executable, "-c", "import time; time.sleep(30)"]).make()
    start = time.monotonic()
    for data in calling({1}):
        observer.observe(data)
    assert time.monotonic() - start < 25.0, "it was not waited for"
    observer._running[0].kill()  # type: ignore[attr-defined]
    observer.close()

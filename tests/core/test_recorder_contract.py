"""The recorder keeps every promise of an observer, and leaves nothing half-written behind."""

from __future__ import annotations

from pathlib import Path

import pytest

from chairward.builtin import chairward_observers
from chairward.components import Context
from chairward.recording import read
from chairward.testing import ObserverContract, ObserverRig
from chairward.testing.observer_contract import ride


class RecorderRig(ObserverRig):
    """A recorder in a run's folder of its own."""

    component = next(c for c in chairward_observers() if c.name == "recorder")

    def __init__(self, folder: Path) -> None:
        self.settings = {}
        self.context = Context(lane="recorder", run_dir=folder, chair_dir=folder)

    def close(self) -> None:
        """Nothing is left open."""


class TestRecorder(ObserverContract):
    """All of the contract."""

    @pytest.fixture
    def rig(self, tmp_path: Path) -> RecorderRig:
        return RecorderRig(tmp_path)

    def test_what_it_took_can_be_read_back(self, rig: RecorderRig) -> None:
        self._takes(rig, ride(100))
        ticks = [record.tick for record in read(rig.context.run_dir / "recording.mcap")]
        assert ticks == list(range(100))

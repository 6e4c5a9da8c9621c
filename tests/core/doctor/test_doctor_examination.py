"""The examination in its own processes: every place gets its answer, whatever hangs, raises or dies beside it."""

from __future__ import annotations

from pathlib import Path

import pytest
from doctor_controller import controller
from doctor_faults import everything
from doctor_world import World

from chairward.doctor.examine import examine
from chairward.plugins import discover


@pytest.mark.processes
def test_the_whole_examination_finds_two_faults_at_once_and_each_in_its_place(tmp_path: Path) -> None:
    world = World(frozen="right", charger=True)
    chair = world.build(tmp_path)
    with controller(world, tmp_path):
        found = list(examine(everything(), str(chair), str(tmp_path / "people" / "me.toml")))
    bad = [f for f in found if not f.ok and f.needed]
    assert [f.check for f in bad] == ["cameras", "controller"], bad


@pytest.mark.processes
def test_a_check_that_hangs_raises_or_dies_keeps_no_other_from_its_answer(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "lib").mkdir()
    (tmp_path / "lib" / "chairward_sick.py").write_text(SICK)
    meta = tmp_path / "lib" / "chairward_sick-1.0.dist-info"
    meta.mkdir()
    (meta / "METADATA").write_text("Metadata-Version: 2.1\nName: chairward-sick\nVersion: 1.0\n")
    (meta / "entry_points.txt").write_text("[chairward.plugins]\nsick = chairward_sick\n")
    monkeypatch.setenv("PYTHONPATH", str(tmp_path / "lib"))
    monkeypatch.syspath_prepend(str(tmp_path / "lib"))
    found = {f.check: f for f in examine(discover(), None, None)}
    assert "no answer within 0.5 s" in found["hangs"].what
    assert "ended in the middle" in found["dies"].what
    assert "the probe melted" in found["raises"].what
    assert found["well"].ok
    assert found["disk"].what


SICK = """
import os, time
from chairward.doctor import Check
from chairward.hookspecs import hookimpl
CHAIRWARD_API = 1
def hangs(site): time.sleep(3600)
def dies(site): os._exit(3)
def raises(site): raise OSError("the probe melted")
def well(site): return []
@hookimpl
def chairward_checks():
    return [Check(name=f.__name__, look=f, timeout_s=0.5 if f is hangs else 20.0) for f in (hangs, dies, raises, well)]
"""

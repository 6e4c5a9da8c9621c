"""`sim_home` between run_dir/pins and run_dir/world, in real time, and `chairward sim home`."""

from __future__ import annotations

import json
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest
from typer.testing import CliRunner

from chairward.components import Context
from chairward.plugins import discover
from chairward.shared_state import PIN_NAMES, SharedState
from chairward_simulator import plugin
from chairward_simulator.home import HOME_FILE, load

pytestmark = pytest.mark.processes  # in real time


@contextmanager
def running(run_dir: Path, **settings: object) -> Iterator[SharedState]:
    """sim_home in a thread; its world; stopped and joined at the end."""
    component = discover((), {"simulator": plugin}).get("companion", "sim_home")
    home = component.make(component.settings(**settings), Context(lane="", run_dir=run_dir, chair_dir=run_dir))
    stop, ready = threading.Event(), threading.Event()
    thread = threading.Thread(target=home.run, args=(ready.set, stop.is_set))
    thread.start()
    try:
        assert ready.wait(10.0)
        world = SharedState.attach(run_dir / "world")
        yield world
        world.close()
    finally:
        stop.set()
        thread.join(10.0)
        assert not thread.is_alive()


def until(condition: Callable[[], bool], timeout_s: float = 5.0) -> bool:
    end = time.monotonic() + timeout_s
    while time.monotonic() < end:
        if condition():
            return True
        time.sleep(0.005)
    return False


def keep_pins(pins: SharedState, seconds: float, **values: float) -> None:
    """A living controller: writes its pins again and again."""
    end = time.monotonic() + seconds
    while time.monotonic() < end:
        pins.write(time_ns=time.monotonic_ns(), **values)
        time.sleep(0.005)


def test_pins_move_the_body_and_a_dead_controller_brakes_it(tmp_path) -> None:
    with running(tmp_path, speaks=False) as world:
        pins = SharedState.create(tmp_path / "pins", PIN_NAMES)
        keep_pins(pins, 1.0, drive_duty=0.5, drive_in1=1)
        driving = world.read()
        assert driving["speed_mm_s"] == pytest.approx(350.0, abs=20.0)
        start = load(HOME_FILE).start
        assert driving["x_mm"] > start.x_mm + 50.0
        assert driving["y_mm"] == pytest.approx(start.y_mm)
        assert until(lambda: world.read()["speed_mm_s"] == 0.0, 2.0)  # nobody writes pins any more
        pins.close()
    report = json.loads((tmp_path / "report-world.json").read_text())
    assert report["driven_mm"] > 50
    assert report["collisions"] == []
    assert report["words_said"] == {}


def test_world_is_published_at_least_100_times_a_second(tmp_path) -> None:
    with running(tmp_path, speaks=False) as world:
        stamps = set()
        end = time.monotonic() + 1.0
        while time.monotonic() < end:
            stamps.add(world.read()["time_ns"])
            time.sleep(0.001)
    assert len(stamps) > 60  # 200 on a quiet machine


def test_world_time_keeps_up_with_the_clock(tmp_path) -> None:
    with running(tmp_path, speaks=False):
        time.sleep(1.0)
    report = json.loads((tmp_path / "report-world.json").read_text())
    assert 0.9 < report["seconds"] < 2.0


def test_person_waits_for_the_cameras_then_arms_and_speaks(tmp_path) -> None:
    with running(tmp_path, waits_s=60.0) as world:
        time.sleep(0.6)
        assert world.read()["arm"] == 0
        (tmp_path / "sim_cameras-on").touch()
        assert until(lambda: world.read()["arm"] == 1)
        assert until(lambda: world.read()["utterance_id"] == 1)
        said = world.read()
        assert abs(said["utterance_ns"] - said["time_ns"]) < 1e9
    assert json.loads((tmp_path / "report-world.json").read_text())["words_said"] == {"left": 1}


def test_a_wrong_home_file_is_named_before_anything_starts(tmp_path) -> None:
    from chairward_simulator.home import HomeError

    (tmp_path / "flat.toml").write_text("name = 1")
    component = discover((), {"simulator": plugin}).get("companion", "sim_home")
    home = component.make(component.settings(home="flat.toml"), Context(lane="", run_dir=tmp_path, chair_dir=tmp_path))
    with pytest.raises(HomeError, match=r"flat\.toml: name"):
        home.run(lambda: None, lambda: True)
    assert not (tmp_path / "world").exists()


def test_command_draws_the_home_and_refuses_a_wrong_file(tmp_path) -> None:
    import typer

    from chairward_simulator.commands import home

    app = typer.Typer()
    app.command()(home)
    drawn = CliRunner().invoke(app, ["--picture", str(tmp_path / "home.png")])
    assert drawn.exit_code == 0, drawn.output
    assert "through doorway" in drawn.output
    assert (tmp_path / "home.png").stat().st_size > 50_000
    wrong = CliRunner().invoke(app, [str(tmp_path / "none.toml")])
    assert wrong.exit_code == 2
    assert "none.toml: cannot be read as a home" in wrong.output

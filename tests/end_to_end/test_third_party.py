"""A third party's way: wheels in a clean environment, a new plugin from the first red test to a chair that it stops."""

from __future__ import annotations

import json
import os
import shutil
import struct
import subprocess
import sys
import time
import tomllib
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import pytest

from chairward.shared_state import SharedState
from chairward.testing import PtyDevice

ROOT = Path(__file__).resolve().parents[2]
UV = os.environ.get("UV") or shutil.which("uv") or shutil.which("uv", path=str(ROOT / ".tools" / "bin"))
EXAMPLES = ("ultrasonic_ring", "joystick")
JOYSTICK = struct.Struct("<IhBB")
BUTTON, AXIS, ARM, RESET, FORWARD = 1, 2, 1, 2, 1

pytestmark = [
    pytest.mark.processes,
    pytest.mark.timeout(600),
    pytest.mark.skipif(UV is None, reason="needs uv: start the tests with ./run test"),
]


@dataclass(frozen=True)
class Clean:
    """An environment that knows nothing of this checkout but the wheels installed into it."""

    folder: Path

    @property
    def bin(self) -> Path:
        return self.folder / "venv" / "bin"

    def run(self, *command: str, cwd: Path | None = None, code: int | None = 0) -> subprocess.CompletedProcess[str]:
        """A command in it; its exit code is asserted unless `code` is None."""
        kept = {k: v for k, v in os.environ.items() if k not in ("VIRTUAL_ENV", "PYTHONPATH", "UV_COMPILE_BYTECODE")}
        environment = {**kept, "PATH": f"{self.bin}:{kept.get('PATH', '')}", "COLUMNS": "200"}
        done = subprocess.run(
            command, cwd=cwd or self.folder, env=environment, capture_output=True, text=True, timeout=400, check=False
        )
        assert code is None or done.returncode == code, f"{command}: {done.stdout[-3000:]}{done.stderr[-2000:]}"
        return done

    def install(self, *projects: Path, also: tuple[str, ...] = ()) -> None:
        """Build each project's wheel and install it, with the versions that this workspace pins."""
        dist = self.folder / "dist"
        for project in projects:
            self.run(str(UV), "build", "--quiet", "--wheel", "--out-dir", str(dist), str(project))
        wheels = [str(wheel) for wheel in sorted(dist.glob("*.whl"))]
        pins = self.folder / "pins.txt"
        python = ("--python", str(self.bin / "python"), "--constraint", str(pins))
        self.run(str(UV), "pip", "install", "--quiet", *python, *wheels, *also)


@pytest.fixture(scope="module")
def clean(tmp_path_factory: pytest.TempPathFactory) -> Clean:
    made = Clean(tmp_path_factory.mktemp("clean"))
    workspace = tomllib.loads((ROOT / "pyproject.toml").read_text())
    (made.folder / "pins.txt").write_text("\n".join(workspace["tool"]["uv"]["constraint-dependencies"]))
    made.run(str(UV), "venv", "--quiet", "--python", sys.executable, str(made.folder / "venv"))
    examples = [ROOT / "examples" / name for name in EXAMPLES]
    made.install(
        ROOT / "core", ROOT / "plugins" / "drive_pic_serial", *examples, also=("pytest", "pytest-timeout", "hypothesis")
    )
    return made


@pytest.mark.parametrize("name", EXAMPLES)
def test_the_examples_keep_their_contracts_as_installed_wheels(clean: Clean, name: str, tmp_path: Path) -> None:
    tests = shutil.copytree(ROOT / "examples" / name / "tests", tmp_path / "tests")
    done = clean.run("python", "-m", "pytest", "-q", "-W", "error", str(tests), cwd=tmp_path)
    assert " passed" in done.stdout
    assert "skipped" not in done.stdout


@pytest.fixture(scope="module")
def sonar(clean: Clean, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The author's day: a new plugin, two red contracts, two mends, green, a wheel, installed."""
    place = tmp_path_factory.mktemp("author")
    clean.run("chairward", "new-plugin", "garden_sonar", "--kind", "sensor", "--to", str(place))
    folder = place / "chairward_garden_sonar"
    assert len([path for path in folder.rglob("*") if path.is_file()]) == 4
    code = folder / "src" / "chairward_garden_sonar" / "__init__.py"
    assert len(code.read_text().splitlines()) <= 60
    clean.run(str(UV), "pip", "install", "--quiet", "--python", str(clean.bin / "python"), "-e", str(folder))

    first = clean.run("pytest", "-q", "-x", "-k", "how_far_away", cwd=folder, code=1).stdout
    assert "450 mm ahead did not come" in first
    assert "ahead_mm=45)" in first
    code.write_text(code.read_text().replace("MM_PER_COUNT = 1 ", "MM_PER_COUNT = 10 "))
    second = clean.run("pytest", "-q", "-x", "-k", "how_far_away or cannot_see", cwd=folder, code=1).stdout
    assert "a sensor that cannot tell must say so: 'cannot see' is not 'clear'" in second
    code.write_text(code.read_text().replace('CANNOT_TELL = b""', 'CANNOT_TELL = b"----"'))
    clean.run("pytest", "-q", "-k", "how_far_away or cannot_see", cwd=folder)  # all of them: when it is graded
    clean.run(str(UV), "pip", "uninstall", "--quiet", "--python", str(clean.bin / "python"), "chairward-garden-sonar")
    clean.install(folder)
    return folder


def test_a_new_plugin_is_listed_and_graded(clean: Clean, sonar: Path) -> None:
    listed = json.loads(clean.run("chairward", "plugins", "--json").stdout)
    assert "garden_sonar" in [component["name"] for component in listed["components"]]
    graded = json.loads(clean.run("chairward", "plugins", "grade", "garden_sonar", "--json", cwd=sonar).stdout)
    kept = {rule["says"]: rule["kept"] for rule in graded["rules"]}
    assert kept["garden_sonar: SensorContract passes"] is True
    assert graded["grade"] in ("silver", "gold"), graded


CHAIR = """
name = "garden"
kind = "simulator"
person = "gardener"
[footprint]
front_mm = 450
rear_mm = 450
half_width_mm = 300
[limits]
forward_mm_s = 300
[stopping]
decel_mm_s2 = 900
slope_percent = 0
tick_ms = 20
wire_ms = 4
watchdog_ms = 200
sensing_ms = 60
closing_mm_s = 0
sensor_range_mm = 5000
[lane.front]
source = "garden_sonar"
freshness_ms = 400
covers = ["ahead"]
settings.garden_sonar = { port = "PLACE/sonar" }
[lane.hand]
source = "joystick"
freshness_ms = 400
stop_device = true
may = ["stop", "arm", "reset"]
settings.joystick = { device = "PLACE/js0" }
[drive.pic_serial]
port = "{run}/pic"
full_speed_mm_s = 500
full_turn_deg_s = 45
[companion.pic]
component = "sim_pic"
"""

PERSON = """
name = "gardener"
chair = ["garden"]
drive = "pic_serial"
language = "en"
"""


class Hand:
    """The person's hand on the joystick, played through a named pipe."""

    def __init__(self, path: Path) -> None:
        os.mkfifo(path)
        self.fd = os.open(path, os.O_RDWR | os.O_NONBLOCK)

    def press(self, button: int) -> None:
        for value in (1, 0):
            os.write(self.fd, JOYSTICK.pack(0, value, BUTTON, button))

    def push(self, forward: float) -> None:
        os.write(self.fd, JOYSTICK.pack(0, int(-32767 * forward), AXIS, FORWARD))


@pytest.fixture
def garden(tmp_path: Path) -> Iterator[tuple[PtyDevice, Hand, dict[str, bytes]]]:
    """The sonar's board, the hand, and what the board says."""
    figure = {"": b"0300"}
    board = PtyDevice(tmp_path / "sonar", lambda: b"D%s\n" % figure[""])
    hand = Hand(tmp_path / "js0")
    yield board, hand, figure
    board.close()
    os.close(hand.fd)


def until(wanted: Any, what: str, again: Any = None, within_s: float = 90.0) -> None:
    """Wait for a fact, doing `again` now and then as a patient person would."""
    end = time.monotonic() + within_s
    while not wanted():
        assert time.monotonic() < end, f"{what}: not within {within_s:.0f} s"
        if again is not None:
            again()
        time.sleep(0.3)


def test_its_veto_stops_a_chair_driven_by_hand(
    clean: Clean, sonar: Path, garden: tuple[PtyDevice, Hand, dict[str, bytes]], tmp_path: Path
) -> None:
    _board, hand, figure = garden
    for folder, name, text in (("chairs", "garden", CHAIR), ("people", "gardener", PERSON)):
        (tmp_path / "profiles" / folder).mkdir(parents=True)
        (tmp_path / "profiles" / folder / f"{name}.toml").write_text(text.replace("PLACE", str(tmp_path)))
    chair = tmp_path / "profiles" / "chairs" / "garden.toml"
    kept = {k: v for k, v in os.environ.items() if k not in ("VIRTUAL_ENV", "PYTHONPATH")}
    run = subprocess.Popen(
        [str(clean.bin / "chairward"), "run", "--chair", str(chair), "--headless", "--for", "120s", "--json"],
        cwd=tmp_path,
        env={**kept, "TMPDIR": str(tmp_path), "PATH": f"{clean.bin}:{kept.get('PATH', '')}"},
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    )
    try:
        until(lambda: run.poll() is not None or list(tmp_path.glob("chairward-*/pins")), "the controller's pins")
        assert run.poll() is None, run.communicate()[1]
        pins = SharedState.attach(next(tmp_path.glob("chairward-*/pins")))

        def driving() -> bool:
            return pins.read()["drive_duty"] > 0.1 and pins.read()["drive_in1"] == 1.0

        def set_off() -> None:
            hand.push(0.0)
            hand.press(RESET)
            hand.press(ARM)
            time.sleep(0.3)
            hand.push(1.0)
            time.sleep(0.5)

        until(driving, "driving by hand", again=set_off)
        figure[""] = b"0050"  # something stands 50 cm ahead; the hand still pushes
        until(lambda: not driving(), "the stop", within_s=10.0)
        time.sleep(1.0)
        assert not driving(), "the stick is still pushed, the thing still there"
    finally:
        run.send_signal(2)
        out, err = run.communicate(timeout=60)
    summary = json.loads(out)
    assert any("garden_sonar" in json.dumps(stop) for stop in summary["protective_stops"]), (summary, err)

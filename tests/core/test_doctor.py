"""The doctor's seeded faults: each is put in place for real, found, and comes with one fix; a healthy set-up has none.

Cameras are video files that OpenCV opens like cameras, microphones are sound files, controllers are ptys with the
checked model of the firmware (or something else) at their far end, and the kernel's view is a folder.
"""

from __future__ import annotations

import fcntl
import json
import os
import re
import select
import threading
import tty
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from datetime import date
from functools import cache
from importlib.metadata import EntryPoint, PathDistribution
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest
import soundfile
from numpy.typing import NDArray

from chairward import profile
from chairward.doctor import machine
from chairward.doctor.check import Finding, Site
from chairward.doctor.examine import Task, examine, site, tasks
from chairward.doctor.place import look
from chairward.plugins import PluginError, Registry, discover

Picture = NDArray[np.uint8]
RATE = 16_000


# ---- the world: a chair's devices, healthy until told otherwise ---------------------------------------------------


def scene(shift: int = 0, seed: int = 7) -> Picture:
    """320 x 240 of sharp-edged things; shift: columns that everything has moved to the left."""
    chance, canvas = np.random.default_rng(seed), np.full((240, 480, 3), 120, np.uint8)
    for _ in range(170):
        x, y = int(chance.integers(0, 470)), int(chance.integers(0, 235))
        w, h = (int(v) for v in chance.integers(5, 45, 2))
        colour = tuple(int(v) for v in chance.integers(20, 235, 3))
        cv2.rectangle(canvas, (x, y), (x + w, y + h), colour, -1)
    return canvas[:, 80 + shift : 400 + shift]


@dataclass
class World:
    """What stands where; a fault changes it before it is built."""

    left: Picture = field(default_factory=lambda: scene(0))
    right: Picture = field(default_factory=lambda: scene(12))
    frozen: str = ""
    pictures: int = 75
    missing: str = ""
    broken: str = ""
    same: bool = False
    sound: NDArray[np.float32] = field(
        default_factory=lambda: np.random.default_rng(3).normal(0, 0.002, 2 * RATE).astype(np.float32)
    )
    no_sound: bool = False
    calibration: dict[str, Any] | None = field(default_factory=lambda: calibration())
    calibration_text: str = ""
    calibration_named: bool = True
    chair: str = ""
    pic: str = "model"
    stop_input: bool = False
    charger: bool = False
    battery: int = 214

    def build(self, folder: Path) -> Path:
        """The files, and the chair file that names them."""
        for side, picture in (("left", self.left), ("right", self.right)):
            if side not in self.missing:
                self._video(folder / f"{side}.y4m", picture, frozen=side == self.frozen)
        if self.broken:
            (folder / f"{self.broken}.y4m").write_bytes(b"not a video")
        if not self.no_sound:
            soundfile.write(folder / "room.wav", self.sound, RATE, subtype="PCM_16")
        if self.calibration_text or self.calibration:
            text = self.calibration_text or json.dumps(self.calibration)
            (folder / "stereo.json").write_text(text)
        (folder / "chairs").mkdir()
        (folder / "people").mkdir()
        path = folder / "chairs" / "box.toml"
        path.write_text(self.chair or CHAIR.format(at=folder, right="left" if self.same else "right"))
        if not self.calibration_named:
            path.write_text(path.read_text().replace("calibration =", "# calibration ="))
        (folder / "people" / "me.toml").write_text(PERSON)
        return path

    def _video(self, path: Path, picture: Picture, *, frozen: bool) -> None:
        """Uncompressed video, so that a picture that is repeated is the same to the last bit."""
        height, width = picture.shape[:2]
        chance = np.random.default_rng(5)
        noise = chance.normal(0, 2, picture.shape)
        with path.open("wb") as file:
            file.write(f"YUV4MPEG2 W{width} H{height} F30:1 Ip A1:1 C420jpeg\n".encode())
            for _ in range(self.pictures):
                noise = noise if frozen else np.roll(noise, 1, axis=0)
                seen = np.clip(picture + noise, 0, 255).astype(np.uint8)
                file.write(b"FRAME\n" + cv2.cvtColor(seen, cv2.COLOR_BGR2YUV_I420).tobytes())


CHAIR = """
name = "box"
kind = "files"
person = "me"
[footprint]
front_mm = 300
rear_mm = 300
half_width_mm = 200
[lane.front]
source = "cameras"
stages = ["stereo_range"]
covers = ["ahead"]
pose = {{ x_mm = 300, z_mm = 400 }}
[lane.voice]
source = "microphone"
stages = ["voice_dtw"]
freshness_ms = 400
[lane.keys]
source = "keys"
stop_device = true
may = ["stop", "arm", "reset"]
freshness_ms = 400
[drive.pic_serial]
port = "{at}/pic"
[settings.cameras]
left = "{at}/left.y4m"
right = "{at}/{right}.y4m"
[settings.stereo_range]
calibration = "{at}/stereo.json"
[settings.microphone]
kind = "files"
files = ["{at}/room.wav"]
paced = false
"""

PERSON = """
name = "me"
chair = "box"
[words]
go = "front"
stop = "stop"
"""


def calibration(**changes: Any) -> dict[str, Any]:
    """Of the rig that `scene` is seen by: parallel, 50 mm apart, undistorted."""
    camera = {
        "matrix": [[300.0, 0.0, 159.5], [0.0, 300.0, 119.5], [0.0, 0.0, 1.0]],
        "distortion": [0.0, 0.0, 0.0, 0.0, 0.0],
        "rms_px": 0.2,
    }
    whole = {
        "format": "chairward-stereo-calibration",
        "version": 1,
        "made": date.today().isoformat(),
        "image_width_px": 320,
        "image_height_px": 240,
        "board": "9x6",
        "square_mm": 25.0,
        "left": camera,
        "right": camera,
        "rotation": [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]],
        "translation_mm": [-50.0, 0.0, 0.0],
        "rms_stereo_px": 0.3,
        "epipolar_mean_px": 0.2,
        "epipolar_p95_px": 0.5,
        "views_used": ["1"],
        "views_dropped": {},
    }
    return {**whole, **changes}


@contextmanager
def controller(world: World, folder: Path) -> Iterator[None]:
    """What is at the far end of the serial line."""
    if world.pic == "missing":
        yield
        return
    from chairward_drive_pic_serial.engine import ModelEngine

    ours, theirs = os.openpty()
    tty.setraw(theirs)
    os.set_blocking(ours, False)
    (folder / "pic").symlink_to(os.ttyname(theirs))
    engine = ModelEngine(battery=world.battery)
    engine.set_inputs(stop=world.stop_input, charger=world.charger)
    over = threading.Event()

    def answer(data: bytes) -> bytes:
        if world.pic == "silent":
            return b""
        if world.pic == "garbage":  # what a line at another speed amounts to
            return bytes(b | 0x81 for b in data)
        if world.pic == "other":
            from chairward_drive_pic_serial import wire

            return wire.encode(b"OK ready") if data else b""
        engine.feed(data)
        engine.advance(20_000)
        said = engine.take()
        return _newer(said) if world.pic == "newer" else said

    def work() -> None:
        while not over.is_set():
            readable, _, _ = select.select([ours], [], [], 0.01)
            data = os.read(ours, 4096) if readable else b""
            if world.pic != "model" or data:
                reply = answer(data) if data else b""
            else:
                engine.advance(10_000)
                reply = engine.take()
            if reply:
                os.write(ours, reply)

    thread = threading.Thread(target=work)
    thread.start()
    taken = os.open(folder / "pic", os.O_RDWR | os.O_NOCTTY) if world.pic == "taken" else -1
    try:
        if taken >= 0:
            fcntl.flock(taken, fcntl.LOCK_EX)
        yield
    finally:
        over.set()
        thread.join()
        for fd in (ours, theirs, *([taken] if taken >= 0 else [])):
            os.close(fd)


def _newer(said: bytes) -> bytes:
    """The same answers from a firmware of a later protocol."""
    from chairward_drive_pic_serial import wire

    out = b""
    for frame in said.split(b"\0"):
        payload = wire.payload(frame) if frame else None
        if payload is not None and payload[0] == wire.Reply.HELLO:
            payload = payload[:2] + bytes([wire.PROTOCOL + 1]) + payload[3:]
        if payload is not None:
            out += wire.encode(payload)
    return out


# ---- the faults ----------------------------------------------------------------------------------------------------

Change = Callable[[World], None]


def to(**changes: Any) -> Change:
    def change(world: World) -> None:
        for key, value in changes.items():
            setattr(world, key, value)

    return change


def cal(**changes: Any) -> Change:
    return to(calibration=calibration(**changes))


def dark(side: str, by: float) -> Change:
    def change(world: World) -> None:
        setattr(world, side, np.clip(getattr(world, side) * by, 0, 255).astype(np.uint8))

    return change


def white(world: World) -> None:
    world.left = np.clip(world.left.astype(int) + 220, 0, 255).astype(np.uint8)


def soft(side: str) -> Change:
    def change(world: World) -> None:
        setattr(world, side, np.asarray(cv2.GaussianBlur(getattr(world, side), (0, 0), 5), np.uint8))

    return change


def swap(world: World) -> None:
    world.left, world.right = world.right, world.left


def tilt(world: World) -> None:
    world.right = np.roll(world.right, 9, axis=0)


def moved(world: World) -> None:
    """A camera that has moved by a hair since: too little to be seen, enough to spoil distances."""
    world.right = np.roll(world.right, 2, axis=0)


def hum(level: float) -> NDArray[np.float32]:
    return np.random.default_rng(3).normal(0, level, 2 * RATE).astype(np.float32)


FAULTS: dict[str, tuple[Change, str, str]] = {
    # fault: (what is changed, which check finds it, what it says)
    "left camera missing": (to(missing="left"), "cameras", "left camera .* is not there"),
    "right camera missing": (to(missing="right"), "cameras", "right camera .* is not there"),
    "both the same": (to(same=True), "cameras", "are the same camera"),
    "no camera at all": (to(broken="left"), "cameras", "left camera .* cannot be opened"),
    "loose cable": (to(pictures=5), "cameras", "gave 5 pictures and then none"),
    "wrong size": (to(left=np.asarray(cv2.resize(scene(0), (640, 480)))), "cameras", "gives 640x480 pictures"),
    "left frozen": (to(frozen="left"), "cameras", "left camera is frozen"),
    "right frozen": (to(frozen="right"), "cameras", "right camera is frozen"),
    "left dark": (dark("left", 0.1), "cameras", "left camera sees nothing but dark"),
    "right covered": (dark("right", 0.0), "cameras", "right camera sees nothing but dark"),
    "blinded by light": (white, "cameras", "left camera sees nothing but white"),
    "left out of focus": (soft("left"), "cameras", "left camera is out of focus"),
    "right out of focus": (soft("right"), "cameras", "right camera is out of focus"),
    "unequal exposure": (dark("right", 0.6), "cameras", "left camera is 1.[0-9] times as bright"),
    "swapped": (swap, "cameras", "swapped"),
    "tilted": (tilt, "cameras", "sits higher or is tilted"),
    "looking elsewhere": (to(right=scene(0, seed=99)), "cameras", "do not look at the same scene"),
    "no calibration": (to(calibration_named=False), "calibration", "there is no calibration"),
    "calibration lost": (to(calibration=None), "calibration", "stereo.json.*make it with"),
    "calibration spoilt": (to(calibration_text='{"format": "x"}'), "calibration", "no calibration of version 1"),
    "calibration of a later version": (cal(version=2), "calibration", "no calibration of version 1"),
    "calibration of another size": (cal(image_width_px=640, image_height_px=480), "calibration", "made for 640x480"),
    "calibration old": (cal(made="2024-01-01"), "calibration", "days old"),
    "calibration poor": (cal(epipolar_mean_px=2.5), "calibration", "rows differ by 2.5 px"),
    "calibration of swapped cameras": (cal(translation_mm=[50.0, 0.0, 0.0]), "calibration", "stands left of"),
    "calibration with wrong squares": (cal(translation_mm=[-0.05, 0.0, 0.0]), "calibration", "which cannot be"),
    "camera moved since": (moved, "calibration now", "a camera has moved since"),
    "no sound file": (to(no_sound=True), "microphone", "no such sound file"),
    "muted": (to(sound=np.zeros(2 * RATE, np.float32)), "microphone", "it is muted"),
    "clipping": (to(sound=np.clip(hum(2.0), -1, 1)), "microphone", "it clips"),
    "noisy": (to(sound=hum(0.03)), "microphone", "it is noisy"),
    "faulty sound card": (to(sound=hum(0.002) + np.float32(0.2)), "microphone", "its sound is shifted"),
    "no controller": (to(pic="missing"), "controller", "there is no such port"),
    "controller off": (to(pic="silent"), "controller", "nobody answers"),
    "port taken": (to(pic="taken"), "controller", "already in use by another program"),
    "wrong speed": (to(pic="garbage"), "controller", "cannot be understood"),
    "another device": (to(pic="other"), "controller", "speaks another protocol"),
    "other firmware": (to(pic="newer"), "controller", "speaks protocol 2"),
    "stop input open": (to(stop_input=True), "controller", "stop input is open"),
    "charger connected": (to(charger=True), "controller", "a charger is connected"),
    "battery empty": (to(battery=184), "controller", "its battery is at"),
    "profile wrong": (to(chair='name = "box"\nkind = "boat"\n'), "profile", "kind"),
}


PLACES = {"microphone": "voice", "controller": "drive"}


@cache
def everything() -> Registry:
    """All that is installed."""
    return discover()


def inspected(world: World, folder: Path, check: str = "") -> list[Finding]:
    """All findings about a world, or at the place where one check looks; the checks themselves, in this process."""
    world.build(folder)
    registry, place = everything(), PLACES.get(check, "front")
    try:
        plan = profile.load("box", "me", [], registry, folder)
    except (ValueError, PluginError) as error:
        return [Finding("profile", False, str(error))]
    with controller(world, folder):
        found = []
        for task in tasks(registry, plan):
            if task.check.component and (not check or task.place == place):
                found += patiently(world, task, site(task, registry, plan, Path("/"), folder / "run"))
        return found


def patiently(world: World, task: Task, where: Site) -> list[Finding]:
    """What one check says. The file that plays a camera is over in a moment: who comes late finds its end, and looks
    again, unless that end is the fault itself."""
    for _ in range(8):
        found = list(look(task, where))
        if world.pictures < World.pictures or not any("gives no more pictures" in f.what for f in found):
            break
    return found


def test_there_are_enough_faults_to_judge_a_doctor_by() -> None:
    assert len(FAULTS) + len(MACHINE) >= 40


@pytest.mark.parametrize("name", FAULTS)
def test_a_seeded_fault_is_found_with_a_fix(name: str, tmp_path: Path) -> None:
    change, check, says = FAULTS[name]
    world = World()
    change(world)
    bad = [f for f in inspected(world, tmp_path, check) if not f.ok]
    assert bad, "nothing was found"
    named = [f for f in bad if f.check in (check, check.split()[0])]
    assert named, bad
    assert any(re.search(says, f.what) for f in named), [f.what for f in bad]
    assert all(f.fix or f.check == "profile" for f in named)
    assert all("\n" not in f.what for f in named)


def test_nothing_is_found_on_a_healthy_set_up(tmp_path: Path) -> None:
    found = inspected(World(), tmp_path)
    assert [f for f in found if not f.ok] == []
    assert {"cameras", "calibration", "calibration now", "microphone", "controller"} <= {f.check for f in found}


@pytest.mark.parametrize("seed", range(6))
def test_healthy_cameras_are_healthy_whatever_they_look_at(seed: int, tmp_path: Path) -> None:
    world = World(left=scene(0, seed), right=scene(5 + 7 * seed, seed))
    assert [f for f in inspected(world, tmp_path, "cameras") if not f.ok] == []


# ---- the machine ---------------------------------------------------------------------------------------------------


def kernel(folder: Path, **files: str) -> Site:
    for name, text in files.items():
        path = folder / name.replace("__", "/")
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(text)
    return Site(registry=discover([]), root=folder)


def dist(folder: Path, name: str, requires: str) -> PathDistribution:
    at = folder / f"{name}-1.0.dist-info"
    at.mkdir()
    (at / "METADATA").write_text(f"Metadata-Version: 2.1\nName: {name}\nVersion: 1.0\nRequires-Dist: {requires}\n")
    (at / "entry_points.txt").write_text(f"[chairward.plugins]\n{name} = {name}\n")
    return PathDistribution(at)


class OldPlugin:
    """Written for an API that is no more."""

    CHAIRWARD_API = 0


MACHINE: dict[str, tuple[Callable[[Path], Any], str]] = {
    "old python": (lambda _: machine.python((3, 9), "linux"), "Python 3.9"),
    "not linux": (lambda _: machine.python((3, 11), "darwin"), "darwin"),
    "plugin that cannot be imported": (
        lambda _: machine.plugins(discover([EntryPoint("sonar", "no_such_module_at_all", "chairward.plugins")])),
        "'sonar' cannot be imported",
    ),
    "plugin for another api": (
        lambda _: machine.plugins(discover([], {"old": OldPlugin()})),
        "'old' was written for API 0",
    ),
    "plugin without what it needs": (
        lambda folder: machine.packages([dist(folder, "sonar", "no-such-package>=2")]),
        "needs no-such-package, which is not installed",
    ),
    "no real time": (lambda _: machine.realtime(False, -1), "may not use SCHED_FIFO"),
    "no locked memory": (lambda _: machine.realtime(True, 65536), "may lock only 64 kB"),
    "power saving": (
        lambda folder: machine.processor(
            kernel(folder, sys__devices__system__cpu__cpu0__cpufreq__scaling_governor="powersave\n")
        ),
        "governor is 'powersave'",
    ),
    "one core": (
        lambda folder: machine.processor(kernel(folder, sys__devices__system__cpu__online="0\n")),
        "one core",
    ),
    "disk full": (lambda folder: machine.disk(folder, 1_000_000), "1 MB free"),
    "recordings cannot be kept": (
        lambda folder: machine.disk((kernel(folder, blocked="") and folder / "blocked") / "recordings", 10**10),
        "blocked is no folder",
    ),
    "clock never set": (lambda _: machine.clock(date(1970, 1, 2)), "1970-01-02"),
    "device path wrong": (lambda folder: [machine.device("keys.device", folder / "kbd")], "kbd is not there"),
    "reaction never measured": (lambda _: machine.measured({}, date(2026, 1, 1)), "never measured"),
    "reaction measured long ago": (
        lambda _: machine.measured({"reaction_measured": date(2020, 1, 1)}, date(2026, 1, 1)),
        "2192 days ago",
    ),
}


@pytest.mark.parametrize("name", MACHINE)
def test_what_is_wrong_with_the_machine_is_found_with_a_fix(name: str, tmp_path: Path) -> None:
    make, says = MACHINE[name]
    bad = [f for f in make(tmp_path) if not f.ok]
    assert [f for f in bad if says in f.what], bad
    assert all(f.fix for f in bad)


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
    kernel(root, **{f"sys/class/net/can0/{key}": value for key, value in files.items()})
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


# ---- the examination -----------------------------------------------------------------------------------------------


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

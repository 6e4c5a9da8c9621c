"""The seeded faults of a chair's devices, and how the doctor is shown them."""

from __future__ import annotations

import ctypes
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from functools import cache, partial
from pathlib import Path
from typing import Any

import cv2
import numpy as np
from doctor_controller import controller
from doctor_world import RATE, World, calibration, scene
from numpy.typing import NDArray

from chairward import profile
from chairward.doctor.examine import Task, site, tasks
from chairward.doctor.place import look
from chairward.findings import Finding, Site
from chairward.plugins import PluginError, Registry, discover

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
    "camera may not be opened": (to(locked="left.y4m"), "cameras", "left camera .* may not be opened"),
    "port may not be opened": (to(locked="pic"), "controller", "permission denied"),
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
        if world.locked:
            (folder / world.locked).chmod(0)
        found = []
        for task in tasks(registry, plan):
            if task.check.component and (not check or task.place == place):
                where = site(task, registry, plan, Path("/"), folder / "run")
                found += as_a_user(partial(patiently, world, task, where))
        return found


def as_a_user(work: Callable[[], list[Finding]]) -> list[Finding]:
    """Do it with the rights of a user, whoever runs the tests: to root every file is open."""
    with ThreadPoolExecutor(1, initializer=drop_capabilities) as thread:
        return thread.submit(work).result()


def drop_capabilities() -> None:
    """Give up all of them, for this thread alone and for ever (capset(2): a header of version 3, three empty sets)."""
    header, none = (ctypes.c_uint32 * 2)(0x20080522, 0), (ctypes.c_uint32 * 6)()
    if ctypes.CDLL(None, use_errno=True).capset(header, none):
        raise OSError(ctypes.get_errno(), "capset")


def patiently(world: World, task: Task, where: Site) -> list[Finding]:
    """What one check says. The file that plays a camera is over in a moment: who comes late finds its end, and looks
    again, unless that end is the fault itself."""
    for _ in range(8):
        found = list(look(task, where))
        if world.pictures < World.pictures or not any("gives no more pictures" in f.what for f in found):
            break
    return found

"""A chair's devices, healthy until told otherwise: cameras are video files that OpenCV opens like cameras, microphones
are sound files, controllers are ptys (`doctor_controller`)."""

from __future__ import annotations

import json
from dataclasses import dataclass, field
from datetime import date
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import soundfile
from numpy.typing import NDArray

Picture = NDArray[np.uint8]
RATE = 16_000


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
    """What stands where; a fault changes it before it is built. locked: what nobody may open."""

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
    locked: str = ""

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

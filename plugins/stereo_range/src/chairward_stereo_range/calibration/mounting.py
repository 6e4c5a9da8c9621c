"""`calibrate mount`: height, pitch and roll of the cameras from the floor that they see, into the chair file."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np
import tomlkit

from chairward.components import DeviceLost, EndOfInput, Pose
from chairward.stages import Floats, StereoFrame, StereoGeometry
from chairward_stereo_range.calibration.camera_pair import CameraPair
from chairward_stereo_range.calibration_file import CalibrationError, Rectifier, load
from chairward_stereo_range.geometry import scaled, working_size
from chairward_stereo_range.matching import whole_frame_disparity
from chairward_stereo_range.mount import Mount, estimate_mount
from chairward_stereo_range.opencv import opencv

HEIGHT_PX = 240
READ_S = 1.0
MAX_SILENT = 10
LEAST_SHARE = 0.25
"""Of the measured pixels in the lower half that must lie on the floor: less, and it may be a table top."""


@dataclass(frozen=True, slots=True)
class Measured:
    """The mount of all pictures together; spread: between two halves of them, mm and degrees."""

    mount: Mount
    pictures: int
    spread_z_mm: float
    spread_pitch_deg: float

    def as_json(self) -> dict[str, Any]:
        """The figures as the command prints them."""
        return {
            "z_mm": round(self.mount.z_mm, 1),
            "pitch_deg": round(self.mount.pitch_deg, 2),
            "roll_deg": round(self.mount.roll_deg, 2),
            "floor_share": round(self.mount.share, 2),
            "pictures": self.pictures,
            "spread_z_mm": round(self.spread_z_mm, 1),
            "spread_pitch_deg": round(self.spread_pitch_deg, 2),
        }


def measure(pair: CameraPair, pictures: int) -> Measured:
    """Look at so many pairs of a source. Raises CalibrationError, naming what is missing."""
    maps, geometry = _disparities(pair, pictures)
    found = estimate_mount(maps, geometry)
    if found is None or found.share < LEAST_SHARE:
        raise CalibrationError(
            "no floor was found: let the cameras look at free, textured floor (a patterned rug will do) in good light"
        )
    halves = [half for half in (estimate_mount(maps[i::2], geometry) for i in (0, 1) if maps[i::2]) if half is not None]
    z, pitch = [h.z_mm for h in halves] or [found.z_mm], [h.pitch_deg for h in halves] or [found.pitch_deg]
    return Measured(found, len(maps), float(np.ptp(z)), float(np.ptp(pitch)))


def _disparities(pair: CameraPair, pictures: int) -> tuple[list[Floats], StereoGeometry]:
    cv2 = opencv()
    maps: list[Floats] = []
    geometry: StereoGeometry | None = None
    rectify: Rectifier | None = None
    silent = 0
    with TemporaryDirectory() as folder:
        source = pair.make(Path(folder))
        try:
            source.open()
            while len(maps) < pictures and silent < MAX_SILENT:
                frame = source.read(READ_S)
                silent = 0 if frame is not None else silent + 1
                if not isinstance(frame, StereoFrame):
                    continue
                size = working_size(frame.left.shape[1], frame.left.shape[0], HEIGHT_PX)
                if frame.geometry is not None:
                    geometry = scaled(frame.geometry, *size)
                    both = [
                        np.asarray(cv2.resize(p, size, interpolation=cv2.INTER_AREA)) for p in (frame.left, frame.right)
                    ]
                else:
                    rectify = rectify or _rectifier(pair, size)
                    geometry, both = rectify.geometry, list(rectify(frame.left, frame.right))
                maps.append(whole_frame_disparity(both[0], both[1], geometry))
        except EndOfInput:
            pass  # a recording: what it has given is what there is
        except DeviceLost as error:
            raise CalibrationError(str(error)) from error
        finally:
            source.close()
    if geometry is None:
        raise CalibrationError("the source gave no pictures: check the cameras")
    return maps, geometry


def _rectifier(pair: CameraPair, size: tuple[int, int]) -> Rectifier:
    if pair.calibration is None:
        raise CalibrationError(
            f"{pair.chair_file}: settings.stereo_range.calibration is not set, and the pictures are raw: "
            "make the file first with `chairward calibrate stereo`"
        )
    return Rectifier(load(pair.calibration), *size, source=str(pair.calibration))


def line(pose: Pose, found: Measured) -> str:
    """The lane's pose as the chair file says it, with what was measured in it."""
    values = _values(pose, found)
    return f"pose = {{ {', '.join(f'{key} = {value:g}' for key, value in values.items())} }}"


def _values(pose: Pose, found: Measured) -> dict[str, float]:
    measured = {
        "z_mm": round(found.mount.z_mm),
        "pitch_deg": round(found.mount.pitch_deg, 1),
        "roll_deg": round(found.mount.roll_deg, 1),
    }
    kept = {key: getattr(pose, key) for key in ("x_mm", "y_mm", "yaw_deg")}
    return {"x_mm": kept["x_mm"], **{k: v for k, v in kept.items() if k != "x_mm" and v}, **measured}


def write(pair: CameraPair, found: Measured) -> None:
    """Put the measured pose into the lane's table, leaving everything else (comments too) as it is."""
    document = tomlkit.parse(pair.chair_file.read_text("utf-8"))
    lanes: Any = document["lane"]
    pose = tomlkit.inline_table()
    pose.update(_values(pair.pose, found))
    lanes[pair.lane]["pose"] = pose
    part = pair.chair_file.with_suffix(".part")
    part.write_text(tomlkit.dumps(document), encoding="utf-8")
    part.replace(pair.chair_file)

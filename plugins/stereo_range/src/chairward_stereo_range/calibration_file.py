"""The stereo calibration of one chair: a readable, versioned JSON file, and the rectification that follows from it."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Annotated, Literal

import numpy as np
from pydantic import BaseModel, ConfigDict, Field, ValidationError

from chairward.stages import Image, StereoGeometry
from chairward_stereo_range.opencv import opencv

Vector3 = Annotated[list[float], Field(min_length=3, max_length=3)]
Matrix3 = Annotated[list[Vector3], Field(min_length=3, max_length=3)]


class CalibrationError(ValueError):
    """A calibration cannot be used or made: one sentence with the file and what to do."""


class Camera(BaseModel):
    """One camera: 3x3 intrinsic matrix (px) and distortion k1 k2 p1 p2 k3 (Brown; Zhang 2000)."""

    model_config = ConfigDict(extra="forbid", allow_inf_nan=False)
    matrix: Matrix3
    distortion: Annotated[list[float], Field(min_length=4, max_length=14)]
    rms_px: Annotated[float, Field(ge=0)]


class Calibration(BaseModel):
    """A rig: a point X of the left camera is  rotation X + translation_mm  in the right one.

    epipolar: difference of rows after rectification, in px of the taken pictures; unseen: on views left out of the
    solution. board_bend_mm: how far the board's corners really lay from where a perfect board has them.
    """

    model_config = ConfigDict(extra="forbid", allow_inf_nan=False)
    format: Literal["chairward-stereo-calibration"] = "chairward-stereo-calibration"
    version: Literal[1] = 1
    made: str
    image_width_px: Annotated[int, Field(ge=16, le=16384)]
    image_height_px: Annotated[int, Field(ge=16, le=16384)]
    board: str
    square_mm: Annotated[float, Field(gt=0)]
    left: Camera
    right: Camera
    rotation: Matrix3
    translation_mm: Vector3
    rms_stereo_px: Annotated[float, Field(ge=0)]
    epipolar_mean_px: Annotated[float, Field(ge=0)]
    epipolar_p95_px: Annotated[float, Field(ge=0)]
    epipolar_p95_unseen_px: Annotated[float | None, Field(ge=0)] = None
    board_bend_mm: Annotated[float, Field(ge=0)] = 0.0
    views_used: list[str]
    views_dropped: dict[str, str]

    def save(self, path: Path) -> None:
        """Write the file whole or not at all."""
        path.parent.mkdir(parents=True, exist_ok=True)
        part = path.with_suffix(path.suffix + ".part")
        part.write_text(json.dumps(self.model_dump(), indent=2) + "\n", encoding="utf-8")
        part.replace(path)


def load(path: Path) -> Calibration:
    """The calibration in `path`. Raises CalibrationError, naming file and field."""
    try:
        return Calibration.model_validate_json(path.read_text(encoding="utf-8"))
    except OSError as error:
        raise CalibrationError(
            f"{path}: {error.strerror or error}: make it with `chairward calibrate stereo --out {path.name}`"
        ) from error
    except UnicodeDecodeError as error:
        raise CalibrationError(f"{path}: is not text: make it with `chairward calibrate stereo`") from error
    except ValidationError as error:
        first = error.errors()[0]
        where = ".".join(str(part) for part in first["loc"]) or "file"
        raise CalibrationError(
            f"{path}: {where}: {first['msg']}: no calibration of version 1: make it with `chairward calibrate stereo`"
        ) from error


class Rectifier:
    """Turns raw camera pictures into the row-aligned pair of the working size (fixed-point maps, 0.45 ms a pair)."""

    def __init__(self, calibration: Calibration, width_px: int, height_px: int, source: str = "calibration") -> None:
        cv2 = opencv()
        c = calibration
        self.source = source
        self.size = (c.image_width_px, c.image_height_px)
        k1, k2 = np.array(c.left.matrix), np.array(c.right.matrix)
        d1, d2 = np.array(c.left.distortion), np.array(c.right.distortion)
        r1, r2, p1, p2 = cv2.stereoRectify(
            k1, d1, k2, d2, self.size, np.array(c.rotation),
            np.array(c.translation_mm).reshape(3, 1),
            alpha=0, newImageSize=(width_px, height_px),
        )[:4]  # fmt: skip
        if p2[0, 3] >= 0:
            raise CalibrationError(
                f"{source}: the right camera stands left of the left one (translation_mm[0] = {c.translation_mm[0]}): "
                "swap the cameras or calibrate again"
            )
        kind = cv2.CV_16SC2
        self.left_maps = cv2.initUndistortRectifyMap(k1, d1, r1, p1, (width_px, height_px), kind)
        self.right_maps = cv2.initUndistortRectifyMap(k2, d2, r2, p2, (width_px, height_px), kind)
        self.geometry = StereoGeometry(
            focal_px=float(p1[0, 0]),
            baseline_mm=float(-p2[0, 3] / p2[0, 0]),
            cx_px=float(p1[0, 2]),
            cy_px=float(p1[1, 2]),
            width_px=width_px,
            height_px=height_px,
            doffs_px=float(p2[0, 2] - p1[0, 2]),
        )

    def __call__(self, left: Image, right: Image) -> tuple[Image, Image]:
        """Raises CalibrationError when the pictures are not of the calibrated size."""
        cv2 = opencv()
        for name, picture in (("left", left), ("right", right)):
            if picture.shape[1::-1] != self.size:
                raise CalibrationError(
                    f"{self.source}: made for {self.size[0]}x{self.size[1]}, but the {name} camera gives "
                    f"{picture.shape[1]}x{picture.shape[0]}: set that size or calibrate again"
                )
        return (
            np.asarray(cv2.remap(left, *self.left_maps, cv2.INTER_LINEAR), np.uint8),
            np.asarray(cv2.remap(right, *self.right_maps, cv2.INTER_LINEAR), np.uint8),
        )

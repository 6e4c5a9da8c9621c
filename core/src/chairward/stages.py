"""What flows inside a lane, from a source through its stages, on the lane's bench. Never crosses a process border.

Images are uint8, rows x columns (x 3, BGR as OpenCV has it). Times are CLOCK_MONOTONIC nanoseconds.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

Image = npt.NDArray[np.uint8]
Floats = npt.NDArray[np.float32]


@dataclass(frozen=True, slots=True, kw_only=True)
class Pose:
    """Where a sensor sits on the chair: x forward, y left, z up from the floor below the axle's middle.

    yaw_deg: turned left is positive. pitch_deg: looking *down* is positive. roll_deg: right side down is positive.
    """

    x_mm: float = 0.0
    y_mm: float = 0.0
    z_mm: float = 0.0
    yaw_deg: float = 0.0
    pitch_deg: float = 0.0
    roll_deg: float = 0.0


@dataclass(frozen=True, slots=True, kw_only=True)
class StereoGeometry:
    """A rectified pair's geometry: Z_mm = focal_px * baseline_mm / (disparity_px + doffs_px).

    focal_px, cx_px, cy_px and doffs_px belong to images of width_px x height_px; scale them with the image.
    """

    focal_px: float
    baseline_mm: float
    cx_px: float
    cy_px: float
    width_px: int
    height_px: int
    doffs_px: float = 0.0


@dataclass(frozen=True, slots=True, kw_only=True)
class StereoFrame:
    """A pair of pictures taken at (nearly) the same instant; left, right: h x w x 3 uint8 BGR, equal shapes.

    captured_ns: of the older picture. skew_ns: between the two. geometry: set when the pair is already rectified
    (files, simulator); None means raw camera pictures that need the chair's calibration. name: "" or the file's name
    ("recording/frame" of a sequence). pose: where these recorded pictures were taken from; None: the chair file's pose.
    """

    left: Image
    right: Image
    captured_ns: int
    seq: int
    skew_ns: int = 0
    geometry: StereoGeometry | None = None
    name: str = ""
    pose: Pose | None = None


@dataclass(frozen=True, slots=True, kw_only=True)
class RectifiedPair:
    """The pair after rectification and resizing to the working size; left, right: h x w x 3 uint8 BGR.

    pose: the pose in force, z_mm 0 where the mount is unknown; None: the chair file's pose.
    """

    left: Image
    right: Image
    geometry: StereoGeometry
    captured_ns: int
    seq: int
    pose: Pose | None = None


@dataclass(frozen=True, slots=True, kw_only=True)
class FloorMap:
    """What stereo has just measured *to be floor*, in the rectified left picture: h x w bool.

    obstacle: h x w bool, measured to stand above (or drop below) the floor. Both False: not known.
    horizon_row: first row (may be negative) below which floor can be seen at all.
    """

    floor: npt.NDArray[np.bool_]
    obstacle: npt.NDArray[np.bool_]
    horizon_row: float
    captured_ns: int


@dataclass(frozen=True, slots=True, kw_only=True)
class ObstacleMap:
    """Appearance's view, in the left picture: mask h x w bool, True where it does not look like floor."""

    mask: npt.NDArray[np.bool_]
    captured_ns: int


@dataclass(frozen=True, slots=True, kw_only=True)
class DisparityMap:
    """Disparity of the rectified left picture, h x w float32 px, NaN where not known."""

    disparity_px: Floats
    geometry: StereoGeometry
    captured_ns: int


@dataclass(frozen=True, slots=True, kw_only=True)
class Pane:
    """A picture for people, from any stage; of each name (left, right, obstacle, disparity) the newest is shown."""

    name: str
    image: Image
    captured_ns: int


@dataclass(frozen=True, slots=True, kw_only=True)
class AudioBlock:
    """10 ms (or what the device gives) of mono sound: float32 in -1..1, at rate_hz.

    captured_ns: of the first sample. lost_samples: samples dropped just before this block (xrun).
    """

    samples: Floats
    rate_hz: int
    captured_ns: int
    seq: int
    lost_samples: int = 0
    chair_speaks: bool = False

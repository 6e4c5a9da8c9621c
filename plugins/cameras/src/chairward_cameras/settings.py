"""Settings of the source `cameras`."""

from __future__ import annotations

from pathlib import Path
from typing import Literal

from pydantic import Field

from chairward.components import Settings


class CamerasSettings(Settings):
    """Where the pairs come from: two cameras (live), a list of recorded pairs (manifest), or a folder of pictures."""

    kind: Literal["live", "manifest", "folder"] = Field(
        "live", description="live: two cameras; manifest: pairs listed in a CSV file; folder: pairs of picture files"
    )

    # live
    left: int | str = Field(
        0, description="left camera: its number, its device (/dev/v4l/by-id/...), or anything OpenCV opens by name"
    )
    right: int | str = Field(2, description="right camera, said in the same way; must be another device")
    width_px: int = Field(320, ge=64, le=4096, description="live: picture width asked of both cameras")
    height_px: int = Field(240, ge=48, le=4096, description="live: picture height asked of both cameras")
    camera_fps: float = Field(30.0, ge=1, le=240, description="live: pictures a second asked of both cameras")
    pixel_format: str = Field(
        "MJPG", pattern="^([A-Z0-9]{4})?$", description="live: four letters (MJPG lets two cameras share a USB bus)"
    )
    exposure: float | None = Field(
        None, description="live: fixed exposure, same for both, in the driver's units; none leaves it automatic"
    )
    focus: float | None = Field(None, description="live: fixed focus, in the driver's units; none leaves it alone")
    white_balance_k: float | None = Field(
        None, ge=1000, le=20000, description="live: fixed white balance in kelvin; none leaves it automatic"
    )
    max_skew_ms: float = Field(
        20.0, gt=0, le=200, description="live: largest time between the two pictures of a pair; others are dropped"
    )
    lost_after_ms: float = Field(
        500.0, ge=100, le=5000, description="live: without a good pair for so long the device counts as lost"
    )

    # manifest and folder
    manifest: Path | None = Field(None, description="manifest: the CSV file (columns: see README)")
    kinds: tuple[Literal["stereo_gt", "synthetic", "sequence"], ...] = Field(
        ("stereo_gt", "synthetic", "sequence"), min_length=1, description="manifest: kinds of rows that are played"
    )
    names: str = Field("*", min_length=1, description='manifest: names that are played, as a pattern ("robot_*")')
    folder: Path | None = Field(None, description="folder: where the picture files are")
    left_glob: str = Field("left*", min_length=1, description="folder: the left pictures, in the order of their names")
    right_glob: str = Field("right*", min_length=1, description="folder: the right pictures")
    focal_px: float | None = Field(
        None, gt=0, description="folder: focal length of rectified pictures; none: they are raw and need calibration"
    )
    baseline_mm: float | None = Field(None, gt=0, description="folder: distance between the cameras; with focal_px")
    doffs_px: float = Field(0.0, description="folder: difference of the principal points; with focal_px")
    playback_fps: float | None = Field(
        None, ge=0, le=240, description="files: pairs a second; 0: as fast as they are read; none: as recorded, else 15"
    )
    hold_frames: int = Field(15, ge=1, le=10_000, description="files: how many times each still pair is shown")
    lead_in_s: float = Field(
        0.0, ge=0, le=60, description="files: how long the first pair of a sequence stands still before it moves"
    )
    resize_px: int | None = Field(
        None, ge=64, le=4096, description="files: picture width to resize to (the geometry with it); none: as they are"
    )

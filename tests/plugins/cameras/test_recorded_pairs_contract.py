"""Recorded pairs come to an end as the contract of finite sources says."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np
import pytest

from chairward.stages import StereoFrame
from chairward.testing import FiniteSourceContract, SourceRig
from chairward_cameras.plugin import chairward_sources


class FolderRig(SourceRig):
    """Three recorded pairs in a folder."""

    component = chairward_sources()[0]
    kind = StereoFrame

    def __init__(self, folder: Path) -> None:
        for number in range(3):
            for side in ("left", "right"):
                assert cv2.imwrite(str(folder / f"{side}_{number}.png"), np.full((240, 320, 3), 90, np.uint8))
        self.name = str(folder)
        self.context = replace(self.context, run_dir=folder)
        self.settings = {"kind": "folder", "folder": str(folder), "playback_fps": 0}

    def unplug(self) -> None:
        """Files stay."""

    def plug(self) -> None:
        """Files stay."""

    def close(self) -> None:
        """Nothing is left open."""


class TestRecordedPairs(FiniteSourceContract):
    """All of the contract."""

    @pytest.fixture
    def rig(self, tmp_path: Path) -> FolderRig:
        return FolderRig(tmp_path)

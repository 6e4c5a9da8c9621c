"""The mount of pictures that somebody else has taken: what the frame says, else what their own floor says.

Causal, as a chair would have to find it: from the first pictures of a recording, and then kept. Until a floor has been
found, and where none is, the mount is unknown (z_mm 0) and everything that is seen counts as a thing.
"""

from __future__ import annotations

from dataclasses import replace

from chairward.components import Pose
from chairward.stages import Floats, Image, StereoFrame, StereoGeometry
from chairward_stereo_range.matching import whole_frame_disparity
from chairward_stereo_range.mount import estimate_mount

EVERY, MAPS = 3, 10
"""One disparity map of so many frames is looked at for a floor, and so many maps at most."""


def recording(frame: StereoFrame) -> str:
    """The name of the recording that a frame belongs to; "" for cameras."""
    return frame.name.partition("/")[0]


class OwnMount:
    """Finds the pose of each recording; `at` gives x, y and yaw, which no floor can tell."""

    def __init__(self, at: Pose) -> None:
        self._at = at
        self._unknown = replace(at, z_mm=0.0, pitch_deg=0.0, roll_deg=0.0)
        self._of: tuple[str, StereoGeometry] | None = None
        self._found = self._unknown
        self._maps: list[Floats] = []
        self._frames = 0

    def pose(self, frame: StereoFrame, left: Image, right: Image, geometry: StereoGeometry) -> Pose:
        """The pose in force for `frame`, whose rectified pictures (h x w x 3 BGR) and geometry are given."""
        if frame.pose is not None:
            return frame.pose
        if self._of != (recording(frame), geometry):
            self._of = (recording(frame), geometry)
            self._found, self._maps, self._frames = self._unknown, [], 0
        if self._found is self._unknown and len(self._maps) < MAPS:
            if self._frames % EVERY == 0:
                self._maps.append(whole_frame_disparity(left, right, geometry))
                mount = estimate_mount(self._maps, geometry)
                if mount is not None:
                    self._found = mount.pose(self._at)
            self._frames += 1
        return self._found

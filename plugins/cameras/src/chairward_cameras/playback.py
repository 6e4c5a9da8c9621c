"""The file-backed source: shows recorded pairs at camera rate, or as fast as they are asked for."""

from __future__ import annotations

import json
import logging
import time
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import TextIO

from chairward.components import Context, DeviceLost, EndOfInput, Pose
from chairward.stages import StereoFrame
from chairward_cameras.settings import CamerasSettings
from chairward_cameras.shots import Shot, shots

log = logging.getLogger(__name__)

S = 1_000_000_000


class FilePairs:
    """Yields StereoFrame. Like a camera it does not wait for a slow reader: pairs whose time has passed are skipped.

    captured_ns is the moment a pair was due, counted from the first read, so that it neither drifts nor jitters.
    Each pair given is written to run_dir/<lane>-truth.jsonl; truth_mm there is the depth *from the camera*, or null.
    """

    def __init__(
        self, settings: CamerasSettings, context: Context, clock: Callable[[], int] = time.monotonic_ns
    ) -> None:
        self._settings, self._clock = settings, clock
        self._pose = context.pose
        self._truth_path: Path = context.run_dir / f"{context.lane}-truth.jsonl"
        self._truth: TextIO | None = None
        self._shots: list[Shot] = []
        self._due: list[int] = []
        self._start_ns: int | None = None
        self._index = 0
        self._seq = 0
        self._ready: tuple[Shot, StereoFrame, float | None] | None = None
        self.skipped = 0

    def open(self) -> None:
        """Read the list and check that every file is there. Raises DeviceLost, naming file and line."""
        self.close()
        self._shots = [shot for shot in shots(self._settings) for _ in range(shot.repeat)]
        self._due, at = [], 0
        for shot in self._shots:
            self._due.append(at)
            at += round(S / shot.fps) if shot.fps else 0
        self._index, self._start_ns, self._ready = 0, None, None
        try:
            self._truth = self._truth_path.open("a", encoding="utf-8")
        except OSError as error:
            raise DeviceLost(f"{self._truth_path}: the truth cannot be written ({error.strerror})") from error

    def read(self, timeout_s: float) -> StereoFrame | None:
        """The pair that is due, or None after timeout_s. Raises EndOfInput at the end, DeviceLost for a bad file."""
        end_ns = self._clock() + max(0, round(timeout_s * S))
        if self._truth is None:
            raise DeviceLost("the recorded pairs are not open: open() comes first")
        if self._start_ns is None:
            self._start_ns = self._clock()
        self._skip_what_has_passed(self._start_ns)
        if self._index >= len(self._shots):
            raise EndOfInput
        paced = self._shots[self._index].fps > 0
        due_ns = self._start_ns + self._due[self._index] if paced else self._clock()
        shot, frame, truth = self._load()
        wait_ns = min(due_ns, end_ns) - self._clock()
        if wait_ns > 0:
            time.sleep(wait_ns / S)
        if paced and self._clock() < due_ns:
            return None
        self._index += 1
        self._seq += 1
        self._ready = None
        line = {"captured_ns": due_ns, "seq": self._seq, "name": shot.name, "kind": shot.kind, "truth_mm": truth}
        self._truth.write(json.dumps(line) + "\n")
        self._truth.flush()
        return StereoFrame(
            left=frame.left,
            right=frame.right,
            captured_ns=due_ns,
            seq=self._seq,
            geometry=frame.geometry,
            name=shot.name,
            pose=self._taken_from(shot),
        )

    def close(self) -> None:
        """Close the list of truths; may be called twice."""
        if self._truth is not None:
            self._truth.close()
            self._truth = None
        if self.skipped:
            log.warning("%d recorded pairs were skipped: their reader is slower than they were recorded", self.skipped)
            self.skipped = 0

    def _taken_from(self, shot: Shot) -> Pose | None:
        """Where the list says that the cameras stood: at this chair's front, at the recording's height and pitch."""
        if shot.mount is None:
            return None
        return replace(self._pose, z_mm=shot.mount.z_mm, pitch_deg=shot.mount.pitch_deg, roll_deg=0.0)

    def _skip_what_has_passed(self, start_ns: int) -> None:
        """Go on to the newest pair that is due, as a camera would; the very last pair is always given."""
        now_ns = self._clock() - start_ns
        while (
            self._index + 1 < len(self._shots)
            and self._shots[self._index + 1].fps > 0
            and self._due[self._index + 1] <= now_ns
        ):
            self._index += 1
            self.skipped += 1

    def _load(self) -> tuple[Shot, StereoFrame, float | None]:
        """The current shot's pictures, decoded once while there is time before they are due."""
        from chairward_cameras import pictures

        shot = self._shots[self._index]
        if self._ready is None or self._ready[0] is not shot:
            left, right, geometry = pictures.pair(shot, self._settings.resize_px)
            frame = StereoFrame(left=left, right=right, captured_ns=0, seq=0, geometry=geometry)
            self._ready = (shot, frame, pictures.truth_mm(shot))
        return self._ready

"""Two cameras at once: one grabbing thread each, so that a picture never waits in a driver's queue."""

from __future__ import annotations

import logging
import os
import threading
import time
from collections import deque
from pathlib import Path
from typing import Any, cast

from chairward.components import DeviceLost
from chairward.stages import Image, StereoFrame
from chairward_cameras.pairing import Picture, captured_ns, newest_pair
from chairward_cameras.settings import CamerasSettings

log = logging.getLogger(__name__)

S = 1_000_000_000
MS = 1_000_000
OPEN_TIMEOUT_S = 5.0
KEPT_PICTURES = 2


def device_path(device: int | str) -> str:
    """The file behind a camera: /dev/videoN for a number, links (/dev/v4l/by-id/...) followed, others unchanged."""
    text = str(device).strip()
    if text.isdigit():
        return f"/dev/video{text}"
    return os.path.realpath(text) if text.startswith("/") else text


class Camera:
    """One camera and its thread, which alone touches the device. `changed` is shared by both cameras of a pair."""

    def __init__(self, side: str, device: int | str, settings: CamerasSettings, changed: threading.Condition) -> None:
        self.name = f"camera {side} ({device})"
        self._path, self._settings, self._changed = device_path(device), settings, changed
        self._period_ns = round(S / settings.camera_fps)
        self._stop = threading.Event()
        self.unused: deque[Picture] = deque(maxlen=KEPT_PICTURES)
        self.newest_ns = 0
        self.failure = ""
        self._thread = threading.Thread(target=self._work, name=self.name, daemon=True)

    def start(self) -> None:
        """Begin to open and to grab; what goes wrong is told by `failure`."""
        self._thread.start()

    def stop(self) -> None:
        """Ask the thread to give the device back. A driver that hangs in a read keeps it until that read ends."""
        self._stop.set()

    def join(self, timeout_s: float) -> bool:
        """Wait for the thread; True when the device is free again."""
        if self._thread.ident is not None:
            self._thread.join(timeout_s)
        return not self._thread.is_alive()

    def _work(self) -> None:
        import cv2

        cv2.setNumThreads(1)
        is_device = self._path.startswith("/dev/video")
        # One second instead of ten: a camera that hangs must not hold its thread, and so its device, for long.
        os.environ.setdefault("OPENCV_VIDEOIO_V4L_SELECT_TIMEOUT", "1")
        capture = cv2.VideoCapture(self._path, cv2.CAP_V4L2 if is_device else cv2.CAP_ANY)
        try:
            if not capture.isOpened():
                return self._fail(f"cannot be opened: {_advice(self._path)}")
            if is_device:
                self._set_up(cv2, capture)
            # A video file has no pace of its own: at the camera's, it stands in for one.
            paced = Path(self._path).is_file()
            number = 0
            while not self._stop.is_set():
                if paced and number:
                    self._stop.wait(self._period_ns / S)
                if not capture.grab():
                    return self._fail("gives no more pictures: check its cable")
                now_ns = time.monotonic_ns()
                at_ns = captured_ns(capture.get(cv2.CAP_PROP_POS_MSEC), now_ns, self._period_ns)
                good, image = capture.retrieve()
                if not good or image is None:
                    continue
                wrong = self._wrong_size(image)
                if wrong:
                    return self._fail(wrong)
                number += 1
                with self._changed:
                    self.unused.append(Picture(image=cast("Image", image), captured_ns=at_ns, number=number))
                    self.newest_ns = at_ns
                    self._changed.notify_all()
        except cv2.error as error:
            return self._fail(f"failed in OpenCV: {str(error).strip().splitlines()[0][:120]}")
        finally:
            capture.release()
        return None

    def _set_up(self, cv2: Any, capture: Any) -> None:
        """Ask for size, rate and fixed exposure; what the driver does not grant is seen in its pictures, or logged."""
        s = self._settings
        wanted = [(cv2.CAP_PROP_BUFFERSIZE, 1.0, "a buffer of one")]
        if s.pixel_format:
            wanted.append((cv2.CAP_PROP_FOURCC, float(cv2.VideoWriter_fourcc(*s.pixel_format)), s.pixel_format))
        wanted += [
            (cv2.CAP_PROP_FRAME_WIDTH, float(s.width_px), f"{s.width_px} px wide"),
            (cv2.CAP_PROP_FRAME_HEIGHT, float(s.height_px), f"{s.height_px} px high"),
            (cv2.CAP_PROP_FPS, s.camera_fps, f"{s.camera_fps:g} pictures a second"),
        ]
        if s.exposure is not None:
            # V4L2: 1 is manual, 3 is aperture priority.
            wanted += [(cv2.CAP_PROP_AUTO_EXPOSURE, 1.0, "manual exposure")]
            wanted += [(cv2.CAP_PROP_EXPOSURE, s.exposure, f"exposure {s.exposure:g}")]
        if s.focus is not None:
            wanted += [
                (cv2.CAP_PROP_AUTOFOCUS, 0.0, "manual focus"),
                (cv2.CAP_PROP_FOCUS, s.focus, f"focus {s.focus:g}"),
            ]
        if s.white_balance_k is not None:
            wanted += [(cv2.CAP_PROP_AUTO_WB, 0.0, "manual white balance")]
            wanted += [(cv2.CAP_PROP_WB_TEMPERATURE, s.white_balance_k, f"white balance {s.white_balance_k:g} K")]
        for which, value, said in wanted:
            if not capture.set(which, value):
                log.warning("%s does not grant %s", self.name, said)

    def _wrong_size(self, image: Any) -> str:
        height, width = image.shape[:2]
        s = self._settings
        if (width, height) == (s.width_px, s.height_px) and image.ndim == 3:
            return ""
        return (
            f"gives {width}x{height} pictures, but {s.width_px}x{s.height_px} are set: choose a size it has "
            "(cameras.width_px, cameras.height_px)"
        )

    def _fail(self, sentence: str) -> None:
        with self._changed:
            self.failure = f"{self.name} {sentence}"
            self._changed.notify_all()


def _advice(path: str) -> str:
    """What to do about a camera that does not open, with the cameras there are."""
    there = ", ".join(sorted(str(p) for p in Path("/dev").glob("video*"))) or "none"
    if Path(path).exists() and not os.access(path, os.R_OK | os.W_OK):
        return "no permission; add the user to the group 'video'"
    return f"plug it in or correct cameras.left / cameras.right (video devices now: {there})"


class LivePairs:
    """Yields StereoFrame from two cameras; no picture twice, no pair farther apart than max_skew_ms."""

    def __init__(self, settings: CamerasSettings) -> None:
        self._settings = settings
        self._changed = threading.Condition()
        self._cameras: tuple[Camera, Camera] | None = None
        self._last_good_ns = 0
        self._seq = 0

    def open(self) -> None:
        """Start both cameras and wait for the first picture of each. Raises DeviceLost, naming each that fails."""
        self.close()
        s = self._settings
        if device_path(s.left) == device_path(s.right):
            raise DeviceLost(
                f"cameras.left ({s.left}) and cameras.right ({s.right}) are the same device, "
                f"{device_path(s.left)}: two cameras are needed, set the second one"
            )
        self._changed = threading.Condition()
        left, right = Camera("left", s.left, s, self._changed), Camera("right", s.right, s, self._changed)
        self._cameras = left, right
        left.start()
        right.start()
        both = left, right
        with self._changed:
            # Both, so that two missing cameras are told in one sentence, not in turns by which thread was first.
            self._changed.wait_for(lambda: all(c.failure or c.newest_ns for c in both), OPEN_TIMEOUT_S)
        silence = f"opened but gave no picture within {OPEN_TIMEOUT_S:g} s"
        wrong = [c.failure or f"{c.name} {silence}" for c in both if c.failure or not c.newest_ns]
        if wrong:
            self.close()
            raise DeviceLost("; ".join(wrong))
        self._last_good_ns = time.monotonic_ns()

    def read(self, timeout_s: float) -> StereoFrame | None:
        """The newest good pair, or None after timeout_s. Raises DeviceLost, naming the camera that lags or failed."""
        if self._cameras is None:
            raise DeviceLost("the cameras are not open: open() comes first")
        left, right = self._cameras
        end_ns = time.monotonic_ns() + max(0, round(timeout_s * S))
        with self._changed:
            while True:
                pair = newest_pair(left.unused, right.unused, round(self._settings.max_skew_ms * MS))
                if pair is not None:
                    return self._frame(left, right, pair)
                now_ns = time.monotonic_ns()
                self._check(left, right, now_ns)
                if now_ns >= end_ns:
                    return None
                self._changed.wait((end_ns - now_ns) / S)

    def close(self) -> None:
        """Give both devices back; may be called twice."""
        if self._cameras is None:
            return
        for camera in self._cameras:
            camera.stop()
        for camera in self._cameras:
            if not camera.join(timeout_s=0.5):
                log.warning("%s does not answer; its device stays taken until it does", camera.name)
        self._cameras = None

    def _frame(self, left: Camera, right: Camera, pair: tuple[Picture, Picture]) -> StereoFrame:
        """Use the pair up, with everything older."""
        for camera, used in zip((left, right), pair, strict=True):
            while camera.unused and camera.unused[0].number <= used.number:
                camera.unused.popleft()
        a, b = pair
        self._last_good_ns = time.monotonic_ns()
        self._seq += 1
        return StereoFrame(
            left=a.image,
            right=b.image,
            captured_ns=min(a.captured_ns, b.captured_ns),
            seq=self._seq,
            skew_ns=abs(a.captured_ns - b.captured_ns),
        )

    def _check(self, left: Camera, right: Camera, now_ns: int) -> None:
        """Raise DeviceLost when a camera failed, or when no good pair has come for too long."""
        failures = [camera.failure for camera in (left, right) if camera.failure]
        if failures:
            raise DeviceLost("; ".join(failures))
        s = self._settings
        if now_ns - self._last_good_ns <= s.lost_after_ms * MS:
            return
        old, new = sorted((left, right), key=lambda c: c.newest_ns)
        silence_ms = (now_ns - old.newest_ns) / MS
        if silence_ms > s.lost_after_ms / 2:
            raise DeviceLost(f"{old.name} has given no picture for {silence_ms:.0f} ms: check its cable")
        apart_ms = (new.newest_ns - old.newest_ns) / MS
        raise DeviceLost(
            f"{old.name} lags {apart_ms:.0f} ms behind the other camera, at most {s.max_skew_ms:g} ms are allowed "
            "(cameras.max_skew_ms): give each camera its own USB port, or lower cameras.camera_fps"
        )

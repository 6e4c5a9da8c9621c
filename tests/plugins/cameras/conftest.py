"""Stand-ins that are real to OpenCV: picture files, and a named pipe of raw video that plays a camera."""

from __future__ import annotations

import contextlib
import os
import threading
import time
from collections.abc import Callable, Iterator
from pathlib import Path

import cv2
import numpy as np
import pytest

from chairward.components import Context


@pytest.fixture
def context(tmp_path: Path) -> Context:
    return Context(lane="front", run_dir=tmp_path, chair_dir=tmp_path)


class PipeCamera:
    """Plays a camera: raw y4m video through a named pipe at a steady rate; the brightness counts the pictures."""

    def __init__(
        self, path: Path, width: int = 320, height: int = 240, fps: float = 30.0, phase_s: float = 0.0
    ) -> None:
        self.path, self._size, self._period_s = path, (width, height), 1.0 / fps
        self._phase_s = phase_s
        self._stop, self._pause = threading.Event(), threading.Event()
        os.mkfifo(path)
        self._thread = threading.Thread(target=self._work, daemon=True)
        self._thread.start()

    def pause(self) -> None:
        self._pause.set()

    def stop(self) -> None:
        self._stop.set()
        with contextlib.suppress(OSError):  # a writer that still waits for its first reader is let go
            os.close(os.open(self.path, os.O_RDONLY | os.O_NONBLOCK))
        self._thread.join(5)

    def _work(self) -> None:
        width, height = self._size
        fd = os.open(self.path, os.O_WRONLY)
        try:
            os.write(fd, f"YUV4MPEG2 W{width} H{height} F30:1 Ip A1:1 C420jpeg\n".encode())
            due, count = time.monotonic() + self._phase_s, 0
            while not self._stop.is_set():
                if not self._pause.is_set():
                    image = np.full((height, width, 3), 40 + 3 * count % 200, np.uint8)
                    data = b"FRAME\n" + cv2.cvtColor(image, cv2.COLOR_BGR2YUV_I420).tobytes()
                    while data:
                        data = data[os.write(fd, data) :]
                    count += 1
                due += self._period_s
                self._stop.wait(max(0.0, due - time.monotonic()))
        except BrokenPipeError:
            return
        finally:
            os.close(fd)


@pytest.fixture
def pipe_camera(tmp_path: Path) -> Iterator[Callable[..., PipeCamera]]:
    made: list[PipeCamera] = []

    def make(name: str, **options: float) -> PipeCamera:
        made.append(PipeCamera(tmp_path / f"{name}.y4m", **options))  # type: ignore[arg-type]
        return made[-1]

    yield make
    for camera in made:
        camera.stop()

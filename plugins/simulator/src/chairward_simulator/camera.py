"""Source `sim_cameras`: a stereo pair at camera rate, rendered from where the chair really is."""

from __future__ import annotations

import time
from math import cos, radians, sin
from typing import TYPE_CHECKING

from chairward.components import Context, DeviceLost
from chairward.shared_state import SharedState
from chairward.stages import StereoFrame
from chairward_simulator.settings import CameraSettings

if TYPE_CHECKING:
    from chairward_simulator.render import Array
    from chairward_simulator.scene import StereoCamera

WORLD_WAIT_S = 5.0
STIMULUS = "stimulus"
"""In run_dir: what `chairward check` wants to be seen, and since when."""
CAMERAS_ON = "sim_cameras-on"
"""Made in run_dir when the cameras work: the light on them that the simulated person waits for."""


class SimCameras:
    """Reads run_dir/world, renders, waits for the next frame's time. The pose of the lane is the left camera's."""

    def __init__(self, settings: CameraSettings, context: Context) -> None:
        self._settings, self._context = settings, context
        self._camera: StereoCamera | None = None
        self._world: SharedState | None = None
        self._shown: SharedState | None = None
        self._due_ns = 0
        self._seq = 0

    def open(self) -> None:
        """Attach to the world and render once (so that compiling is over before the first frame)."""
        from chairward_simulator.home import HOME_FILE, load
        from chairward_simulator.scene import StereoCamera, person_cylinders

        self._world = attach(self._context, "sim_cameras")
        home = load(self._context.chair_dir / self._settings.home if self._settings.home else HOME_FILE)
        if self._camera is None:
            self._camera = StereoCamera(home, self._context.pose, self._settings.noise, self._settings.seed)
            person = person_cylinders(self._camera.scene, 0.0, 0.0, 0.0, 0.0)
            self._camera.pair(home.start.x_mm, home.start.y_mm, home.start.heading_deg, [person])
        (self._context.run_dir / CAMERAS_ON).touch()
        self._due_ns = time.monotonic_ns()

    def read(self, timeout_s: float) -> StereoFrame | None:
        """The pair of the next frame's time; frames that nobody fetched in time are dropped, as a camera does."""
        from chairward_simulator.scene import person_cylinders

        if self._world is None or self._camera is None:
            raise DeviceLost("sim_cameras: not open: call open() first")
        wait_s = (self._due_ns - time.monotonic_ns()) / 1e9
        if wait_s > timeout_s:
            time.sleep(timeout_s)
            return None
        if wait_s > 0:
            time.sleep(wait_s)
        period_ns = int(1e9 / self._settings.fps)
        self._due_ns += period_ns * (1 + max(0, time.monotonic_ns() - self._due_ns) // period_ns)
        state = read(self._world, "sim_cameras")
        people = (
            [
                person_cylinders(
                    self._camera.scene,
                    state["person_x_mm"],
                    state["person_y_mm"],
                    state["person_facing_deg"],
                    state["person_walked_mm"],
                )
            ]
            if state["person_here"]
            else []
        )
        people += self._stimulus(state)
        left, right = self._camera.pair(state["x_mm"], state["y_mm"], state["heading_deg"], people)
        self._seq += 1
        return StereoFrame(
            left=left,
            right=right,
            captured_ns=int(state["time_ns"]),
            seq=self._seq,
            geometry=self._camera.geometry,
        )

    def _stimulus(self, state: dict[str, float]) -> list[Array]:
        """What `chairward check` lets appear ahead of the footprint: somebody who stands there."""
        from chairward_simulator.home import PERSON_RADIUS_MM
        from chairward_simulator.scene import person_cylinders

        assert self._camera is not None
        path = self._context.run_dir / STIMULUS
        if self._shown is None:
            if not path.exists():
                return []
            self._shown = SharedState.attach(path)
        shown = self._shown.read()
        if not shown["on"]:
            return []
        ahead_mm = self._context.footprint.front_mm + shown["distance_mm"] + PERSON_RADIUS_MM
        heading = radians(state["heading_deg"])
        at = state["x_mm"] + ahead_mm * cos(heading), state["y_mm"] + ahead_mm * sin(heading)
        return [person_cylinders(self._camera.scene, *at, state["heading_deg"] + 180.0, 0.0)]

    def close(self) -> None:
        """Let go of the world."""
        if self._world is not None:
            self._world.close()
            self._world = None
        if self._shown is not None:
            self._shown.close()
            self._shown = None


def attach(context: Context, who: str) -> SharedState:
    """The world of this run. Raises DeviceLost when there is none."""
    path = context.run_dir / "world"
    try:
        return SharedState.attach(path, WORLD_WAIT_S)
    except FileNotFoundError:
        raise DeviceLost(
            f"{who}: no simulated world at {path}: add [companion.home] with component = 'sim_home' to the chair file"
        ) from None


def read(world: SharedState, who: str) -> dict[str, float]:
    """The world's state. Raises DeviceLost when its writer died in mid-write."""
    try:
        return world.read()
    except TimeoutError as error:
        raise DeviceLost(f"{who}: {error}") from error

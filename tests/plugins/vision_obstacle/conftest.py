"""A small painted world: a floor in true perspective, things standing on it, and what stereo would say about them."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import numpy.typing as npt
import pytest

from chairward.components import Bench, Context, Footprint, Pose, Processor
from chairward.messages import RangeReading
from chairward.stages import DisparityMap, FloorMap, RectifiedPair, StereoFrame, StereoGeometry
from chairward_vision_obstacle.plugin import make
from chairward_vision_obstacle.settings import VisionObstacleSettings

GEOMETRY = StereoGeometry(focal_px=300, baseline_mm=50, cx_px=159.5, cy_px=119.5, width_px=320, height_px=240)
POSE = Pose(x_mm=450, z_mm=700, pitch_deg=15)
FOOTPRINT = Footprint(front_mm=450, rear_mm=450, half_width_mm=300)
PERIOD_NS = 66_666_667


@dataclass
class Thing:
    """An upright board across the way, or (height 0) something painted on the floor."""

    ahead_mm: float
    width_mm: float
    height_mm: float
    colour: tuple[int, int, int]
    length_mm: float = 0.0
    left_mm: float = 0.0


@dataclass
class World:
    """Paints what a camera at POSE sees after driving `driven_mm`; the floor has a fine pattern fixed to it."""

    things: list[Thing] = field(default_factory=list)
    floor: tuple[int, int, int] = (120, 140, 150)
    pattern: float = 18.0
    light: float = 1.0
    seed: int = 3

    def __post_init__(self) -> None:
        rng = np.random.default_rng(self.seed)
        coarse = rng.normal(0, 1, (700, 200))
        self._pattern = (coarse + np.roll(coarse, 1, 0) + np.roll(coarse, 1, 1)) / np.sqrt(3)
        self._noise = rng.normal(0, 1.5, (240, 320, 3))
        pitch = np.radians(POSE.pitch_deg)
        x = (np.arange(320) - GEOMETRY.cx_px) / 300
        y = (np.arange(240) - GEOMETRY.cy_px) / 300
        self.right, down = np.meshgrid(x, y)
        self.level, self.up = np.cos(pitch) - down * np.sin(pitch), -np.sin(pitch) - down * np.cos(pitch)
        with np.errstate(divide="ignore"):
            depth = np.where(self.up < 0, POSE.z_mm / -self.up, np.inf)
        self._ground = depth < 6000
        self._depth = np.where(self._ground, depth, 6000.0)
        self._forward = np.where(self._ground, self._depth * self.level, 0)
        self._left = np.where(self._ground, -self._depth * self.right, 0)
        self._columns = (self._left / 15).astype(int) % 200

    def see(self, driven_mm: float = 0.0, number: int = 1) -> Bench:
        """The bench as stereo_range leaves it: rectified pair, disparity, floor map."""
        ground, forward, left, depth = self._ground, self._forward, self._left, self._depth.copy()
        image = np.full((240, 320, 3), 170.0) + 20 * np.sin(np.arange(320) / 9)[None, :, None]
        rows = ((forward + driven_mm) / 15).astype(int) % 700
        shade = 1 + self.pattern / 120 * self._pattern[rows, self._columns]
        image[ground] = (np.array(self.floor) * shade[..., None])[ground]
        floor, obstacle = ground & (depth < 4000), np.zeros((240, 320), np.bool_)
        obstacle |= ~ground
        for thing in sorted(self.things, key=lambda t: -t.ahead_mm):
            self._paint(thing, thing.ahead_mm - driven_mm, image, depth, floor, obstacle, forward, left)
        pixels = np.asarray(np.clip(image * self.light + self._noise, 0, 255), np.uint8)
        captured_ns = number * PERIOD_NS
        bench = Bench()
        bench.put(StereoFrame(left=pixels, right=pixels, captured_ns=captured_ns, seq=number, geometry=GEOMETRY))
        bench.put(RectifiedPair(left=pixels, right=pixels, geometry=GEOMETRY, captured_ns=captured_ns, seq=number))
        bench.put(FloorMap(floor=floor, obstacle=obstacle, horizon_row=48.0, captured_ns=captured_ns))
        disparity = np.asarray(300 * 50 / depth, np.float32)
        bench.put(DisparityMap(disparity_px=disparity, geometry=GEOMETRY, captured_ns=captured_ns))
        return bench

    def _paint(
        self,
        thing: Thing,
        ahead_mm: float,
        image: npt.NDArray[np.float64],
        depth: npt.NDArray[np.float64],
        floor: npt.NDArray[np.bool_],
        obstacle: npt.NDArray[np.bool_],
        forward: npt.NDArray[np.float64],
        left: npt.NDArray[np.float64],
    ) -> None:
        if thing.height_mm == 0:
            on = (forward >= ahead_mm) & (forward <= ahead_mm + thing.length_mm) & (forward > 0)
            image[on & (np.abs(left - thing.left_mm) <= thing.width_mm / 2)] = thing.colour
            return
        if ahead_mm <= 50:
            return
        far = ahead_mm / self.level  # depth at which each pixel's ray meets the board's plane
        height, side = POSE.z_mm + far * self.up, -far * self.right
        on = (height >= 0) & (height <= thing.height_mm) & (np.abs(side - thing.left_mm) <= thing.width_mm / 2)
        image[on] = thing.colour
        depth[on] = far[on]
        high = on & (height > 60)
        floor[high], obstacle[high] = False, True


def drive(
    stage: Processor, world: World, start_mm: float, end_mm: float, step_mm: float = 500 / 15
) -> list[tuple[float, RangeReading]]:
    """(driven, reading) of each picture on the way."""
    found = []
    for number, driven_mm in enumerate(np.arange(start_mm, end_mm, step_mm), start=1):
        (reading,) = stage.process(world.see(float(driven_mm), number))
        assert isinstance(reading, RangeReading)
        found.append((float(driven_mm), reading))
    return found


def stand(stage: Processor, world: World, pictures: int = 8, first: int = 1) -> RangeReading:
    """The reading after standing for so many pictures."""
    bench = world.see(0.0, first)
    for number in range(first, first + pictures):
        for kind in (StereoFrame, RectifiedPair, FloorMap, DisparityMap):
            item = bench.get(kind)
            assert item is not None
            numbered = {"seq": number} if hasattr(item, "seq") else {}
            bench.put(replace(item, captured_ns=number * PERIOD_NS, **numbered))
        (reading,) = stage.process(bench)
    assert isinstance(reading, RangeReading)
    return reading


@pytest.fixture
def context(tmp_path: Path) -> Context:
    return Context(lane="front", run_dir=tmp_path, chair_dir=tmp_path, pose=POSE, footprint=FOOTPRINT)


@pytest.fixture
def stage(context: Context) -> Processor:
    return make(VisionObstacleSettings(), context)


@pytest.fixture
def worlds() -> SimpleNamespace:
    """World, Thing, drive and stand, for tests (a conftest cannot be imported)."""
    return SimpleNamespace(World=World, Thing=Thing, drive=drive, stand=stand, geometry=GEOMETRY, pose=POSE)

"""The simulated flat driven through offline: the stop distance is told in time, wherever in the way the thing stands.

What a chair meets in the demo, rendered along straight lines, without processes or clock: what a set of single pictures
cannot show is that a thing which stands a little in the way goes out of the pictures sideways before it is near.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from math import cos, radians, sin
from pathlib import Path

import numpy as np
import pytest

from chairward.components import Bench, Context, Footprint, Pose
from chairward.messages import RangeReading
from chairward.stages import StereoFrame
from chairward_simulator.home import PERSON_RADIUS_MM, Home, Obstacle, load, obstacles
from chairward_simulator.nearness import ahead
from chairward_simulator.scene import StereoCamera, person_cylinders
from chairward_stereo_range.settings import StereoRangeSettings
from chairward_stereo_range.stage import StereoRange

FOOTPRINT = Footprint(front_mm=450.0, rear_mm=450.0, half_width_mm=300.0)
MOUNT = Pose(x_mm=450.0, z_mm=400.0)
PERIOD_NS = 65_000_000
STEP_MM = 32.5
"""500 mm/s."""
STOP_MM = 600


@dataclass(frozen=True)
class Look:
    """One picture of a drive: the truth from the world itself, and what the stage said."""

    truth_mm: float
    reading: RangeReading


Drive = Callable[..., Iterator[Look]]


@pytest.fixture(scope="module")
def flat() -> Home:
    return load()


@pytest.fixture
def drive(flat: Home, tmp_path: Path) -> Drive:
    """Straight on: the front edge's middle passes `aside_mm` left of the point `at`, from `start_mm` before it on."""

    def driven(
        at: tuple[float, float], heading_deg: float, aside_mm: float = 0.0, start_mm: float = 1000.0,
        end_mm: float = 400.0, person: tuple[float, float] | None = None,
    ) -> Iterator[Look]:  # fmt: skip
        camera = StereoCamera(flat, MOUNT)
        context = Context(lane="front", run_dir=tmp_path, chair_dir=tmp_path, pose=MOUNT, footprint=FOOTPRINT)
        stage = StereoRange(StereoRangeSettings(panes=False), context)
        people = [] if person is None else [person_cylinders(camera.scene, *person, 90.0, 0.0)]
        things = [*obstacles(flat), *([] if person is None else [Obstacle("person", (person,), PERSON_RADIUS_MM)])]
        c, s = cos(radians(heading_deg)), sin(radians(heading_deg))
        for i, to_go in enumerate(np.arange(start_mm, end_mm, -STEP_MM)):
            back = float(to_go) + FOOTPRINT.front_mm
            x, y = at[0] - back * c - aside_mm * s, at[1] - back * s + aside_mm * c
            left, right = camera.pair(x, y, heading_deg, people)
            bench = Bench()
            bench.put(
                StereoFrame(
                    left=left, right=right, captured_ns=(i + 1) * PERIOD_NS, seq=i + 1, geometry=camera.geometry
                )
            )
            [reading] = stage.process(bench)
            assert isinstance(reading, RangeReading)
            yield Look(ahead(things, (x, y, heading_deg), FOOTPRINT)[0], reading)

    return driven


def near(look: Look) -> bool:
    """Whether the chair is stopped by it."""
    return not look.reading.can_see or (look.reading.ahead_mm or 0) <= STOP_MM


BOX, CORNER_WALL = (9400.0, 2200.0), (8870.0, 3814.0)


@pytest.mark.parametrize(
    ("at", "heading_deg", "aside_mm"),
    [
        pytest.param(BOX, 0.0, 0.0, id="a box ahead"),
        pytest.param(BOX, 0.0, -580.0, id="a box, of which 20 mm stand in the way on the left"),
        pytest.param(BOX, 0.0, 580.0, id="a box, of which 20 mm stand in the way on the right"),
        pytest.param(BOX, 6.0, -600.0, id="a box's corner on the left, aslant"),
        pytest.param(BOX, -6.0, 600.0, id="a box's corner on the right, aslant"),
        pytest.param(CORNER_WALL, 45.0, 0.0, id="a wall"),
        pytest.param(CORNER_WALL, 60.0, 0.0, id="a wall, aslant"),
    ],
)
def test_the_stop_distance_is_told_in_time(
    drive: Drive, at: tuple[float, float], heading_deg: float, aside_mm: float
) -> None:
    looks = list(drive(at, heading_deg, aside_mm))
    first = next((i for i, look in enumerate(looks) if near(look)), None)
    assert first is not None, [(round(look.truth_mm), look.reading.ahead_mm) for look in looks]
    assert 520.0 <= looks[first].truth_mm <= 660.0, "a chair that stops from there stands well before it"
    assert all(near(look) for look in looks[first:]), "and it is not taken back while the chair goes on"


def test_a_person_who_stands_half_in_the_way_is_told_in_time(drive: Drive) -> None:
    for aside_mm in (-400.0, 400.0):
        at = (7900.0, 2250.0)
        looks = list(drive((at[0] - PERSON_RADIUS_MM, at[1]), 0.0, aside_mm, person=at))
        first = next(look for look in looks if near(look))
        assert 500.0 <= first.truth_mm <= 660.0, aside_mm


def test_a_doorway_that_is_wide_enough_is_not_held_against_the_chair(drive: Drive) -> None:
    for aside_mm in (-50.0, 50.0):
        looks = list(drive((5100.0, 2250.0), 0.0, aside_mm, start_mm=950.0, end_mm=-100.0))
        assert min(look.truth_mm for look in looks) > 1000.0
        assert not any(near(look) for look in looks), aside_mm

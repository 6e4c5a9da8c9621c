"""The home file: what comes along is sound, and a wrong one is one sentence with file and key."""

from __future__ import annotations

import pytest

from chairward_simulator.home import HOME_FILE, HomeError, load, obstacles, wall_as_box
from chairward_simulator.nearness import touching


def test_the_home_has_all_that_the_demo_promises(home, footprint) -> None:
    names = {thing.name for thing in obstacles(home)}
    assert {"corner wall", "cardboard box", "step down", "plain wall", "sofa"} <= names
    assert home.person is not None
    assert {leg.do for leg in home.tour} >= {"through", "drive_until", "turn", "say"}
    start = (home.start.x_mm, home.start.y_mm, home.start.heading_deg)
    assert touching(obstacles(home), start, footprint) == ""


def test_the_doorway_is_81_cm_wide_between_its_walls(home) -> None:
    door = home.door("doorway")
    edges = [wall_as_box(wall, home.ceiling_mm) for wall in home.wall if wall.name.startswith("door wall")]
    south, north = sorted(edges, key=lambda box: box.at[1])
    lower = south.at[1] + south.size[0] / 2
    upper = north.at[1] - north.size[0] / 2
    assert upper - lower == pytest.approx(door.width_mm) == 810.0
    assert (upper + lower) / 2 == pytest.approx(door.at[1])


@pytest.mark.parametrize(
    ("was", "becomes", "says"),
    [
        ("radius = 30", "radius = nan", "radius"),
        ("radius = 30", "width = 30", "cylinder"),
        ('stopped_by = "corner wall"', 'stopped_by = "moon"', "nothing is named 'moon'"),
        ('do = "through"\ndoorway = "doorway"', 'do = "through"\ndoorway = "hatch"', "no doorway 'hatch'"),
        ('do = "turn"', 'do = "fly"', "tour"),
        ("ceiling_mm = 2500", "ceiling_mm = 2500 mm", "cannot be read"),
    ],
)
def test_a_wrong_home_file_is_one_sentence_with_file_and_key(tmp_path, was, becomes, says) -> None:
    path = tmp_path / "home.toml"
    text = HOME_FILE.read_text("utf-8")
    assert was in text
    path.write_text(text.replace(was, becomes, 1), "utf-8")
    with pytest.raises(HomeError) as raised:
        load(path)
    sentence = str(raised.value)
    assert sentence.startswith(f"{path}: ")
    assert says in sentence
    assert "\n" not in sentence


def test_a_missing_home_file_is_named(tmp_path) -> None:
    with pytest.raises(
        HomeError, match=r"nowhere\.toml: cannot be read as a home \(No such file or directory\): check the path"
    ):
        load(tmp_path / "nowhere.toml")

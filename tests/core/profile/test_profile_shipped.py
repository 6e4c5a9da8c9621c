"""Every profile that is shipped loads, is proven, and keeps what it promises."""

from __future__ import annotations

import re
from itertools import product
from pathlib import Path

import pytest

from chairward import plan, profile
from chairward.plan import ChairKind
from chairward.plugins import Registry, discover
from chairward.profile import files, lanes
from chairward.profile.load import check_chair, read_chair, read_person
from chairward.profile.models import PROTECTED_MM

PROFILES = Path(__file__).resolve().parents[3] / "profiles"
CHAIRS, PEOPLE = files.names("chairs", PROFILES), files.names("people", PROFILES)
FITTING = [
    (chair, person)
    for chair, person in product(CHAIRS, PEOPLE)
    if chair in read_person(files.read(PROFILES / "people" / f"{person}.toml")).chairs
]


@pytest.fixture(scope="module")
def registry() -> Registry:
    return discover()


def test_the_profiles_that_were_promised_are_there() -> None:
    assert {"sim", "prototype", "rnet", "files"} <= set(CHAIRS)
    assert {"demo", "thesis", "asha", "careful"} <= set(PEOPLE)
    assert {person for _, person in FITTING} == set(PEOPLE)


@pytest.mark.parametrize("chair", CHAIRS)
def test_every_chair_is_right_by_itself(chair: str, registry: Registry) -> None:
    assert check_chair(files.read(PROFILES / "chairs" / f"{chair}.toml"), registry).proof.nearest_mm >= PROTECTED_MM


@pytest.mark.parametrize(("chair", "person"), FITTING)
def test_every_person_fits_the_chairs_they_name(chair: str, person: str, registry: Registry, tmp_path: Path) -> None:
    loaded = profile.load_traced(chair, person, [], registry, PROFILES)
    assert loaded.proof.nearest_mm >= PROTECTED_MM
    assert loaded.plan.limits.stop_mm >= 600
    assert "stop" in loaded.plan.words.values()
    assert loaded.plan.limits.stop_devices
    plan.write(loaded.plan, tmp_path / "plan.json")
    assert plan.read(tmp_path / "plan.json") == loaded.plan


def test_every_component_can_take_its_settings_from_the_plan(registry: Registry, tmp_path: Path) -> None:
    for chair, person in FITTING:
        loaded = profile.load_traced(chair, person, [], registry, PROFILES).plan
        wanted = [(registry.get("drive", loaded.drive.component), loaded.drive)]
        for lane in loaded.lanes:
            wanted.append((registry.get("source", lane.source.component), lane.source))
            wanted += [(registry.stage(stage.component)[1], stage) for stage in lane.stages]
        wanted += [(registry.get("companion", part.component), part) for part in loaded.companions.values()]
        for component, part in wanted:
            made = component.settings.model_validate(plan.fill_run_dir(part.settings, tmp_path))
            assert "{run}" not in str(made)


def test_the_chair_for_people_is_stricter_than_the_others() -> None:
    chair = read_chair(files.read(PROFILES / "chairs" / "rnet.toml"))
    assert chair.kind is ChairKind.CHAIR
    assert chair.hardware_stop
    assert chair.limits.steer_deg_s == 0
    assert chair.limits.crawl_mm_s == 0
    assert chair.stopping.slope_percent > 0
    assert chair.drive["can"]["rnet"]["takeover"] == "listen"


def test_thesis_methods_are_in_no_chair_that_is_not_called_so() -> None:
    for name in CHAIRS:
        chair = read_chair(files.read(PROFILES / "chairs" / f"{name}.toml"))
        uses = any(str(v).startswith("thesis") for table in chair.settings.values() for v in table.values())
        assert uses == (name == "thesis")


def test_the_same_person_is_never_faster_or_nearer_than_the_chair_allows(registry: Registry) -> None:
    for chair, person in FITTING:
        limits = profile.load_traced(chair, person, [], registry, PROFILES).plan.limits
        bounds = read_chair(files.read(PROFILES / "chairs" / f"{chair}.toml")).limits
        assert limits.forward_mm_s <= bounds.forward_mm_s
        assert limits.caps.forward_mm_s <= bounds.forward_mm_s
        assert limits.stop_mm >= bounds.stop_mm


def test_stages_of_the_shipped_chairs_cannot_be_swapped_unnoticed(registry: Registry) -> None:
    """Where an order matters it is either checked by types, or the chair says so by name (thesis)."""
    orders = {}
    for name in CHAIRS:
        chair = read_chair(files.read(PROFILES / "chairs" / f"{name}.toml"))
        lanes.find(chair, registry, name)
        orders[name] = chair.lane["front"].stages
    assert orders.pop("thesis") == ["vision_obstacle", "stereo_range"]
    assert all(order == ["stereo_range", "vision_obstacle"] for order in orders.values())


def test_no_shipped_profile_names_a_place_on_one_machine() -> None:
    for path in PROFILES.glob("*/*.toml"):
        assert re.findall(r"""["'](/(?!dev/)[^"']*)""", path.read_text(encoding="utf-8")) == [], path

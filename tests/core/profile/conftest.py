"""A small house of profiles: one chair, one person, and components that need no plugin."""

from __future__ import annotations

import copy
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Annotated, Any, Literal

import pytest
import tomlkit
from pydantic import Field, model_validator

from chairward import profile
from chairward.components import Component, DriveSettings, NoSettings, Settings
from chairward.facts import Limits
from chairward.hookspecs import hookimpl
from chairward.messages import Alive, Intent, Press, RangeReading, Stick, Veto
from chairward.plan import Plan
from chairward.plugins import Registry, discover
from chairward.profile import Safer
from chairward.stages import AudioBlock, FloorMap, ObstacleMap, StereoFrame


class EyesSettings(Settings):
    kind: Literal["live", "manifest"] = "live"
    manifest: Path | None = None
    pair: tuple[Path, Path] | None = None


class RangeSettings(Settings):
    method: Literal["sgbm", "bm", "thesis_code"] = "sgbm"
    truth: Path | None = None
    minimum: Annotated[int, Safer.HIGHER, Field(ge=0, le=100)] = 10
    window: int = Field(default=9, ge=3, le=31)


class EarsSettings(Settings):
    engine: Literal["default", "thesis_text"] = "default"
    speaker: str = ""
    threshold: float = Field(default=0.0, ge=-5, le=20)

    def unfit_to_ride(self) -> tuple[str, str] | None:
        return ("threshold", "hears too much: choose more") if self.threshold < -4.0 else None


class WheelSettings(DriveSettings):
    port: str
    rate: int = Field(default=57600, ge=1)
    full_speed_mm_s: float = 500.0
    decel_mm_s2: float = 1000.0


class NestedSettings(Settings):
    takeover: Literal["listen", "follow"] = "listen"
    device: int = Field(default=1, ge=0, le=15)


class BusSettings(DriveSettings):
    channel: str = "can0"
    rnet: NestedSettings = NestedSettings()

    @model_validator(mode="after")
    def _complete(self) -> BusSettings:
        if self.channel == "none":
            raise ValueError("channel = 'none' needs a bridge")
        return self


def component(
    name: str, settings: type[Settings] = NoSettings, needs: Sequence[type] = (), gives: Sequence[type] = ()
) -> Component:
    return Component(name=name, settings=settings, make=lambda s, c: None, needs=needs, gives=gives)


class Offers:
    """The components of the test chair."""

    CHAIRWARD_API = 1

    @hookimpl
    def chairward_sources(self) -> Sequence[Component]:
        return [
            component("eyes", EyesSettings, gives=(StereoFrame,)),
            component("sim_eyes", gives=(StereoFrame,)),
            component("ears", EarsSettings, gives=(AudioBlock,)),
            component("button", gives=(Press, Alive)),
            component("sonar", gives=(RangeReading,)),
            component("tilt", gives=(Veto,)),
            component("clap", gives=(Intent, Alive)),
            component("stick", gives=(Stick, Alive, Press)),
        ]

    @hookimpl
    def chairward_sensors(self) -> Sequence[Component]:
        return [
            component("ranger", RangeSettings, needs=(StereoFrame,), gives=(FloorMap, RangeReading)),
            component("mapper", needs=(StereoFrame, FloorMap), gives=(ObstacleMap,)),
            component("guardian", needs=(ObstacleMap,), gives=(RangeReading, Veto)),
        ]

    @hookimpl
    def chairward_recognizers(self) -> Sequence[Component]:
        return [component("words", EarsSettings, needs=(AudioBlock,), gives=(Intent, Alive))]

    @hookimpl
    def chairward_drives(self) -> Sequence[Component]:
        return [component("wheels", WheelSettings), component("bus", BusSettings)]

    @hookimpl
    def chairward_companions(self) -> Sequence[Component]:
        return [component("puppet", EarsSettings)]

    @hookimpl
    def chairward_observers(self) -> Sequence[Component]:
        return [component("diary", EyesSettings)]


CHAIR: dict[str, Any] = {
    "name": "test",
    "kind": "robot",
    "person": "asha",
    "footprint": {"front_mm": 450, "rear_mm": 450, "half_width_mm": 300},
    "limits": {"forward_mm_s": 500},
    "stopping": {"decel_mm_s2": 600},
    "lane": {
        "front": {"source": "eyes", "stages": ["ranger", "mapper"], "freshness_ms": 200, "covers": ["ahead", "left"]},
        "voice": {"source": "ears", "stages": ["words"], "freshness_ms": 400},
        "panel": {"source": "button", "stop_device": True, "may": ["stop", "arm"], "freshness_ms": 300},
    },
    "drive": {
        "wheels": {"port": "/dev/ttyUSB0", "silence_stop_ms": 90, "silence_stop_measured": "2026-11-22"},
        "bus": {"watchdog_relay": "K1"},
    },
}
PERSON: dict[str, Any] = {
    "name": "asha",
    "chair": ["test"],
    "drive": "wheels",
    "words": {"go": "front", "stop": "stop"},
}


class House:
    """A profiles folder with chairs/test.toml and people/asha.toml, written anew from `chair` and `person`."""

    def __init__(self, folder: Path, registry: Registry) -> None:
        self.folder, self.registry = folder, registry
        self.chair, self.person = copy.deepcopy(CHAIR), copy.deepcopy(PERSON)
        for kind in ("chairs", "people"):
            (folder / kind).mkdir(parents=True)

    @property
    def chair_file(self) -> Path:
        return self.folder / "chairs" / "test.toml"

    @property
    def person_file(self) -> Path:
        return self.folder / "people" / "asha.toml"

    def write(self) -> None:
        self.chair_file.write_text(tomlkit.dumps(self.chair), encoding="utf-8")
        self.person_file.write_text(tomlkit.dumps(self.person), encoding="utf-8")

    def traced(self, *sets: str) -> profile.Loaded:
        self.write()
        return profile.load_traced("test", "asha", sets, self.registry, self.folder)

    def load(self, *sets: str) -> Plan:
        self.write()
        return profile.load("test", "asha", sets, self.registry, self.folder)

    def refused(self, *sets: str) -> str:
        """The sentence that refuses these profiles."""
        with pytest.raises(profile.ProfileError) as caught:
            self.load(*sets)
        assert "\n" not in str(caught.value)
        return str(caught.value)

    def ridden(self) -> None:
        """Make it a chair somebody sits in."""
        self.chair |= {"kind": "chair", "hardware_stop": "red switch on the armrest"}


@pytest.fixture(scope="session")
def offers() -> Registry:
    registry = discover([], {"offers": Offers()})
    assert not registry.refused
    return registry


@pytest.fixture
def house(tmp_path: Path, offers: Registry) -> House:
    return House(tmp_path / "profiles", offers)


@pytest.fixture(scope="session")
def limits_of_person(offers: Registry, tmp_path_factory: pytest.TempPathFactory) -> Callable[[dict[str, Any]], Limits]:
    """limits of a person file -> the Limits of the whole plan. Raises ProfileError."""
    house = House(tmp_path_factory.mktemp("law") / "profiles", offers)
    house.chair["limits"] |= {"steer_deg_s": 8, "crawl_mm_s": 60, "lease_s": 7}

    def limits(of_person: dict[str, Any]) -> Limits:
        house.person["limits"] = of_person
        return house.load().limits

    return limits


@pytest.fixture(scope="module")
def house_of_module(offers: Registry, tmp_path_factory: pytest.TempPathFactory) -> House:
    """As `house`, one for all tests of a module."""
    return House(tmp_path_factory.mktemp("module") / "profiles", offers)

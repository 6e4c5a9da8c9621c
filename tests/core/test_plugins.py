"""Plugins: each on its own; one that fails is refused by name and the rest goes on."""

from __future__ import annotations

from collections.abc import Sequence
from importlib.metadata import EntryPoint
from types import SimpleNamespace
from typing import Any

import pytest

from chairward.components import Component, NoSettings
from chairward.hookspecs import hookimpl
from chairward.plugins import PluginError, discover


def offering(name: str, api: object = 1) -> Any:
    class Plugin:
        CHAIRWARD_API = api

        @hookimpl
        def chairward_sources(self) -> Sequence[Component]:
            return [Component(name=name, settings=NoSettings, make=lambda s, c: None)]

    return Plugin()


class Raising:
    CHAIRWARD_API = 1

    @hookimpl
    def chairward_sensors(self) -> Sequence[Component]:
        raise RuntimeError("no such luck")


class Mistyped:
    CHAIRWARD_API = 1

    @hookimpl
    def chairward_sourcess(self) -> Sequence[Component]:
        return []


class WrongThing:
    CHAIRWARD_API = 1

    @hookimpl
    def chairward_sources(self) -> Sequence[Any]:
        return ["sonar"]


def test_a_plugin_that_raises_is_refused_by_name_and_the_rest_goes_on() -> None:
    registry = discover([], {"good": offering("a"), "bad": Raising(), "later": offering("b")})
    assert set(registry.components["source"]) == {"a", "b"}
    assert [(r.plugin, "no such luck" in r.reason) for r in registry.refused] == [("bad", True)]


@pytest.mark.parametrize(
    ("plugin", "says"),
    [
        (Mistyped(), "chairward_sourcess"),
        (WrongThing(), "gave str"),
        (offering("x", api=2), "was written for API 2"),
        (SimpleNamespace(), "says no CHAIRWARD_API"),
    ],
)
def test_a_wrong_plugin_is_refused_with_its_reason(plugin: Any, says: str) -> None:
    registry = discover([], {"bad": plugin, "good": offering("a")})
    assert says in registry.refused[0].reason
    assert "a" in registry.components["source"]


def test_a_plugin_that_cannot_be_imported_is_refused_by_name() -> None:
    point = EntryPoint(name="broken", value="chairward_not_installed.plugin", group="chairward.plugins")
    registry = discover([point])
    assert "ModuleNotFoundError" in registry.refused[0].reason
    with pytest.raises(PluginError, match="was refused"):
        registry.get("source", "broken")


def test_two_plugins_cannot_offer_the_same_component() -> None:
    registry = discover([], {"first": offering("a"), "second": offering("a")})
    assert registry.origin["source a"] == "first"
    assert "already offered by first" in registry.refused[0].reason


def test_a_sensor_cannot_take_a_recognizers_name_so_that_its_vote_would_vanish() -> None:
    class Recognizer:
        CHAIRWARD_API = 1

        @hookimpl
        def chairward_recognizers(self) -> Sequence[Component]:
            return [Component(name="ears", settings=NoSettings, make=lambda s, c: None)]

    class Usurper:
        CHAIRWARD_API = 1

        @hookimpl
        def chairward_sensors(self) -> Sequence[Component]:
            return [Component(name="ears", settings=NoSettings, make=lambda s, c: None)]

    registry = discover([], {"first": Recognizer(), "second": Usurper()})
    assert registry.stage("ears")[0] == "recognizer"
    assert "already offered by first" in registry.refused[0].reason


def test_a_component_nobody_offers_is_an_error_that_lists_what_there_is() -> None:
    registry = discover([], {"good": offering("a")})
    with pytest.raises(PluginError, match=r"no plugin offers a source named 'b' \(installed: a\)"):
        registry.get("source", "b")
    with pytest.raises(PluginError, match="no plugin offers a stage named 'b'"):
        registry.stage("b")

"""Finding plugins and the components they offer.

Each plugin is registered on its own: one that cannot be imported, was written for another API, or raises while it
registers is refused by name and the rest goes on. Whether the chair may then drive is the chair file's decision:
a component that it names and nobody offers is an error with the reason.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from importlib.metadata import EntryPoint, entry_points
from typing import Any

import pluggy

from chairward import API_VERSION, hookspecs
from chairward.components import Component

KINDS = ("source", "sensor", "recognizer", "drive", "observer", "companion")


class PluginError(ValueError):
    """A component that is asked for is not there: one sentence with the reason and what to do."""


@dataclass(frozen=True, slots=True)
class Refused:
    """A plugin that is not in use, and why."""

    plugin: str
    reason: str


@dataclass(slots=True)
class Registry:
    """All components by kind and name, where they come from, and which plugins were refused."""

    manager: pluggy.PluginManager
    components: dict[str, dict[str, Component]] = field(default_factory=lambda: {k: {} for k in KINDS})
    origin: dict[str, str] = field(default_factory=dict)
    refused: list[Refused] = field(default_factory=list)

    def get(self, kind: str, name: str) -> Component:
        """The component `name` of `kind`. Raises PluginError, naming what was refused or what there is."""
        if found := self.components[kind].get(name):
            return found
        for refusal in self.refused:
            if refusal.plugin == name:
                raise PluginError(f"{kind} '{name}': its plugin was refused: {refusal.reason}")
        known = ", ".join(sorted(self.components[kind])) or "none"
        raise PluginError(
            f"no plugin offers a {kind} named '{name}' (installed: {known}): install the plugin or correct the name"
        )

    def stage(self, name: str) -> tuple[str, Component]:
        """("sensor" or "recognizer", component) of a lane's stage. Raises PluginError."""
        for kind in ("sensor", "recognizer"):
            if found := self.components[kind].get(name):
                return kind, found
        for refusal in self.refused:
            if refusal.plugin == name:
                raise PluginError(f"stage '{name}': its plugin was refused: {refusal.reason}")
        known = ", ".join(sorted([*self.components["sensor"], *self.components["recognizer"]])) or "none"
        raise PluginError(
            f"no plugin offers a stage named '{name}' (installed: {known}): install it or correct the name"
        )


def discover(points: Iterable[EntryPoint] | None = None, extra: Mapping[str, Any] | None = None) -> Registry:
    """Load every installed plugin (or the given entry points, plus `extra` objects) and ask it what it offers."""
    manager = pluggy.PluginManager(hookspecs.PROJECT)
    manager.add_hookspecs(hookspecs)
    registry = Registry(manager)
    found = entry_points(group=hookspecs.ENTRY_POINT_GROUP) if points is None else points
    for point in sorted(found, key=lambda p: p.name):
        try:
            plugin = point.load()
        except Exception as error:  # noqa: BLE001 - any third party's import may fail in any way; refused by name
            registry.refused.append(Refused(point.name, f"cannot be imported: {type(error).__name__}: {error}"))
            continue
        _register(registry, point.name, plugin)
    for name, plugin in (extra or {}).items():
        _register(registry, name, plugin)
    return registry


def discover_only(plugins: Iterable[str]) -> Registry:
    """Load just these plugins (entry point names): a process of a run imports nobody else's code."""
    wanted = set(plugins)
    return discover([point for point in entry_points(group=hookspecs.ENTRY_POINT_GROUP) if point.name in wanted])


def _register(registry: Registry, name: str, plugin: Any) -> None:
    """Check the API version and the hooks' names, then collect; refuse by name on any failure."""
    version = getattr(plugin, "CHAIRWARD_API", None)
    if version != API_VERSION:
        wrote = "says no CHAIRWARD_API" if version is None else f"was written for API {version}"
        registry.refused.append(Refused(name, f"{wrote}, this is API {API_VERSION}: get a matching version"))
        return
    try:
        registry.manager.register(plugin, name)
        registry.manager.check_pending()
        offered = {kind: _offered(registry, plugin, kind) for kind in KINDS}
    except Exception as error:  # noqa: BLE001 - a hook of a third party may raise anything; refused by name
        if registry.manager.has_plugin(name):
            registry.manager.unregister(name=name)
        registry.refused.append(Refused(name, f"failed to register: {type(error).__name__}: {error}"))
        return
    for kind, components in offered.items():
        for component in components:
            registry.components[kind][component.name] = replace(component, plugin=name)
            registry.origin[f"{kind} {component.name}"] = name


def _offered(registry: Registry, plugin: Any, kind: str) -> Sequence[Component]:
    """The components of one kind that this plugin alone offers; a name already taken is an error."""
    hook = registry.manager.subset_hook_caller(
        f"chairward_{kind}s", [p for p in registry.manager.get_plugins() if p is not plugin]
    )
    components = [component for group in hook() for component in group]
    taken = {other: k for k in _same_names(kind) for other in registry.components[k]}
    for component in components:
        if not isinstance(component, Component):
            raise TypeError(f"chairward_{kind}s gave {type(component).__name__}, not chairward.components.Component")
        if other := taken.get(component.name):
            origin = registry.origin.get(f"{other} {component.name}", "itself")
            raise ValueError(f"{kind} '{component.name}' is already offered by {origin}")
        taken[component.name] = kind
    return components


def _same_names(kind: str) -> Sequence[str]:
    """Kinds that share their names: a lane's stage must not turn from a recognizer into a sensor, say."""
    return ("sensor", "recognizer") if kind in ("sensor", "recognizer") else (kind,)

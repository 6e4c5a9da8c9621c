"""What this plugin offers: registered once, at start, without touching a device."""

from __future__ import annotations

from collections.abc import Sequence

from chairward.components import Component, Context, Source
from chairward.hookspecs import hookimpl
from chairward.messages import Alive, Intent, Press
from chairward_keys.settings import KeysSettings

CHAIRWARD_API = 1


def make(settings: KeysSettings, context: Context) -> Source:
    """The source; nothing is opened yet."""
    from chairward_keys.source import Keys

    return Keys(settings, context.run_dir)


@hookimpl
def chairward_sources() -> Sequence[Component]:
    """One source: a keyboard or switch as stop device and held switch."""
    return [
        Component(
            name="keys",
            settings=KeysSettings,
            make=make,
            gives=(Press, Intent, Alive),
            summary="a keyboard or switch as stop device, arm and reset buttons, and held commands",
        )
    ]

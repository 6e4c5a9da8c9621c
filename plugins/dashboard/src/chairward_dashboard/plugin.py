"""What this plugin offers: registered once, at start, without touching a device."""

from __future__ import annotations

from collections.abc import Sequence

from chairward.components import Component, Context, Source
from chairward.hookspecs import hookimpl
from chairward.messages import Alive, Intent, Press
from chairward_dashboard.settings import DashboardSettings

CHAIRWARD_API = 1


def make(settings: DashboardSettings, context: Context) -> Source:
    """The source; nothing is opened yet."""
    from chairward_dashboard.source import Dashboard

    return Dashboard(settings, context)


@hookimpl
def chairward_sources() -> Sequence[Component]:
    """One source: the screen, as what shows everything and as a stop device."""
    return [
        Component(
            name="dashboard",
            settings=DashboardSettings,
            make=make,
            gives=(Press, Intent, Alive),
            summary="a web page that shows what the chair sees and does, and is a stop device with arm and reset",
        )
    ]

"""What the core itself offers, registered like any other plugin."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

from chairward.components import Component, Context
from chairward.hookspecs import hookimpl
from chairward.recording import Recorder, RecorderSettings

if TYPE_CHECKING:
    from chairward.doctor import Check

CHAIRWARD_API = 1


def _recorder(settings: RecorderSettings, context: Context) -> Recorder:
    return Recorder(settings, context)


@hookimpl
def chairward_observers() -> Sequence[Component]:
    """The recorder."""
    return [
        Component(name="recorder", settings=RecorderSettings, make=_recorder, summary="every decision in an MCAP file")
    ]


@hookimpl
def chairward_checks() -> Sequence[Check]:
    """The machine and the chair as a whole."""
    from chairward.doctor.machine import checks

    return checks()

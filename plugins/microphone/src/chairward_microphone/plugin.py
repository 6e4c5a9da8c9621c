"""What this plugin offers: registered once, at start, without touching a device."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

from chairward.components import Component, Context
from chairward.hookspecs import hookimpl
from chairward.stages import AudioBlock
from chairward_microphone.settings import MicrophoneSettings

if TYPE_CHECKING:
    from chairward.doctor import Check

CHAIRWARD_API = 1


def _make(settings: MicrophoneSettings, context: Context) -> object:
    if settings.kind == "live":
        from chairward_microphone.live import LiveMicrophone

        return LiveMicrophone(settings)
    from chairward_microphone.recorded import RecordedSound

    return RecordedSound(settings, context)


@hookimpl
def chairward_sources() -> Sequence[Component]:
    """The microphone."""
    return [
        Component(
            name="microphone",
            settings=MicrophoneSettings,
            make=_make,
            gives=(AudioBlock,),
            summary="a sound card's microphone, or recorded sound",
        )
    ]


@hookimpl
def chairward_checks() -> Sequence[Check]:
    """The microphone."""
    from chairward_microphone.checks import checks

    return checks()

"""What this plugin offers: registered once, at start, without touching a device or compiling anything."""

from __future__ import annotations

from collections.abc import Sequence

import typer

from chairward.components import Component, Context
from chairward.hookspecs import hookimpl
from chairward.messages import Alive, Intent
from chairward.stages import AudioBlock
from chairward_voice_dtw.settings import VoiceSettings

CHAIRWARD_API = 1


def _make(settings: VoiceSettings, context: Context) -> object:
    from chairward_voice_dtw.stage import VoiceStage

    return VoiceStage(settings, context)


@hookimpl
def chairward_recognizers() -> Sequence[Component]:
    """The word recogniser."""
    return [
        Component(
            name="voice_dtw",
            settings=VoiceSettings,
            make=_make,
            needs=(AudioBlock,),
            gives=(Intent, Alive),
            summary="a person's own words by dynamic time warping",
        )
    ]


@hookimpl
def chairward_commands(app: typer.Typer) -> None:
    """`chairward words ...`"""
    from chairward_voice_dtw.cli import words

    app.add_typer(words, name="words")

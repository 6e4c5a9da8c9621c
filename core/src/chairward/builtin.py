"""What the core itself offers, registered like any other plugin."""

from __future__ import annotations

from collections.abc import Sequence

from chairward.call_help import CallHelp, CallHelpSettings
from chairward.check.hand import CheckHand
from chairward.components import Component, Context, NoSettings
from chairward.findings import Check
from chairward.hookspecs import hookimpl
from chairward.messages import Alive, Intent, Press, Veto
from chairward.recording import Recorder, RecorderSettings
from chairward.tilt import Tilt, TiltSettings

CHAIRWARD_API = 1


def _recorder(settings: RecorderSettings, context: Context) -> Recorder:
    return Recorder(settings, context)


def _call_help(settings: CallHelpSettings, context: Context) -> CallHelp:
    return CallHelp(settings, context)


def _hand(settings: NoSettings, context: Context) -> CheckHand:
    return CheckHand(settings, context)


def _tilt(settings: TiltSettings, _: Context) -> Tilt:
    return Tilt(settings)


@hookimpl
def chairward_sources() -> Sequence[Component]:
    """The hand of `chairward check`, and a tilt inhibit."""
    return [
        Component(
            name="check_hand",
            settings=NoSettings,
            make=_hand,
            gives=(Press, Intent, Alive),
            summary="the hand of chairward check; lifeless without it",
        ),
        Component(
            name="tilt", settings=TiltSettings, make=_tilt, gives=(Veto,), summary="stops a chair that leans too far"
        ),
    ]


@hookimpl
def chairward_observers() -> Sequence[Component]:
    """The recorder, and what is done outside when a person calls for help."""
    return [
        Component(name="recorder", settings=RecorderSettings, make=_recorder, summary="every decision in an MCAP file"),
        Component(
            name="call_help", settings=CallHelpSettings, make=_call_help, summary="starts a program on a call for help"
        ),
    ]


@hookimpl
def chairward_checks() -> Sequence[Check]:
    """The machine and the chair as a whole."""
    from chairward.doctor.machine import checks

    return checks()

"""What this plugin offers: registered once, at start, without touching a device."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import typer

from chairward.components import Component, Context
from chairward.hookspecs import hookimpl
from chairward.messages import Alive, Press
from chairward.stages import AudioBlock, StereoFrame
from chairward_simulator.settings import CameraSettings, HomeSettings, MicrophoneSettings, OperatorSettings

CHAIRWARD_API = 1


def _cameras(settings: CameraSettings, context: Context) -> Any:
    from chairward_simulator.camera import SimCameras

    return SimCameras(settings, context)


def _microphone(settings: MicrophoneSettings, context: Context) -> Any:
    from chairward_simulator.microphone import SimMicrophone

    return SimMicrophone(settings, context)


def _operator(settings: OperatorSettings, context: Context) -> Any:
    from chairward_simulator.panel import SimOperator

    return SimOperator(settings, context)


def _home(settings: HomeSettings, context: Context) -> Any:
    from chairward_simulator.world import SimHome

    return SimHome(settings, context)


@hookimpl
def chairward_sources() -> Sequence[Component]:
    """Cameras and microphone in the simulated home, and the stop device in the simulated person's hand."""
    return (
        Component(
            name="sim_cameras",
            settings=CameraSettings,
            make=_cameras,
            gives=(StereoFrame,),
            summary="stereo pair rendered from the simulated chair's pose",
        ),
        Component(
            name="sim_microphone",
            settings=MicrophoneSettings,
            make=_microphone,
            gives=(AudioBlock,),
            summary="room noise and the words of the simulated person",
        ),
        Component(
            name="sim_operator",
            settings=OperatorSettings,
            make=_operator,
            gives=(Alive, Press),
            summary="stop device of the simulated person: alive, arm, reset",
        ),
    )


@hookimpl
def chairward_companions() -> Sequence[Component]:
    """The simulated home itself."""
    return (
        Component(
            name="sim_home",
            settings=HomeSettings,
            make=_home,
            summary="a home with a chair whose body obeys the controller's pins, and people in it",
        ),
    )


@hookimpl
def chairward_commands(app: typer.Typer) -> None:  # noqa: ARG001 - joins the group that core already has
    """`chairward sim home` and `chairward sim ride`."""
    from chairward.cli import sim
    from chairward_simulator.commands import home, ride

    sim.app.command("home")(home)
    sim.app.command("ride")(ride)

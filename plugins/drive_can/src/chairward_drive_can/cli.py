"""`chairward can ...` and `chairward sim rnet|cia402|dbc`."""

from __future__ import annotations

import signal
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Annotated, Any

import typer

from chairward.components import DriveError

app = typer.Typer(name="can", no_args_is_help=True, help="CAN controllers: look at a bus or a recording of one.")

Interface = Annotated[str, typer.Option(help="slcan, or any of python-can's: socketcan, udp_multicast, ...")]
Channel = Annotated[str, typer.Option(help="can0, a serial port, a multicast group")]
Pins = Annotated[Path | None, typer.Option(help="publish the motors here, for 'chairward check drive --pins'")]
Seconds = Annotated[float, typer.Option("--for", help="stop after so many seconds; 0: Ctrl-C")]


@app.command()
def monitor(
    recording: Annotated[Path | None, typer.Argument(help="a recording (.log .asc .blf .csv ...); none: live")] = None,
    interface: Interface = "socketcan",
    channel: Channel = "can0",
    bitrate: Annotated[int, typer.Option(help="bit/s")] = 125_000,
    dialect: Annotated[str, typer.Option(help="rnet, cia402 or dbc")] = "rnet",
    dbc: Annotated[Path | None, typer.Option(help="the DBC file, for dialect dbc")] = None,
    log: Annotated[Path | None, typer.Option(help="write what is heard to this file too")] = None,
    seconds: Seconds = 0.0,
) -> None:
    """Print every frame with its meaning; listens only, never sends."""
    try:
        describe = _describer(dialect, dbc)
        frames = _recorded(recording) if recording else _live(interface, channel, bitrate, log, seconds)
        for at_s, frame in frames:
            typer.echo(f"{at_s:11.6f}  {frame!s:<28}{describe(frame)}".rstrip())
    except DriveError as error:
        typer.echo(f"chairward: {error}", err=True)
        raise typer.Exit(2) from None
    except KeyboardInterrupt:
        raise typer.Exit(0) from None


@app.command()
def takeovers() -> None:
    """The ways to an R-Net chair's motors, and what each risks."""
    from chairward_drive_can.takeover import MODES

    for mode in MODES.values():
        typer.echo(f"{mode.name}: {mode.what}\n    hazard: {mode.hazard}")
        if mode.accept:
            typer.echo(f"    accepted by: hazard_accepted = '{mode.accept}'")


def sim_rnet(
    interface: Interface = "slcan",
    channel: Channel = "rnet",
    silence_ms: Annotated[int, typer.Option(help="stops so long after the last joystick frame")] = 100,
    joystick: Annotated[bool, typer.Option(help="with the user's own joystick module")] = True,
    touch_every: Annotated[
        float, typer.Option(help="the user touches the joystick every so many seconds; 0: never")
    ] = 0,
    pins: Pins = None,
    seconds: Seconds = 0.0,
) -> None:
    """A simulated R-Net chair: power module and joystick module. slcan: makes a pty with a link named CHANNEL."""
    settings = {"dialect": "rnet", "silence_ms": silence_ms, "joystick_module": joystick}
    _simulate({**settings, "interface": interface, "channel": channel}, seconds, pins, _touching(touch_every))


def sim_cia402(
    interface: Interface = "slcan", channel: Channel = "cia402", pins: Pins = None, seconds: Seconds = 0.0
) -> None:
    """Two simulated CANopen motor controllers, nodes 1 (left) and 2 (right)."""
    _simulate({"dialect": "cia402", "interface": interface, "channel": channel}, seconds, pins)


def sim_dbc(
    interface: Interface = "slcan",
    channel: Channel = "dbc",
    silence_ms: Annotated[int, typer.Option(help="stops so long after the last command")] = 100,
    pins: Pins = None,
    seconds: Seconds = 0.0,
) -> None:
    """A simulated controller that speaks the example DBC file."""
    from chairward_drive_can.example import EXAMPLE_TABLE

    settings = {"dialect": "dbc", "dbc": EXAMPLE_TABLE, "silence_ms": silence_ms, "startup_ms": 0}
    _simulate({**settings, "interface": interface, "channel": channel}, seconds, pins)


def _simulate(
    values: dict[str, Any],
    seconds: float,
    pins: Path | None,
    each_round: Callable[[Any, float], None] | None = None,
) -> None:
    from chairward.shared_state import PIN_NAMES, SharedState
    from chairward_drive_can.companion import new_end, new_partner
    from chairward_drive_can.partners.run import serve
    from chairward_drive_can.settings import SimCanSettings

    settings = SimCanSettings.model_validate(values)
    started, stopped = time.monotonic(), [False]
    signal.signal(signal.SIGTERM, lambda *_: stopped.append(True))
    try:
        partner, end = new_partner(settings, Path()), new_end(settings)
    except DriveError as error:
        typer.echo(f"chairward: {error}", err=True)
        raise typer.Exit(2) from None
    typer.echo(f"simulated {settings.dialect} on {settings.interface} {settings.channel}; Ctrl-C ends it")

    def stopping() -> bool:
        if each_round is not None:
            each_round(partner, time.monotonic() - started)
        return stopped[-1] or (seconds > 0 and time.monotonic() - started > seconds)

    shared = SharedState.create(pins, PIN_NAMES) if pins else None
    try:
        serve(partner, end, stopping, shared)
    except KeyboardInterrupt:
        pass
    finally:
        end.close()
        if shared is not None:
            shared.close()
    typer.echo(f"motion frames heard: {partner.moves_heard}")


def _touching(every_s: float) -> Callable[[Any, float], None] | None:
    """The user pushes the joystick for half a second, every so often."""
    if every_s <= 0:
        return None

    def touch(chair: Any, now_s: float) -> None:
        chair.stick = (0, 30) if now_s % every_s > every_s - 0.5 else (0, 0)

    return touch


def _describer(dialect: str, dbc: Path | None) -> Callable[[Any], str]:
    from chairward_drive_can.describe import describe_canopen, describe_dbc, describe_rnet

    if dialect == "dbc":
        if dbc is None:
            raise DriveError("--dialect dbc needs --dbc FILE")
        from chairward_drive_can.dbc import read

        return describe_dbc(read(dbc))
    known = {"rnet": describe_rnet, "cia402": describe_canopen}
    if dialect not in known:
        raise DriveError(f"--dialect {dialect}: there are rnet, cia402 and dbc")
    return known[dialect]


def _recorded(path: Path) -> Iterator[tuple[float, Any]]:
    """Frames of a recording, with seconds since its first."""
    import can

    from chairward_drive_can.bus import frame_of

    first: float | None = None
    try:
        for message in can.LogReader(path):
            first = message.timestamp if first is None else first
            if (frame := frame_of(message)) is not None:
                yield message.timestamp - first, frame
    except OSError as error:
        raise DriveError(f"{path} cannot be read as a CAN recording ({error.strerror}): check the path") from error
    except ValueError as error:
        raise DriveError(
            f"{path} cannot be read as a CAN recording ({error}): give a .log, .asc, .blf or .csv file"
        ) from error


def _live(interface: str, channel: str, bitrate: int, log: Path | None, seconds: float) -> Iterator[tuple[float, Any]]:
    """Frames as they come, with seconds since the start."""
    import can

    from chairward_drive_can.bus import open_bus
    from chairward_drive_can.settings import CanSettings

    place = {"interface": interface, "channel": channel, "bitrate": bitrate}
    bus = open_bus(CanSettings.model_validate({"dialect": "rnet", **place}), listen_only=True)
    started, writer = time.monotonic(), can.Logger(log) if log else None
    try:
        while seconds <= 0 or time.monotonic() - started < seconds:
            frames = bus.receive()
            for frame in frames:
                if writer is not None:
                    writer(
                        can.Message(
                            timestamp=time.time(),
                            arbitration_id=frame.id,
                            data=frame.data,
                            is_extended_id=frame.extended,
                            is_remote_frame=frame.remote,
                        )
                    )
                yield time.monotonic() - started, frame
            if not frames:
                time.sleep(0.002)  # a person reads this; some interfaces have no descriptor to wait on
    finally:
        bus.close()
        if writer is not None:
            writer.stop()


def add_commands(root: typer.Typer) -> None:
    """Mount everything: `chairward can` and our part of `chairward sim`."""
    from chairward.cli import sim

    root.add_typer(app)
    sim.app.command("rnet")(sim_rnet)
    sim.app.command("cia402")(sim_cia402)
    sim.app.command("dbc")(sim_dbc)

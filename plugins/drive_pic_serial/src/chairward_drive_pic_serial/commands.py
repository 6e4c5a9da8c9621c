"""`chairward pic find|monitor|flash-help` and `chairward sim pic`."""

from __future__ import annotations

import contextlib
import time
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Annotated, Literal, cast

import typer

pic = typer.Typer(no_args_is_help=True, help="The PIC motor controller: find its port, watch its line, program it.")


@pic.command()
def find() -> None:
    """List serial ports by their stable names, and say which one answers as a Chairward PIC."""
    from serial.tools import list_ports

    by_id = {str(p.resolve()): str(p) for p in sorted(Path("/dev/serial/by-id").glob("*"))}
    ports = sorted(list_ports.comports(), key=lambda p: str(p.device))
    if not ports:
        typer.echo("no serial port found: plug the controller's cable in")
        raise typer.Exit(1)
    for port in ports:
        name = by_id.get(port.device, port.device)
        typer.echo(f"{name}  {port.description}  -> {probe(name)}")


def probe(path: str, wait_s: float = 0.5) -> str:
    """Say HELLO (which moves nothing: it brakes and needs arming again) and tell what answered."""
    import select

    from chairward_drive_pic_serial import wire
    from chairward_drive_pic_serial.port import Port, PortError

    try:
        port = Port(path)
    except PortError as error:
        return str(error)
    splitter, end = wire.Splitter(), time.monotonic() + wait_s
    try:
        port.write(wire.ask(wire.Ask.HELLO, 1, 8, 5))
        while (left := end - time.monotonic()) > 0:
            select.select([port.fd], [], [], left)
            for payload in splitter.feed(port.read()):
                answer = wire.answer(payload)
                if isinstance(answer, wire.Hello):
                    reason = answer.reason.name.lower().replace("_", " ")
                    return f"Chairward PIC, protocol {answer.protocol}, reset no. {answer.nonce} ({reason})"
    except PortError as error:
        return str(error)
    finally:
        port.close()
    return "no answer"


@pic.command()
def monitor(
    source: Annotated[str, typer.Argument(help="The PIC's serial port, or a recording to read.")],
    link: Annotated[Path, typer.Option(help="Live: name of the port that the drive is given meanwhile.")] = Path(
        "pic-monitored"
    ),
    record: Annotated[Path | None, typer.Option(help="Live: also write a recording.")] = None,
) -> None:
    """Print decoded frames, both ways: from a recording, or live, as a relay between the drive and SOURCE."""
    from chairward_drive_pic_serial.monitor import Relay, recorded
    from chairward_drive_pic_serial.port import Port, PortError
    from chairward_drive_pic_serial.sim_pic import PtyEnd

    try:
        if Path(source).is_file():
            for line in recorded(Path(source)):
                typer.echo(line)
            return
        port = Port(source)
    except (PortError, ValueError) as error:
        typer.echo(f"chairward: {error}", err=True)
        raise typer.Exit(1) from None
    end = PtyEnd(link.absolute())
    typer.echo(f"give the drive the port {link.absolute()}; Ctrl-C ends", err=True)
    try:
        with record.open("w", buffering=1, encoding="ascii") if record else contextlib.nullcontext() as file:
            relay = Relay(port, end, typer.echo, file)
            while True:
                relay.wait()
                relay.carry()
    except KeyboardInterrupt:
        typer.echo("", err=True)
    except PortError as error:
        typer.echo(f"chairward: {error}", err=True)
        raise typer.Exit(1) from None
    finally:
        end.close()
        port.close()


@pic.command("flash-help")
def flash_help() -> None:
    """Say how to program the firmware into a PIC16F877A."""
    from chairward_drive_pic_serial.firmware import PREBUILT, SOURCE

    typer.echo(
        f"""The firmware: {PREBUILT}
Its source:   {SOURCE}
  gpasm drive.asm -o drive.hex            (Debian package gputils; the tests check that both agree)

Take the PIC out of the board or unplug the motors' supply. Program with any PIC programmer, for example
  PICkit 2:      pk2cmd -PPIC16F877A -F{PREBUILT.name} -M -R
  PICkit 3/4:    MPLAB IPE, device PIC16F877A, import the .hex, Program
The configuration bits (HS oscillator, watchdog, power-up timer and brown-out reset on, no low-voltage programming)
are in the .hex. Then, wheels off the ground: chairward pic find"""
    )


def sim_pic(
    engine: Annotated[str, typer.Option(help="model, or gpsim (the real firmware in the simulator).")] = "model",
    link: Annotated[Path, typer.Option(help="Name of the simulated serial port.")] = Path("pic"),
) -> None:
    """A simulated PIC on a pty until Ctrl-C; it says in which file its pins are."""
    from chairward_drive_pic_serial.firmware import FirmwareError
    from chairward_drive_pic_serial.sim_pic import SimPic, SimPicSettings

    if engine not in ("model", "gpsim"):
        typer.echo(f"chairward: --engine {engine} is unknown: model or gpsim", err=True)
        raise typer.Exit(2)
    settings = SimPicSettings(engine=cast(Literal["model", "gpsim"], engine))
    link = link.absolute()
    if link.exists() and not link.is_symlink():
        typer.echo(f"chairward: --link {link} exists and is not a link: choose another name", err=True)
        raise typer.Exit(2)
    with TemporaryDirectory(prefix="chairward-sim-pic-") as folder:
        program = SimPic(settings, Path(folder), link)
        there = f"simulated PIC ({engine}) on {link}, pins in {folder}/pins; Ctrl-C ends it"
        try:
            with contextlib.suppress(KeyboardInterrupt):
                program.run(ready=lambda: typer.echo(there), stopping=lambda: False)
        except FirmwareError as error:
            typer.echo(f"chairward: {error}", err=True)
            raise typer.Exit(1) from None

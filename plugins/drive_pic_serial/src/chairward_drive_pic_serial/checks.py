"""What `chairward doctor` asks at the serial port: is there a PIC of ours, and would it drive? It brakes, and moves
nothing: HELLO and BRAKE are all that is sent."""

from __future__ import annotations

import select
import time
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from pathlib import Path

from chairward.doctor import Check, Finding, Site, not_tried
from chairward_drive_pic_serial import wire
from chairward_drive_pic_serial.port import Port, PortError
from chairward_drive_pic_serial.settings import PicSerialSettings

ANSWER_S = 0.5
ASKED_EVERY_S = 0.1
LOW_BATTERY = 0.15


@dataclass(slots=True)
class Heard:
    """What came from a port; count: of bytes."""

    hello: wire.Hello | None = None
    status: wire.Status | None = None
    taken: int = 0
    broken: int = 0
    unknown: list[bytes] = field(default_factory=list)


def checks() -> Sequence[Check]:
    """One check: one conversation."""
    return [Check(name="controller", component="pic_serial", look=controller)]


def controller(site: Site) -> Iterator[Finding]:
    """A conversation with whatever is at the port."""
    settings = site.settings
    assert isinstance(settings, PicSerialSettings)
    if Path(settings.port).is_relative_to(site.run_dir):
        yield not_tried("controller", "a simulated controller is there only in a run")
        return
    try:
        yield from judge(settings.port, ask(settings.port), settings)
    except PortError as error:
        what, _, fix = str(error).removeprefix(f"{settings.port}: ").partition(": ")
        yield _wrong(f"{settings.port} {what}", fix or "unplug it and plug it in again")


def ask(port_name: str) -> Heard:
    """Say HELLO and BRAKE until both are answered, half a second at most. Raises PortError."""
    port, heard, splitter = Port(port_name), Heard(), wire.Splitter()
    seq, asked_s, end = 0, 0.0, time.monotonic() + ANSWER_S
    try:
        while (now := time.monotonic()) < end and (heard.hello is None or heard.status is None):
            if now - asked_s >= ASKED_EVERY_S:
                asked_s, seq = now, seq + 1
                port.write(wire.ask(wire.Ask.HELLO, seq, 8, 5))
                port.write(wire.ask(wire.Ask.BRAKE, seq + 100, 1))
            select.select([port.fd], [], [], 0.02)
            data = port.read()
            heard.taken += len(data)
            for payload in splitter.feed(data):
                match wire.answer(payload):
                    case wire.Hello() as hello:
                        heard.hello = hello
                    case wire.Status() as status:
                        heard.status = status
                    case wire.Nak():
                        pass
                    case None:
                        heard.unknown.append(payload)
        heard.broken = splitter.broken
    finally:
        port.close()
    return heard


def judge(port: str, heard: Heard, settings: PicSerialSettings) -> Iterator[Finding]:
    """What is wrong with what was heard."""
    if heard.hello is None:
        if heard.taken == 0:
            yield _wrong(f"nobody answers at {port}", "switch the controller on, and check that TX and RX are crossed")
        elif heard.unknown:
            yield _wrong(
                f"what answers at {port} speaks another protocol", "program the firmware: chairward pic flash-help"
            )
        else:
            yield _wrong(
                f"what answers at {port} cannot be understood ({heard.taken} bytes)",
                f"set both ends to {wire.BAUD} baud 8N1, and check that this is the PIC's port (chairward pic find)",
            )
        return
    if heard.hello.protocol != wire.PROTOCOL:
        yield _wrong(
            f"the firmware speaks protocol {heard.hello.protocol}, this drive speaks {wire.PROTOCOL}",
            "program the firmware that comes with this version: chairward pic flash-help",
        )
        return
    if heard.status is not None:
        yield from _state(heard.status, settings)


def _state(status: wire.Status, settings: PicSerialSettings) -> Iterator[Finding]:
    if wire.Input.STOP in status.inputs:
        yield _wrong(
            "its stop input is open", "release the stop switch, or check its wire (it must be closed to drive)"
        )
    elif status.state == wire.State.ESTOP:
        yield Finding(
            "controller", False, "it holds a latched stop", "RESET, then ARM, once the cause is gone", needed=False
        )
    if wire.Input.CHARGER in status.inputs:
        yield _wrong("a charger is connected", "unplug the charger: the chair does not drive while it charges")
    battery = settings.battery(status.battery)
    if battery is not None and battery < LOW_BATTERY:
        yield _wrong(f"its battery is at {100 * battery:.0f} %", "charge the battery")


def _wrong(what: str, fix: str) -> Finding:
    return Finding("controller", False, what, fix)

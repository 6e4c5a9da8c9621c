"""What `chairward doctor` looks at on a CAN bus: the interface as the kernel sees it, then half a second of listening.

Nothing is sent.
"""

from __future__ import annotations

import time
from collections.abc import Iterator, Sequence
from pathlib import Path

from chairward.components import DriveError
from chairward.doctor import Check, Finding, Site, advised, not_tried
from chairward_drive_can.bus import bus_errors, open_bus
from chairward_drive_can.frames import Frame
from chairward_drive_can.settings import CanSettings

LISTEN_S = 0.5
PAUSE_S = 0.01
CAN_TYPE = "280"
"""ARPHRD_CAN of linux/if_arp.h."""


def checks() -> Sequence[Check]:
    """What stands in files, then the bus itself."""
    return [
        Check(name="bus", component="can", look=interface),
        Check(name="bus traffic", component="can", look=traffic),
    ]


def interface(site: Site) -> Iterator[Finding]:
    """The interface's own state, and the files that the dialect reads."""
    settings = _settings(site)
    if settings.interface == "socketcan":
        yield from _socketcan(site.root, settings)
    elif settings.interface == "slcan" and not _simulated(site) and not Path(settings.channel).exists():
        yield _wrong(f"{settings.channel} is not there", "plug the adapter in, or correct drive.can.channel")
    if settings.dialect == "dbc":
        yield from _dbc(site.context().chair_dir / settings.dbc.file)


def _socketcan(root: Path, settings: CanSettings) -> Iterator[Finding]:
    name = settings.channel
    device = root / "sys/class/net" / name
    up = f"sudo ip link set {name} up type can bitrate {settings.bitrate}"
    if not device.exists():
        nets = root / "sys/class/net"
        cans = [d.name for d in sorted(nets.glob("*")) if _read(d / "type") == CAN_TYPE]
        there = ", ".join(cans) or "none"
        yield _wrong(f"{name} is not there (CAN interfaces now: {there})", "plug the adapter in, or load its driver")
        return
    if _read(device / "type") != CAN_TYPE:
        yield _wrong(f"{name} is no CAN interface", "correct drive.can.channel")
        return
    if _read(device / "operstate") == "down":
        yield _wrong(f"{name} is down", up)
    bitrate = _read(device / "can_bittiming/bitrate")
    if bitrate and bitrate != str(settings.bitrate):
        yield _wrong(
            f"{name} runs at {bitrate} bit/s, the chair at {settings.bitrate}", f"sudo ip link set {name} down; {up}"
        )
    if _read(device / "can_state").upper() == "BUS-OFF":
        yield _wrong(
            f"{name} is bus-off: it gave up after too many errors", "check the bitrate and both terminators (60 ohm)"
        )


def _dbc(path: Path) -> Iterator[Finding]:
    import cantools

    try:
        cantools.database.load_file(path)
    except OSError:
        yield _wrong(f"{path} is not there", "correct drive.can.dbc.file")
    except (cantools.Error, ValueError) as error:
        first = str(error).strip().splitlines()[0][:150]
        yield _wrong(f"{path} is no DBC file ({first})", "export it again from the tool that made it")


def traffic(site: Site) -> Iterator[Finding]:
    """Half a second of listening: a chair that is switched on is never silent."""
    settings = _settings(site)
    if _simulated(site):
        yield not_tried("bus traffic", "a simulated controller is there only in a run")
        return
    broken: tuple[type[Exception], ...] = (DriveError, *bus_errors())
    try:
        heard = listen(settings)
    except broken as error:
        what = f"{settings.channel} cannot be opened: {error}"
        yield _wrong(*advised(what, "see that the interface is up, and close other programs on it"))
        return
    if not heard:
        yield _wrong(
            f"nothing is heard on {settings.channel}",
            f"switch the chair on, and check the two wires and the bitrate ({settings.bitrate})",
        )


def listen(settings: CanSettings) -> list[Frame]:
    """What was heard in half a second, or until the first frame. Raises what opening and reading raise."""
    bus = open_bus(settings)
    try:
        end = time.monotonic() + LISTEN_S
        while time.monotonic() < end:
            if heard := bus.receive():
                return heard
            time.sleep(PAUSE_S)
    finally:
        bus.close()
    return []


def _settings(site: Site) -> CanSettings:
    assert isinstance(site.settings, CanSettings)
    return site.settings


def _simulated(site: Site) -> bool:
    """Is its bus one that is there only in a run?"""
    return site.part is not None and "{run}" in str(site.part.settings.get("channel", ""))


def _read(path: Path) -> str:
    return path.read_text().strip() if path.is_file() else ""


def _wrong(what: str, fix: str) -> Finding:
    return Finding("bus", False, what, fix)

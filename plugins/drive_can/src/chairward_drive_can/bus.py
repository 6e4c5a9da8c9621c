"""Opening and closing a CAN interface, and turning every way it can fail into one sentence.

Motion is only ever sent frame by frame from the guard's own tick: a kernel-side or library-side cyclic sender
(`send_periodic`) keeps a chair moving while the program that asked for it hangs (measured: 216 stale frames in 2.25 s).
"""

from __future__ import annotations

import errno
import socket
import termios
import time
from collections import deque
from typing import Any, Protocol

from chairward.components import DriveError
from chairward_drive_can.frames import MS, Frame
from chairward_drive_can.settings import CanSettings
from chairward_drive_can.slcan import SlcanPort

READ_AT_MOST = 64
"""Frames taken in one poll: a flooded bus must not hold the guard."""
SLOW_SEND_NS, SLOW_SENDS = 5 * MS, 5
"""An interface that is this slow this often blocks, and so is unfit for a guard's tick."""


class Bus(Protocol):
    """What the drive needs of an interface. No method waits. All but close raise OSError or can.CanError."""

    @property
    def unanswered(self) -> int:
        """Frames sent that nobody has answered yet; 0 where the interface does not tell."""

    def fileno(self) -> int:
        """Descriptor for select, -1 when there is none."""

    def send(self, frame: Frame) -> None:
        """One frame, now or never."""

    def receive(self) -> list[Frame]:
        """What has come in, own frames excluded."""

    def close(self) -> None:
        """Give the interface back; may be called twice."""


def frame_of(message: Any) -> Frame | None:
    """python-can's message as our frame; None for error frames and CAN FD, which no dialect here speaks."""
    if message.is_error_frame or message.is_fd:
        return None
    extended, remote = message.is_extended_id, message.is_remote_frame
    return Frame(message.arbitration_id, bytes(message.data), extended=extended, remote=remote)


class LibraryBus:
    """Any interface python-can offers. On socketcan our own frames come back once they are on the wire: the answer.

    The kernel marks every frame of this machine the same, so ours are told from another program's by what is in them.
    """

    def __init__(self, settings: CanSettings, *, listen_only: bool = False) -> None:
        import can  # late: python-can loads many backends

        options: dict[str, Any] = dict(settings.options)
        if settings.interface == "socketcan":
            options.setdefault("receive_own_messages", True)
        else:
            options.setdefault("bitrate", settings.bitrate)
        if settings.interface in ("pcan", "kvaser", "gs_usb") and listen_only:
            options.setdefault("listen_only", True)
        self._message = can.Message
        self._echoes = settings.interface == "socketcan"
        self._bus = can.Bus(interface=settings.interface, channel=settings.channel, **options)
        self._closed = False
        self._pending: deque[Frame] = deque()
        self._slow_in_a_row = 0

    def fileno(self) -> int:
        try:
            return int(self._bus.fileno())
        except NotImplementedError:
            return -1

    @property
    def unanswered(self) -> int:
        return len(self._pending)

    def send(self, frame: Frame) -> None:
        message = self._message(
            arbitration_id=frame.id, data=frame.data, is_extended_id=frame.extended, is_remote_frame=frame.remote
        )
        started = time.monotonic_ns()
        self._bus.send(message, timeout=0)
        took_ns = time.monotonic_ns() - started
        self._slow_in_a_row = self._slow_in_a_row + 1 if took_ns > SLOW_SEND_NS else 0
        if self._slow_in_a_row >= SLOW_SENDS:
            raise OSError(
                f"sending took {took_ns // MS} ms, {SLOW_SENDS} times in a row: it blocks, so it cannot drive"
            )
        if self._echoes:
            self._pending.append(frame)

    def receive(self) -> list[Frame]:
        frames: list[Frame] = []
        for _ in range(READ_AT_MOST):
            message = self._bus.recv(timeout=0)
            if message is None:
                break
            frame = frame_of(message)
            if not message.is_rx and frame in self._pending:
                while self._pending.popleft() != frame:
                    pass  # an answer before this one was lost on its way to us
            elif frame is not None:
                frames.append(frame)
        return frames

    def close(self) -> None:
        if not self._closed:
            self._closed = True
            self._bus.shutdown()


class Claim:
    """One driver an interface: an abstract socket name, which the kernel frees whatever its owner dies of."""

    def __init__(self, interface: str, channel: str) -> None:
        self._socket = socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM)
        try:
            self._socket.bind(f"\0chairward-can/{interface}/{channel}"[:100])
        except OSError as error:
            self._socket.close()
            if error.errno == errno.EADDRINUSE:
                raise DriveError(
                    f"{interface} {channel}: another program of Chairward already drives on it; stop that one first"
                ) from error
            raise

    def release(self) -> None:
        """Free the name; may be called twice."""
        self._socket.close()


def open_bus(settings: CanSettings, *, listen_only: bool = False) -> Bus:
    """The interface the settings name. Raises DriveError with one sentence."""
    name = f"{settings.interface} {settings.channel}"
    try:
        if settings.interface == "slcan":
            return SlcanPort(
                settings.channel,
                settings.bitrate,
                settings.tty_baudrate,
                listen_only=listen_only,
                acknowledges=settings.acknowledged,
            )
        return LibraryBus(settings, listen_only=listen_only)
    except Exception as error:  # every backend of python-can fails in its own way
        raise DriveError(f"{name} cannot be opened: {sentence(error)}; {advice(settings)}") from error


def preload() -> None:
    """Import the libraries now, where a guard is being made, and not in the tick that first opens the interface."""
    import can  # noqa: F401 - for its effect
    import serial  # noqa: F401


def bus_errors() -> tuple[type[Exception], ...]:
    """What reading and writing may raise when the interface is gone (termios.error is no OSError)."""
    import can

    return (OSError, can.CanError, termios.error)


def sentence(error: Exception) -> str:
    """The library's words on one line."""
    return (" ".join(str(error).split()) or type(error).__name__)[:120]


def advice(settings: CanSettings) -> str:
    """What to do about it, by interface."""
    return {
        "socketcan": f"'sudo ip link set {settings.channel} up type can bitrate {settings.bitrate}' brings it up",
        "slcan": "check that the adapter is plugged in and that no other program has it",
        "udp_multicast": "a machine without a network needs 'sudo ip route add 224.0.0.0/4 dev lo'",
    }.get(settings.interface, "check drive.can.interface and drive.can.channel (docs: python-can, interfaces)")

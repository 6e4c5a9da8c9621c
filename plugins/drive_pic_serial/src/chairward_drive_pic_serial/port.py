"""A serial port that never waits: opened by pyserial (exclusive, 57600 8N1), then read and written as a descriptor."""

from __future__ import annotations

import errno
import os
import select
import termios

import serial

from chairward_drive_pic_serial import wire

_NOT_NOW = (errno.EAGAIN, errno.EWOULDBLOCK, errno.EINTR)
_GONE = select.POLLHUP | select.POLLERR | select.POLLNVAL


class PortError(Exception):
    """The port cannot be opened or is gone: one sentence that begins with its name."""


class Port:
    """An open port. Raises PortError for every form an unplugged port takes."""

    def __init__(self, path: str) -> None:
        self.path = path
        self.dropped = 0
        try:
            self._serial = serial.Serial(path, wire.BAUD, timeout=0, write_timeout=0, exclusive=True)
        except (serial.SerialException, OSError, termios.error, ValueError) as error:
            raise PortError(f"{path}: {_why(error)}") from error
        self.fd: int = self._serial.fileno()
        os.set_blocking(self.fd, False)
        self._poll = select.poll()
        self._poll.register(self.fd, select.POLLIN)

    def read(self) -> bytes:
        """Whatever has come in, b"" for nothing."""
        try:
            events = self._poll.poll(0)
            if not events:
                return b""
            data = os.read(self.fd, 4096) if events[0][1] & select.POLLIN else b""
        except OSError as error:
            if error.errno in _NOT_NOW:
                return b""
            raise PortError(f"{self.path}: {_why(error)}") from error
        if not data and events[0][1] & (_GONE | select.POLLIN):
            raise PortError(f"{self.path}: the port is gone (unplugged?): plug it in again")
        return data

    def write(self, frame: bytes) -> bool:
        """Write one frame, or drop and count it. A delimiter goes first: nothing cut off before can spoil it."""
        return self.write_raw(b"\0" + frame)

    def write_raw(self, data: bytes) -> bool:
        """Write bytes as they are; what does not fit is dropped and counted."""
        try:
            wrote = os.write(self.fd, data)
        except OSError as error:
            if error.errno in _NOT_NOW:
                self.dropped += 1
                return False
            raise PortError(f"{self.path}: {_why(error)}") from error
        self.dropped += wrote < len(data)
        return wrote == len(data)

    def forget_unsent(self) -> None:
        """Throw away what the driver has not put on the line yet: it is stale."""
        try:
            termios.tcflush(self.fd, termios.TCOFLUSH)
        except (OSError, termios.error) as error:
            raise PortError(f"{self.path}: {_why(error)}") from error

    def close(self) -> None:
        """Give the port back."""
        try:
            self._serial.close()
        except (serial.SerialException, OSError, termios.error):
            self.fd = -1  # already gone: nothing is left to give back


def _why(error: Exception) -> str:
    """What a person can do about it."""
    number = getattr(error, "errno", None) or (error.args[0] if error.args else None)
    text = str(error)
    if number in (errno.EAGAIN, errno.EBUSY) or "exclusively lock" in text:
        return "already in use by another program: close that program first"
    if number == errno.ENOENT:
        return "there is no such port: plug the controller in, or find its name with 'chairward pic find'"
    if number == errno.EACCES:
        return "permission denied: add yourself to the group 'dialout' and log in again"
    if number in (errno.EIO, errno.ENODEV, errno.ENXIO, errno.EBADF):
        return f"the port is gone ({os.strerror(number)}): plug it in again"
    return text

"""Takeover `emulate`: the joystick module's part of the power-up exchange, from a recording of this very chair.

Nothing is computed: what the chair's own joystick module once answered is said again, step by step, each when the power
module has asked for it. Pure: frames in, frames out. Never tried on a real power module.
"""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path

from chairward.components import DriveError
from chairward_drive_can import rnet
from chairward_drive_can.frames import MS, Frame

ANSWER_NS = 1000 * MS
SERIAL_PERIOD_NS = 50 * MS
MODULES_PERIOD_NS = 100 * MS
SERIAL, RUN, SERIALS = 0x00E, 0x7B0, 0x7B3
MODULES = Frame(0x03C30F0F, b"\x87" * 8, extended=True)


def speaker(frame: Frame) -> str:
    """ "joystick" or "power" for a frame of the exchange, "" for everything else (periodic frames, status)."""
    if frame.extended:
        return ("power" if frame.remote else "joystick") if frame.id >> 24 == 0x1F else ""
    if frame.id == SERIALS:
        return "power" if frame.remote else "joystick"
    if frame.id in (0x00C, 0x051, 0x061) or frame.id >> 4 in (0x04, 0x78):
        return "joystick"
    return "power" if frame.id in (RUN, 0x7B1, 0x050, 0x060) or frame.id >> 4 == 0x79 else ""


def steps(frames: Iterable[Frame]) -> list[Frame]:
    """The exchange in a recording: from the first sign of life to the first joystick frame."""
    found: list[Frame] = []
    for frame in frames:
        if isinstance(rnet.decode(frame), rnet.Joystick):
            break
        if speaker(frame):
            found.append(frame)
    return found


def load(path: Path) -> list[Frame]:
    """The exchange in a recording of python-can. Raises DriveError when there is none."""
    import can

    from chairward_drive_can.bus import frame_of

    try:
        frames = [frame for message in can.LogReader(path) if (frame := frame_of(message)) is not None]
    except (OSError, ValueError) as error:
        raise DriveError(f"drive.can.rnet.startup: {path} cannot be read as a CAN recording: {error}") from error
    found = steps(frames)
    if not any(frame.id >> 24 == 0x1F and not frame.remote for frame in found):
        raise DriveError(
            f"drive.can.rnet.startup: {path} has no serial number exchange: record while the chair is switched on "
            "('chairward can monitor --log FILE', then press the power key)"
        )
    return found


class Startup:
    """Where we are in the exchange. `done` when it is over; `fault` when the power module asked something else."""

    def __init__(self, exchange: list[Frame], serial: bytes) -> None:
        self._exchange, self._serial = exchange, serial
        self.reset()
        self.fault = ""

    def reset(self) -> None:
        """From the beginning."""
        self._at = 0
        self._since_ns = self._serial_ns = 0

    @property
    def done(self) -> bool:
        """Everything was said and answered."""
        return self._at >= len(self._exchange)

    def hear(self, frame: Frame, now_ns: int) -> None:
        """The power module's next question, if it is the one in the recording (its challenge byte is free)."""
        if self.done or speaker(frame) != "power":
            return
        expected = self._exchange[self._at]
        free = 0xFF if frame.extended else 0
        if speaker(expected) == "power" and (frame.id | free, frame.remote) == (expected.id | free, expected.remote):
            self._at, self._since_ns, self.fault = self._at + 1, now_ns, ""

    def due(self, now_ns: int) -> list[Frame]:
        """What the joystick module says now."""
        self._since_ns = self._since_ns or now_ns
        frames = []
        while not self.done and speaker(self._exchange[self._at]) == "joystick":
            frames.append(self._exchange[self._at])
            self._at, self._since_ns = self._at + 1, now_ns
        if not self.done and now_ns - self._since_ns > ANSWER_NS:
            self.fault = (
                f"R-Net: the power module did not say {self._exchange[self._at]} as in the recording of this chair's "
                "start-up; is it this chair's own, and is it switched off and on?"
            )
            self.reset()
            return []
        return frames + self.alive(now_ns)

    def alive(self, now_ns: int) -> list[Frame]:
        """The serial number, every 50 ms from the first word on."""
        if self._at == 0 or now_ns - self._serial_ns < SERIAL_PERIOD_NS:
            return []
        self._serial_ns = now_ns
        return [Frame(SERIAL, self._serial)]

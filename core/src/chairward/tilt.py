"""A tilt inhibit: a whole example of a sensor whose matter is neither range nor intent. It sends a `Veto`.

The accelerometer is read as the Linux kernel offers it (Industrial I/O: files in_accel_x_raw, _y_raw, _z_raw in
/sys/bus/iio/devices/iio:deviceN). The tilt test of published self-audits asks for the reaction; the angle is the
integrator's, measured on the chair.
"""

from __future__ import annotations

import time
from collections import deque
from math import acos, degrees, sqrt
from pathlib import Path
from typing import Literal

from pydantic import Field

from chairward.components import DeviceLost, Settings
from chairward.messages import Veto

AVERAGED = 5
"""Samples that count together: a kerb's jolt is no slope."""


class TiltSettings(Settings):
    """Which accelerometer, and how far the chair may lean."""

    device: Path = Field(description="folder of the accelerometer, such as /sys/bus/iio/devices/iio:device0")
    up: Literal["x", "y", "z"] = Field(default="z", description="its axis that is vertical on level ground")
    limit_deg: float = Field(default=12.0, gt=0, le=45, description="lean beyond which the chair is stopped")
    period_ms: int = Field(default=40, ge=10, le=200, description="between two samples")


class Tilt:
    """A `chairward.components.Source` of vetoes: one each period, standing or not, for its silence stops the chair."""

    def __init__(self, settings: TiltSettings) -> None:
        self._settings = settings
        self._samples: deque[tuple[float, ...]] = deque(maxlen=AVERAGED)
        self._seq = 0
        self._due_s = 0.0

    def open(self) -> None:
        """Raises DeviceLost when the accelerometer is not there."""
        self._samples.clear()
        self._samples.append(self._sample())
        self._due_s = time.monotonic()

    def read(self, timeout_s: float) -> Veto | None:
        """Wait for the next sample; whether the chair leans too far. Raises DeviceLost."""
        wait_s = self._due_s - time.monotonic()
        time.sleep(max(0.0, min(wait_s, timeout_s)))
        if wait_s > timeout_s:
            return None
        captured_ns = time.monotonic_ns()
        self._due_s = max(self._due_s + self._settings.period_ms / 1000.0, time.monotonic())
        self._samples.append(self._sample())
        self._seq += 1
        lean = lean_deg(tuple(map(sum, zip(*self._samples, strict=True))), "xyz".index(self._settings.up))
        over = lean > self._settings.limit_deg
        reason = f"tilted by {lean:.0f} degrees, {self._settings.limit_deg:g} are allowed" if over else ""
        return Veto(seq=self._seq, captured_ns=captured_ns, stop=over, reason=reason)

    def close(self) -> None:
        """Nothing is held."""

    def _sample(self) -> tuple[float, ...]:
        device = self._settings.device
        try:
            sample = tuple(float((device / f"in_accel_{axis}_raw").read_text()) for axis in "xyz")
        except (OSError, ValueError) as error:
            raise DeviceLost(f"tilt: {device} gives no acceleration ({error}): check the sensor and its path") from None
        if not any(sample):
            raise DeviceLost(f"tilt: {device} says that nothing weighs anything: its wires or its driver are broken")
        return sample


def lean_deg(gravity: tuple[float, ...], up: int) -> float:
    """Angle between the measured gravity and the axis that should be vertical; upside down is 180."""
    length = sqrt(sum(part * part for part in gravity))
    return degrees(acos(max(-1.0, min(1.0, gravity[up] / length)))) if length else 180.0

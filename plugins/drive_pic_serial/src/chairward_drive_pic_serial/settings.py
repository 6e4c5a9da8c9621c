"""What can be set, and how the core's units become the firmware's hundredths."""

from __future__ import annotations

import math
from typing import Literal

from pydantic import Field

from chairward.components import DriveError, DriveSettings, Motion
from chairward_drive_pic_serial import wire

_ROUNDING = 1e-6


class PicSerialSettings(DriveSettings):
    """The port, and the scale between mm/s, deg/s and the firmware's -100..100."""

    port: str = Field(
        default="/dev/ttyUSB0",
        min_length=1,
        description="Serial port; best its stable name below /dev/serial/by-id ('chairward pic find' lists them).",
    )
    full_speed_mm_s: float = Field(
        default=500.0, ge=50.0, le=3000.0, description="Speed over ground at 100 % drive, mm/s, as measured."
    )
    full_turn_deg_s: float = Field(
        default=45.0, ge=5.0, le=180.0, description="Turning speed at 100 % steer, deg/s, as measured."
    )
    drive_sign: Literal[-1, 1] = Field(default=1, description="-1 when the drive motor is wired the other way round.")
    turn_sign: Literal[-1, 1] = Field(default=1, description="-1 when the steering motor is wired the other way round.")
    accel_mm_s2: float = Field(
        default=600.0, ge=50.0, le=5000.0, description="The firmware never speeds up faster than this."
    )
    decel_mm_s2: float = Field(
        default=1000.0, ge=100.0, le=20000.0, description="Deceleration of the firmware's controlled stop."
    )
    battery_scale_v: float = Field(
        default=15.0, ge=3.0, le=60.0, description="Battery voltage at which the divider gives the PIC 5 V."
    )
    battery_empty_v: float = Field(default=10.8, ge=0.0, le=60.0, description="Voltage that counts as 0 %.")
    battery_full_v: float = Field(
        default=12.8, ge=0.0, le=60.0, description="Voltage that counts as 100 %; 0: no divider is fitted."
    )

    def hundredths(self, motion: Motion) -> tuple[int, int]:
        """(steer, drive), rounded towards 0 so that nothing is ever faster than asked. Raises DriveError."""
        drive = self._part("drive_mm_s", motion.drive_mm_s, self.full_speed_mm_s, "mm/s")
        steer = self._part("turn_deg_s", motion.turn_deg_s, self.full_turn_deg_s, "deg/s")
        return steer * self.turn_sign, drive * self.drive_sign

    def motion(self, steer: int, drive: int) -> Motion:
        """The other way round."""
        return Motion(
            drive * self.drive_sign * self.full_speed_mm_s / wire.FULL,
            steer * self.turn_sign * self.full_turn_deg_s / wire.FULL,
        )

    def rates_ms(self) -> tuple[int, int]:
        """(rise, fall): milliseconds a hundredth, 1..50; never speeds up faster or brakes slower than asked."""
        step = self.full_speed_mm_s / wire.FULL * 1000.0
        rise = math.ceil(step / self.accel_mm_s2 - _ROUNDING)
        fall = math.floor(step / self.decel_mm_s2 + _ROUNDING)
        return min(max(rise, 1), 50), min(max(fall, 1), 50)

    def battery(self, counts: int) -> float | None:
        """ADC 0..255 -> 0..1, None without a divider."""
        span = self.battery_full_v - self.battery_empty_v
        if self.battery_full_v == 0.0 or span <= 0.0:
            return None
        volts = counts / 255.0 * self.battery_scale_v
        return min(max((volts - self.battery_empty_v) / span, 0.0), 1.0)

    def battery_counts(self, fraction: float) -> int:
        """0..1 -> ADC 0..255."""
        volts = self.battery_empty_v + fraction * (self.battery_full_v - self.battery_empty_v)
        return min(max(round(volts / self.battery_scale_v * 255.0), 0), 255)

    def _part(self, name: str, value: float, full: float, unit: str) -> int:
        if not math.isfinite(value) or abs(value) > full * (1.0 + _ROUNDING):
            raise DriveError(
                f"{self.port}: {name} = {value} is refused: this drive takes -{full:g} to {full:g} {unit}; lower the "
                "chair's limits, or correct the drive's scale if it was measured wrong"
            )
        return int(math.copysign(min(abs(value) / full * wire.FULL + _ROUNDING, wire.FULL), value))

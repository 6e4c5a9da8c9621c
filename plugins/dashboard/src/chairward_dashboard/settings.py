"""What an integrator may set."""

from __future__ import annotations

import ipaddress

from pydantic import Field

from chairward.components import Settings


class DashboardSettings(Settings):
    """Settings of `dashboard`."""

    host: str = Field(
        default="127.0.0.1",
        description="address to listen on; anything but a loopback address asks every screen for the pairing code",
    )
    port: int = Field(default=8765, ge=0, le=65535, description="TCP port; 0 lets the system choose")
    names: tuple[str, ...] = Field(
        default=(), description="host names (beside IP addresses and localhost) under which browsers may ask for it"
    )
    pages: int = Field(default=12, ge=1, le=64, description="screens connected at the same time")
    pictures_hz: int = Field(default=15, ge=1, le=15, description="pictures and states a second for each screen")
    picture_px: int = Field(default=320, ge=80, le=640, description="width of each of the four pictures")
    large_px: int = Field(default=640, ge=160, le=1280, description="width of the one picture of the live view")
    stop_pictures: bool = Field(
        default=False, description="keep, with each stop in the log of stops, what the left camera saw"
    )
    keep_stops: int = Field(default=200, ge=0, le=5000, description="stops that the log keeps; 0 keeps none")
    jpeg_quality: int = Field(default=70, ge=20, le=95, description="JPEG quality of pictures")

    @property
    def open_to_network(self) -> bool:
        """True when screens other than this machine's own can reach it, so that they must be paired."""
        if self.host == "localhost":
            return False
        try:
            return not ipaddress.ip_address(self.host).is_loopback
        except ValueError:
            return True

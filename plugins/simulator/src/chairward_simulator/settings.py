"""Settings of the simulator's four components."""

from __future__ import annotations

from pydantic import Field

from chairward.components import Settings


class CameraSettings(Settings):
    """Settings of `sim_cameras`."""

    home: str = Field(default="", description="home file; the same as sim_home's; empty: the one that comes along")
    fps: float = Field(default=15.0, ge=1.0, le=60.0, description="pairs a second")
    noise: float = Field(default=2.0, ge=0.0, le=20.0, description="sensor noise, standard deviation in grey levels")
    seed: int = Field(default=1, ge=0, le=2**31, description="of the noise")


class MicrophoneSettings(Settings):
    """Settings of `sim_microphone`."""

    noise_dbfs: float = Field(default=-58.0, ge=-120.0, le=-10.0, description="level of the room's noise, dB FS (RMS)")
    speech_gain_db: float = Field(default=0.0, ge=-40.0, le=12.0, description="louder or quieter than recorded")
    seed: int = Field(default=1, ge=0, le=2**31, description="of the noise")


class OperatorSettings(Settings):
    """Settings of `sim_operator`."""

    world: bool = Field(default=True, description="False: no simulated world; arms by itself (recorded input)")
    arm_after_s: float = Field(default=1.0, ge=0.0, le=60.0, description="without a world: first press of ARM")


class HomeSettings(Settings):
    """Settings of `sim_home`."""

    home: str = Field(default="", description="home file (TOML); empty: the flat that comes with the simulator")
    full_speed_mm_s: float = Field(default=700.0, ge=100.0, le=3000.0, description="speed at full duty, mm/s")
    full_turn_deg_s: float = Field(default=60.0, ge=5.0, le=180.0, description="turn rate at full duty, deg/s")
    slope_percent: float = Field(default=0.0, ge=-20.0, le=20.0, description="floor rises towards heading 0 by this")
    speaks: bool = Field(default=True, description="False: nobody says or presses anything; drive it yourself")
    wheels_off: bool = Field(default=False, description="True: on blocks; the wheels turn, the chair stays")
    waits_s: float = Field(
        default=30.0, ge=0.0, le=600.0, description="the person waits at most so long for the cameras to be on"
    )

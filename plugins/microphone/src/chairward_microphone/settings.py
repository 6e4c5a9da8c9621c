"""What a chair file may set for the microphone."""

from __future__ import annotations

from pathlib import Path
from typing import Literal

from pydantic import Field

from chairward.components import Settings


class MicrophoneSettings(Settings):
    """Settings of `microphone`. Which kind is never guessed: recorded sound is played only when the file says so."""

    kind: Literal["live", "files", "manifest"] = Field(
        default="live", description="a device, a list of files, or words of a manifest"
    )
    device: str = Field(
        default="", description="live: part of the device's name, or its number; empty: the system's default"
    )
    rate_hz: int = Field(default=16_000, ge=8000, le=48_000, description="samples a second that the source yields")
    files: tuple[Path, ...] = Field(default=(), description="files: sound files, played one after the other")
    manifest: Path | None = Field(default=None, description="manifest: csv with path, word, speaker, role, source")
    speaker: str = Field(default="", description="manifest: whose words; empty: the first speaker with test words")
    playlist: tuple[str, ...] = Field(
        default=(), description="manifest: words in the order to say them; empty: all test words"
    )
    loop: bool = Field(default=False, description="begin again at the end instead of ending")
    paced: bool = Field(default=True, description="play at the speed of real time; false: as fast as it is read")
    lead_s: float = Field(default=2.0, ge=0.0, le=60.0, description="manifest: room noise before the first word")
    gap_s: float = Field(
        default=1.5, ge=0.2, le=60.0, description="manifest: from the end of one word to the start of the next"
    )
    floor_dbfs: float = Field(
        default=-65.0, ge=-90.0, le=-20.0, description="manifest: level of the room noise between words"
    )
    level_dbfs: float = Field(default=-26.0, ge=-60.0, le=-6.0, description="manifest: level that words are brought to")

"""What a chair file may set for the recogniser."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any, Literal

from pydantic import Field, model_validator

from chairward.components import Settings

EngineName = Literal["default", "thesis_text", "thesis_code"]
Listening = Literal["always", "armed", "push_to_talk"]

OPEN_THRESHOLD = 3.0
"""With it one false word an hour was measured, always listening, on speakers and noises not fitted to (README)."""
ARMED_THRESHOLD = -1.0
"""For the seconds for which somebody has opened the ears on purpose: hearing the word matters more (README)."""


class VoiceSettings(Settings):
    """Settings of `voice_dtw`. Templates: the person's own store unless `templates_dir` or `manifest` is set."""

    engine: EngineName = Field(
        default="default",
        description="recogniser; thesis_text and thesis_code never reject: simulator, files and robot only",
    )
    templates_dir: Path | None = Field(
        default=None, description="folder of recordings <word>_<n>.wav instead of the person's own"
    )
    manifest: Path | None = Field(
        default=None, description="manifest whose template rows are used instead of the person's own"
    )
    speaker: str = Field(default="", description="speaker of the manifest; empty: its first one")
    threshold: float = Field(
        default=OPEN_THRESHOLD,
        ge=-5.0,
        le=20.0,
        description="log-odds a word needs; higher: fewer wrong, more unheard; unless it is stated "
        f"{OPEN_THRESHOLD:g} always listening, {ARMED_THRESHOLD:g} armed and by push to talk",
    )
    stop_threshold: float = Field(
        default=-2.0, ge=-20.0, le=5.0, description="log-odds the stop word needs; looser than the others"
    )
    refractory_ms: int = Field(
        default=400, ge=0, le=5000, description="no second motion word within this; stop is always heard"
    )
    listening: Listening = Field(
        default="always",
        description="when motion words count: armed, some seconds after the wake word or a press of the talk switch; "
        "push_to_talk, while the talk switch is held; stop always counts",
    )
    wake_word: str = Field(default="", description="enrolled word that opens an armed listener")
    armed_s: float = Field(default=6.0, ge=1.0, le=60.0, description="how long an armed listener stays open")
    loudest_noise_dbfs: float = Field(
        default=-20.0, ge=-60.0, le=0.0, description="room noise above which no word is trusted"
    )
    voice_over_noise_db: float = Field(
        default=5.0,
        ge=-20.0,
        le=30.0,
        description="how far the recorded stop word must be over the room's noise; under it no motion word is taken",
    )
    shout_dbfs: float = Field(
        default=0.0, ge=-40.0, le=0.0, description="any voice this loud for 200 ms stops the chair; 0: never"
    )
    word_set: str = Field(
        default="",
        pattern=r"^[a-z0-9_]{0,20}$",
        description="another set of recordings of the same person ('tired', 'hoarse'); empty: the usual voice",
    )

    @model_validator(mode="before")
    @classmethod
    def _threshold_of_the_mode(cls, given: Any) -> Any:
        """Ears that are opened on purpose need less than ears that are always open, unless it is stated."""
        if isinstance(given, Mapping) and given.get("listening") in ("armed", "push_to_talk"):
            return {"threshold": ARMED_THRESHOLD, **given}
        return given

    def unfit_to_ride(self) -> tuple[str, str] | None:
        """An open microphone, unless its threshold is as high as what was measured asks for."""
        if self.listening == "always" and self.threshold < OPEN_THRESHOLD:
            return "listening", (
                f"an open microphone moves wrongly more than once an hour among talking people: choose armed or "
                f"push_to_talk, or a threshold of at least {OPEN_THRESHOLD:g}, at which more words go unheard"
            )
        return None

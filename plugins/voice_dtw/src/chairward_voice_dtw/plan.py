"""What an evaluation is asked for, and what it finds of each utterance."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path

from chairward_voice_dtw import calibration
from chairward_voice_dtw.engine import Heard
from chairward_voice_dtw.settings import EngineName, VoiceSettings
from chairward_voice_dtw.streams import Placed


@dataclass(frozen=True, slots=True, kw_only=True)
class Plan:
    """What to evaluate; snrs in dB, None for clean. hours: of sound without commands, over all speakers.

    embedding: use the speech embedding where it is installed. variant: how the tested words are said.
    words: only these are said, by those who have them; none: all. speakers: only these; none: all. weights: file of the
    score.
    """

    manifest: Path
    templates: int = 3
    snrs: tuple[float | None, ...] = (None, 20.0, 10.0, 5.0)
    hours: float = 3.0
    placements: int = 2
    engine: EngineName = "default"
    stop_word: str = "stop"
    seed: int = 1
    processes: int = 0
    embedding: bool = True
    variant: str = "usual"
    settings: VoiceSettings = field(default_factory=VoiceSettings)
    words: tuple[str, ...] = ()
    speakers: tuple[str, ...] = ()
    weights: Path = calibration.FILE


@dataclass(frozen=True, slots=True, kw_only=True)
class Trial:
    """One utterance and what became of it. heard: everything that overlaps it."""

    source: str
    speaker: str
    snr: float | None
    placed: Placed
    heard: tuple[Heard, ...]

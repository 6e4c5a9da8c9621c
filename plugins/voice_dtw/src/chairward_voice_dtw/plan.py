"""What an evaluation is asked for, and what it finds of each utterance."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from chairward_voice_dtw import calibration
from chairward_voice_dtw.engine import Heard, Thresholds
from chairward_voice_dtw.settings import EngineName, Listening, VoiceSettings
from chairward_voice_dtw.streams import Placed

DRIVEN: Listening = "armed"
"""How a chair listens that somebody sits in."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Plan:
    """What to evaluate; snrs in dB, None for clean. hours: of sound without commands, over all speakers.

    threshold: stated for all modes of listening; None: each its own. embedding: use the speech embedding where it is
    installed. variant: how the tested words are said. words: only these are said, by those who have them; none: all.
    speakers: only these; none: all. weights: file of the score.
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
    threshold: float | None = None
    stop_threshold: float = VoiceSettings().stop_threshold
    words: tuple[str, ...] = ()
    speakers: tuple[str, ...] = ()
    weights: Path = calibration.FILE

    def thresholds(self, listening: Listening) -> Thresholds:
        """What a word needs in one mode of listening."""
        word = VoiceSettings(listening=listening).threshold if self.threshold is None else self.threshold
        return Thresholds(word=word, stop=self.stop_threshold, stop_words=frozenset({self.stop_word}))


@dataclass(frozen=True, slots=True, kw_only=True)
class Trial:
    """One utterance and what became of it. heard: everything that overlaps it, accepted in the mode DRIVEN; always: the
    same, accepted by ears that are always open."""

    source: str
    speaker: str
    snr: float | None
    placed: Placed
    heard: tuple[Heard, ...]
    always: tuple[Heard, ...] = ()


@dataclass(frozen=True, slots=True, kw_only=True)
class Strange:
    """What was heard in so many hours without a command; heard, always: as of a Trial."""

    hours: float
    heard: list[Heard]
    always: list[Heard]

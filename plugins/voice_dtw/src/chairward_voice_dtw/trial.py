"""One recording through the recogniser that drives: for `words test`, the words page and new recordings."""

from __future__ import annotations

import numpy as np

from chairward_voice_dtw.audio import Floats
from chairward_voice_dtw.engine import DtwEngine, Heard, Thresholds, Voice
from chairward_voice_dtw.streams import STREAM_HZ, room_tone
from chairward_voice_dtw.templates import at_level

BEFORE_S, AFTER_S = 2.5, 1.0


def hear(voice: Voice, thresholds: Thresholds, samples: Floats) -> Heard | None:
    """What a recording (at STREAM_HZ, its own room before and after it) is heard as while driving.

    The accepted word, else the surest guess; None when nothing in it could be a word.
    """
    samples, rng = at_level(samples), np.random.default_rng(1)
    before, after = (room_tone(samples, int(seconds * STREAM_HZ), rng) for seconds in (BEFORE_S, AFTER_S))
    found = DtwEngine(voice, thresholds, STREAM_HZ).push(np.concatenate([before, samples, after]))
    return max((h for h in found if h.word), key=lambda h: (h.accepted, h.score), default=None)

"""Samples in, possible words out as stretches of mel frames: resampler, mel stream, voice activity, endpointers.

Several endpointers listen at once, each with another idea of how far sound must fall for a word to be over: in a quiet
room the patient one keeps "sto-p" together, in a noisy one the strict one finds the word in the din. The matcher's
score chooses between what they offer.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from chairward_voice_dtw import endpoint
from chairward_voice_dtw.audio import Floats, Resampler
from chairward_voice_dtw.endpoint import Endpointer, EndpointParameters, Event
from chairward_voice_dtw.frontend import BANDS, HOP, WINDOW, MelStream

LISTENERS = (
    EndpointParameters(share=0.35, hang=20),
    EndpointParameters(share=0.25, cap_db=8.0, hang=27),
    EndpointParameters(share=0.55, hang=12),
)


@dataclass(frozen=True, slots=True, kw_only=True)
class Segment:
    """A stretch of sound that may be a word; frames are 10 ms of the stream.

    mel: n x BANDS, pads included. noise: BANDS, the room before it. first, last: the active part, in stream frames.
    decided: the newest frame that was known. too_long: talk or noise, never a command. listener: which one found it.
    voiced: share of frames that a voice detector called speech. peak_db: over the room.
    """

    mel: Floats
    noise: Floats
    first: int
    last: int
    decided: int
    too_long: bool
    listener: int
    voiced: float
    peak_db: float


class Segmenter:
    """Causal; what it says does not depend on how the sound is cut into blocks."""

    def __init__(self, rate_hz: int, listeners: Sequence[EndpointParameters] = LISTENERS) -> None:
        import webrtcvad

        self._resampler = Resampler(rate_hz)
        self._mel = MelStream()
        self._vad: Any = webrtcvad.Vad(2)
        self._endpointers = [Endpointer(p) for p in listeners]
        self._rooms = [np.zeros(BANDS, np.float32) for _ in listeners]
        self._keep = max(p.longest for p in listeners) + 200
        self._rest = b""
        self._frames = np.zeros((0, BANDS), np.float32)
        self._first_frame = 0
        self.frames_seen = 0
        self.onsets: list[int] = []

    @property
    def noise(self) -> npt.NDArray[np.float64]:
        """The room's band power as it is believed now."""
        return self._endpointers[0].noise

    @property
    def in_word(self) -> bool:
        """Something that may be a word is going on."""
        return any(e.state[endpoint.MODE] == endpoint.WORD for e in self._endpointers)

    def push(self, samples: Floats) -> list[Segment]:
        """Segments that end with these samples, in the order in which they became known."""
        at_work_rate = self._resampler.push(samples)
        mel = self._mel.push(at_work_rate)
        voiced = self._voiced(at_work_rate, len(mel))
        if not len(mel):
            return []
        frames = np.concatenate([self._frames, mel])
        first_frame = self._first_frame
        self._frames = frames[max(0, len(frames) - self._keep) :]
        self._first_frame = first_frame + len(frames) - len(self._frames)
        self.frames_seen += len(mel)
        found = []
        for number in range(len(self._endpointers)):
            begin = 0
            while begin < len(mel):
                begin, event = self._endpointers[number].advance(mel, voiced, begin)
                if event is None:
                    break
                if event.kind == endpoint.BEGAN:
                    self._rooms[number] = self._endpointers[number].noise.astype(np.float32)
                    if number == 0:
                        self.onsets.append(event.first)
                else:
                    found.append(self._segment(event, number, frames, first_frame))
        return sorted(found, key=lambda s: (s.decided, s.listener))

    def _segment(self, event: Event, listener: int, frames: Floats, first_frame: int) -> Segment:
        pad = self._endpointers[listener].parameters.pad
        low = max(event.first - pad, first_frame)
        high = min(event.last + pad, event.frame) + 1
        return Segment(
            mel=frames[low - first_frame : high - first_frame],
            noise=self._rooms[listener],
            first=event.first,
            last=event.last,
            decided=event.frame,
            too_long=event.kind == endpoint.TOO_LONG,
            listener=listener,
            voiced=event.voiced,
            peak_db=event.peak_db,
        )

    def _voiced(self, samples: Floats, count: int) -> npt.NDArray[np.uint8]:
        """webrtcvad's word on the newest 10 ms of each new frame."""
        pcm = (np.clip(samples, -1.0, 1.0) * 32767.0).astype("<i2").tobytes()
        data = self._rest + pcm
        out = np.zeros(count, np.uint8)
        for i in range(count):
            newest = 2 * (i * HOP + WINDOW - HOP)
            out[i] = self._vad.is_speech(data[newest : newest + 2 * HOP], 8000)
        self._rest = data[2 * count * HOP :]
        return out

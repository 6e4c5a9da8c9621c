"""Samples in, words out as stretches of mel frames: resampler, mel stream, voice activity, endpointer."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from chairward_voice_dtw import endpoint
from chairward_voice_dtw.audio import Floats, Resampler
from chairward_voice_dtw.endpoint import Endpointer, EndpointParameters
from chairward_voice_dtw.frontend import BANDS, HOP, WINDOW, MelStream


@dataclass(frozen=True, slots=True, kw_only=True)
class Segment:
    """A stretch of sound that may be a word; frames are 10 ms of the stream.

    mel: n x BANDS, pads included. noise: BANDS, the room before it. first, last: the active part, in stream frames.
    decided: the newest frame that was known. final: False for a pause that may still be inside the word.
    too_long: talk or noise, never a command. voiced: share of frames that a voice detector called speech.
    peak_db: over the room.
    """

    mel: Floats
    noise: Floats
    first: int
    last: int
    decided: int
    final: bool
    too_long: bool
    voiced: float
    peak_db: float


class Segmenter:
    """Causal; what it says does not depend on how the sound is cut into blocks."""

    def __init__(self, rate_hz: int, parameters: EndpointParameters | None = None) -> None:
        import webrtcvad

        self.parameters = parameters or EndpointParameters()
        self._resampler = Resampler(rate_hz)
        self._mel = MelStream()
        self._vad: Any = webrtcvad.Vad(2)
        self._endpointer = Endpointer(self.parameters)
        self._rest = np.zeros(0, np.float32)
        self._frames = np.zeros((0, BANDS), np.float32)
        self._first_frame = 0
        self._noise = np.zeros(BANDS, np.float32)
        self.frames_seen = 0
        self.onsets: list[int] = []

    @property
    def noise(self) -> npt.NDArray[np.float64]:
        """The room's band power as it is believed now."""
        return self._endpointer.noise

    @property
    def in_word(self) -> bool:
        """Something that may be a word is going on."""
        return bool(self._endpointer.state[endpoint.MODE] == endpoint.WORD)

    def push(self, samples: Floats) -> Iterator[Segment]:
        """Segments (pauses, ends, too-longs) that become known with these samples; consume it fully."""
        at_work_rate = self._resampler.push(samples)
        mel = self._mel.push(at_work_rate)
        voiced = self._voiced(at_work_rate, len(mel))
        if not len(mel):
            return
        frames = np.concatenate([self._frames, mel])
        first_frame = self._first_frame
        keep = self.parameters.longest + 200
        self._frames = frames[max(0, len(frames) - keep) :]
        self._first_frame = first_frame + len(frames) - len(self._frames)
        self.frames_seen += len(mel)
        begin = 0
        while begin < len(mel):
            begin, event = self._endpointer.advance(mel, voiced, begin)
            if event is None:
                return
            if event.kind == endpoint.BEGAN:
                self._noise = self._endpointer.noise.astype(np.float32)
                self.onsets.append(event.first)
                continue
            pad = self.parameters.pad
            low = max(event.first - pad, first_frame, 0)
            high = min(event.last + pad, event.frame) + 1
            yield Segment(
                mel=frames[low - first_frame : high - first_frame],
                noise=self._noise,
                first=event.first,
                last=event.last,
                decided=event.frame,
                final=event.kind == endpoint.ENDED,
                too_long=event.kind == endpoint.TOO_LONG,
                voiced=event.voiced,
                peak_db=event.peak_db,
            )

    def _voiced(self, samples: Floats, count: int) -> npt.NDArray[np.uint8]:
        """webrtcvad's word on the newest 10 ms of each new frame."""
        data = np.concatenate([self._rest, samples])
        out = np.zeros(count, np.uint8)
        pcm = np.clip(data * 32768.0, -32768, 32767).astype("<i2")
        for i in range(count):
            newest = pcm[i * HOP + WINDOW - HOP : i * HOP + WINDOW]
            out[i] = self._vad.is_speech(newest.tobytes(), 8000)
        self._rest = data[count * HOP :]
        return out

"""Samples at RATE_HZ in, possible words out as stretches of mel frames: mel stream, voice activity, endpointers.

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
from chairward_voice_dtw.audio import Floats
from chairward_voice_dtw.endpoint import Endpointer, EndpointParameters, Event
from chairward_voice_dtw.frontend import BANDS, HOP, POWER_FLOOR, WINDOW, MelStream
from chairward_voice_dtw.pitch import PitchStream, pitch_of

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
    voiced: share of frames that a voice detector called speech. peak_db: over the room. pitch: log2 Hz, NaN when it is
    not known; harmonic: share of frames that have one.
    before_db, after_db: level of the 250 ms before and of what is known of the 70 ms after, under the word's: a command
    stands alone, talk goes on.
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
    pitch: float
    harmonic: float
    before_db: float = -30.0
    after_db: float = -30.0


PAD = 12
BEFORE, AFTER, GAP = 30, 7, 3
"""Frames looked at before and after a word, and left out between."""
PAST = 150
LONGEST = 200
BIAS = 1.3


def quiet_part(frames: Floats) -> Floats:
    """The room's band power: the quietest quarter of what was heard before, raised by BIAS for having been chosen."""
    power = frames.sum(axis=1)
    quietest = np.argsort(power, kind="stable")[: max(5, len(frames) // 4)]
    return np.asarray(np.float32(BIAS) * frames[quietest].mean(axis=0), np.float32)


def _around(frames: Floats, first: int, last: int) -> dict[str, float]:
    """before_db and after_db of the word frames[first:last+1]; -30 where nothing is known."""
    power = frames.sum(axis=1)
    loud = max(float(np.percentile(_part(power, first, last + 1), 80)), POWER_FLOOR)
    beside = {
        "before_db": _part(power, first - BEFORE, first - GAP),
        "after_db": _part(power, last + GAP, last + GAP + AFTER),
    }
    return {
        name: float(np.clip(10.0 * np.log10(max(float(part.mean()), POWER_FLOOR) / loud), -30.0, 10.0))
        if len(part)
        else -30.0
        for name, part in beside.items()
    }


class Segmenter:
    """Causal; what it says does not depend on how the sound is cut into blocks."""

    def __init__(self, listeners: Sequence[EndpointParameters] = LISTENERS) -> None:
        import webrtcvad

        self._mel = MelStream()
        self._pitch = PitchStream()
        self._vad: Any = webrtcvad.Vad(2)
        self._endpointers = [Endpointer(p) for p in listeners]
        self._rooms = [np.zeros(BANDS, np.float32) for _ in listeners]
        self._keep = max((p.longest for p in listeners), default=LONGEST) + 200
        self._rest = b""
        self._frames = np.zeros((0, BANDS), np.float32)
        self._speech = np.zeros(0, np.uint8)
        self._track = np.zeros((0, 3), np.float32)
        self._first_frame = 0
        self.frames_seen = 0
        self.onsets: list[int] = []

    def push(self, samples: Floats) -> list[Segment]:
        """Segments that end with these samples, in the order in which they became known."""
        mel = self._mel.push(samples)
        voiced = self._voiced(samples, len(mel))
        track = np.concatenate([self._track, self._pitch.push(samples)])
        if not len(mel):
            return []
        frames = np.concatenate([self._frames, mel])
        first_frame = self._first_frame
        self._frames = frames[max(0, len(frames) - self._keep) :]
        self._speech = np.concatenate([self._speech, voiced])[-len(self._frames) :]
        self._track = track[-len(self._frames) :]
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
                    found.append(self._segment(event, number, frames, track, first_frame))
        return sorted(found, key=lambda s: (s.decided, s.listener))

    def _segment(self, event: Event, listener: int, frames: Floats, track: Floats, first_frame: int) -> Segment:
        pad = self._endpointers[listener].parameters.pad
        low = max(event.first - pad, first_frame)
        high = min(event.last + pad, event.frame) + 1
        pitch, harmonic = pitch_of(_part(track, event.first - first_frame, event.last + 1 - first_frame))
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
            pitch=pitch,
            harmonic=harmonic,
            **_around(frames[: event.frame + 1 - first_frame], event.first - first_frame, event.last - first_frame),
        )

    def cut(self, first: int, last: int, decided: int) -> Segment | None:
        """The stretch first..last (stream frames) as it was at frame `decided`; None when it is not fully at hand."""
        begin = self._first_frame
        known, speech = (_part(x, 0, decided + 1 - begin) for x in (self._frames, self._speech))
        low, high = first - PAD - begin, min(last + PAD + 1 - begin, len(known))
        if low < 20 or high - low < 15:
            return None
        noise = quiet_part(_part(known, first - 5 - PAST - begin, first - 5 - begin))
        pitch, harmonic = pitch_of(_part(self._track, first - begin, last + 1 - begin))
        peak = np.maximum(known[low:high].max(axis=0), POWER_FLOOR) / np.maximum(noise, POWER_FLOOR)
        return Segment(
            mel=known[low:high],
            noise=noise,
            first=first,
            last=last,
            decided=decided,
            too_long=False,
            listener=0,
            voiced=float(_part(speech, first - begin, last + 1 - begin).mean()),
            peak_db=float(10.0 * np.log10(peak).mean()),
            pitch=pitch,
            harmonic=harmonic,
            **_around(known, first - begin, last - begin),
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


def _part(values: npt.NDArray[Any], low: int, high: int) -> npt.NDArray[Any]:
    """values[low:high] where the bounds may lie outside."""
    return values[max(0, low) : max(0, high)]

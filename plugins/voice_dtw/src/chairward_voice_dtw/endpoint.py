"""Where a word begins and ends, from the past only: an adaptive energy detector on band-wise signal-to-noise ratios.

Per 10 ms frame s = mean over bands of 10 log10(power / noise), smoothed over three frames. Band-wise ratios make a
rumble that fills three bands weigh three bands, not the whole. The noise estimate and the mean and spread of s in
silence follow the room with a delay, so that a word's own onset does not leak into them, and stand still in a word.
A word is active while s is over a share of its own peak; it has ended after `hang` frames without.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from chairward_voice_dtw.audio import Floats
from chairward_voice_dtw.frontend import BANDS, POWER_FLOOR
from chairward_voice_dtw.jit import jit

DELAY = 12
KEEP = 1024

# places in the state vector
T, MODE, S1, S2, MU, VAR, PEAK, ACTIVE, START, COUNT, QUIET_FROM, VOICED, FRAMES = range(13)
IDLE, WORD, TALK = 0.0, 1.0, 2.0
NOTHING, BEGAN, ENDED, TOO_LONG = range(4)


@dataclass(frozen=True, slots=True, kw_only=True)
class EndpointParameters:
    """Frames are 10 ms. on_db, on_sd: a word begins this far over silence. share: of the peak, for staying active.
    cap_db: but never more than this over silence. hang: frames without activity at which the word has ended.
    longest: frames after which sound is talk or noise, not a command word.
    """

    on_db: float = 2.5
    on_sd: float = 3.5
    share: float = 0.35
    cap_db: float = 100.0
    hang: int = 20
    longest: int = 200
    pad: int = 12

    def vector(self) -> npt.NDArray[np.float64]:
        """As the compiled step takes them."""
        return np.array([self.on_db, self.on_sd, self.share, self.hang, self.longest, self.cap_db])


@jit
def _first_active(past_s: npt.NDArray[np.float64], start: int, active: int, line: float, hang: int) -> int:
    """Where the word began, now that its peak is known: back from its last active frame over gaps shorter than `hang`.

    A rustle before the word, taken for its beginning at the time, falls away."""
    first = active
    t = active
    while t >= start and first - t <= hang:
        if past_s[t % past_s.shape[0]] > line:
            first = t
        t -= 1
    return max(start, first - 1)


@jit
def _advance(
    state: npt.NDArray[np.float64],
    noise: npt.NDArray[np.float64],
    past: npt.NDArray[np.float64],
    past_s: npt.NDArray[np.float64],
    mel: Floats,
    voiced: npt.NDArray[np.uint8],
    begin: int,
    p: npt.NDArray[np.float64],
) -> tuple[int, int]:
    """Go through frames from `begin` to the first event; (frames consumed up to and with the event, event)."""
    bands = mel.shape[1]
    for i in range(begin, mel.shape[0]):
        t = state[T]
        state[T] = t + 1
        slot = int(t) % past.shape[0]
        here = int(t) % past_s.shape[0]
        raw = 0.0
        for b in range(bands):
            power = max(mel[i, b], POWER_FLOOR)
            past[slot, b] = power
            if t < 5:
                noise[b] += (power - noise[b]) / (t + 1)
            raw += np.log10(power / noise[b])
        raw *= 10.0 / bands
        raw = min(max(raw, -10.0), 40.0)
        s = (raw + state[S1] + state[S2]) / 3.0
        state[S2] = state[S1]
        state[S1] = raw
        past_s[here] = s
        spread = np.sqrt(state[VAR])
        mu = state[MU]

        # the room is learnt from frames DELAY back, outside words; slowly even in talk, so that no noise is for ever
        old = t - DELAY
        if old >= 0 and (state[MODE] != WORD) and old >= state[QUIET_FROM]:
            rate = max(0.03, 1.0 / (old + 2.0))
            at = int(old) % past.shape[0]
            if state[MODE] == TALK:
                rate = 0.01
            for b in range(bands):
                x = past[at, b]
                limit = noise[b] * 8.0
                noise[b] += rate * (min(x, limit) - noise[b])
            d = min(past_s[int(old) % past_s.shape[0]], mu + 4.0 * max(spread, 1.0)) - mu
            state[MU] = mu + rate * d
            state[VAR] += rate * (d * d - state[VAR])
        rise = max(p[0], p[1] * spread)

        if state[MODE] == IDLE:
            if t >= 20 and s > mu + rise:
                state[COUNT] += 1
                if state[COUNT] >= 4:
                    state[MODE] = WORD
                    state[START] = t - 5
                    state[PEAK] = s
                    state[ACTIVE] = t
                    state[COUNT] = 0
                    state[VOICED] = 0
                    state[FRAMES] = 0
                    return i + 1, BEGAN
            else:
                state[COUNT] = 0
        elif state[MODE] == WORD:
            state[PEAK] = max(state[PEAK], s)
            state[FRAMES] += 1
            state[VOICED] += voiced[i]
            line = mu + max(0.8 * rise, min(p[2] * (state[PEAK] - mu), p[5]))
            if s > line:
                state[ACTIVE] = t
            quiet = t - state[ACTIVE]
            if quiet >= p[3]:
                state[START] = _first_active(past_s, int(state[START]), int(state[ACTIVE]), line, int(p[3]))
                state[MODE] = IDLE
                state[QUIET_FROM] = state[ACTIVE] + 12
                return i + 1, ENDED
            if t - state[START] > p[4]:
                state[START] = _first_active(past_s, int(state[START]), int(state[ACTIVE]), line, int(p[3]))
            if t - state[START] > p[4]:
                state[MODE] = TALK
                state[QUIET_FROM] = t
                return i + 1, TOO_LONG
        else:
            # talk or a new noise: idle again after 200 ms under the line
            if s > mu + rise:
                state[ACTIVE] = t
            elif t - state[ACTIVE] >= 20:
                state[MODE] = IDLE
                state[COUNT] = 0
    return mel.shape[0], NOTHING


@dataclass(frozen=True, slots=True)
class Event:
    """frame: of the stream, at which it was known. kind: BEGAN, ENDED, TOO_LONG. first, last: active frames."""

    kind: int
    frame: int
    first: int
    last: int
    voiced: float
    peak_db: float


class Endpointer:
    """Streaming; all state in arrays."""

    def __init__(self, parameters: EndpointParameters) -> None:
        self.parameters = parameters
        self._p = parameters.vector()
        self.state = np.zeros(13)
        self.state[VAR] = 1.0
        self.noise = np.full(BANDS, POWER_FLOOR)
        self._past = np.zeros((DELAY + 4, BANDS))
        self._past_s = np.zeros(KEEP)

    def advance(self, mel: Floats, voiced: npt.NDArray[np.uint8], begin: int) -> tuple[int, Event | None]:
        """Frames of `mel` from `begin` to the first event: (next frame to look at, the event or None at the end)."""
        state = self.state
        following, kind = _advance(state, self.noise, self._past, self._past_s, mel, voiced, begin, self._p)
        if kind == NOTHING:
            return following, None
        voiced_share = state[VOICED] / max(state[FRAMES], 1.0)
        event = Event(
            int(kind),
            int(state[T]) - 1,
            int(state[START]),
            int(state[ACTIVE]),
            float(voiced_share),
            float(state[PEAK] - state[MU]),
        )
        return int(following), event

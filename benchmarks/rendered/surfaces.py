"""Materials of the rendered rooms: 512 x 512 texels of 2 mm, seamless, drawn anew from a seed.

Noise is spectral synthesis: white noise filtered to 1/f^beta (Peitgen and Saupe, The Science of Fractal Images, 1988).
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

SIZE = 512
TEXEL_MM = 2.0
LEVELS = 7
Floats = npt.NDArray[np.float64]
ROWS, COLUMNS = np.indices((SIZE, SIZE))


@dataclass(frozen=True, slots=True)
class Atlas:
    """All materials with their mip levels as `chairward_simulator.render.shade` wants them."""

    texels: npt.NDArray[np.uint32]
    offsets: npt.NDArray[np.int64]
    names: list[str]

    def pick(self, rng: np.random.Generator, *kinds: str) -> int:
        """The number of some material of one of these kinds."""
        return int(rng.choice([i for i, name in enumerate(self.names) if name in kinds]))


def noise(rng: np.random.Generator, beta: float, stretch: float = 1.0, shortest: float = 1.5) -> Floats:
    """Seamless, mean 0, deviation 1; stretch > 1 draws it out along the columns; shortest: cut-off in texels."""
    f = np.hypot(np.fft.fftfreq(SIZE)[:, None], np.fft.rfftfreq(SIZE)[None, :] * stretch)
    f[0, 0] = 1.0
    gain = np.maximum(f, 3.0 / SIZE) ** (-beta / 2) * np.exp(-((f * shortest) ** 2))
    gain[0, 0] = 0.0
    field = np.fft.irfft2(np.fft.rfft2(rng.standard_normal((SIZE, SIZE))) * gain, s=(SIZE, SIZE))
    return np.asarray(field / field.std())


def _colour(rng: np.random.Generator, low: float = 0.2, high: float = 0.75) -> Floats:
    return np.asarray(rng.uniform(low, high) * rng.uniform(0.75, 1.15, 3))


def _tone(tone: Floats, colour: Floats) -> Floats:
    return np.asarray(tone[..., None] * colour * 255.0)


def _cells(rng: np.random.Generator, rows: int, columns: int, spread: float) -> Floats:
    tones = rng.uniform(1 - spread, 1 + spread, (rows, columns))
    return np.asarray(tones[ROWS * rows // SIZE, COLUMNS * columns // SIZE])


def _seams(rows: int, columns: int, width: int) -> npt.NDArray[np.bool_]:
    return np.asarray((ROWS * rows % SIZE < width * rows) | (COLUMNS * columns % SIZE < width * columns))


def plain(rng: np.random.Generator) -> Floats:
    """Paint: hardly a trace."""
    return _tone(1.0 + 0.004 * noise(rng, 1.5), _colour(rng))


def plaster(rng: np.random.Generator) -> Floats:
    """A wall with some grain and stains."""
    grain, stains = rng.uniform(0.015, 0.05), rng.uniform(0.01, 0.05)
    return _tone(1.0 + grain * noise(rng, 0.6) + stains * noise(rng, 2.4), _colour(rng, 0.4, 0.75))


def tiles(rng: np.random.Generator) -> Floats:
    """Square tiles of 10 to 50 cm with grout."""
    n = int(rng.choice([2, 3, 4, 6, 8, 10]))
    tone = _cells(rng, n, n, rng.uniform(0.0, 0.1)) + rng.uniform(0.01, 0.06) * noise(rng, 1.4)
    return _tone(np.where(_seams(n, n, 2), rng.uniform(0.5, 0.85), tone), _colour(rng, 0.3, 0.75))


def pattern(rng: np.random.Generator) -> Floats:
    """The same motif on every tile."""
    n = int(rng.choice([4, 8]))
    part = SIZE // n
    motif = np.digitize(noise(rng, 2.6, shortest=6.0)[:part, :part], [-0.6, 0.2, 0.9]) * 0.22 + 0.6
    motif = np.minimum(motif, motif[:, ::-1])
    return _tone(np.tile(motif, (n, n)) + 0.03 * noise(rng, 0.8), _colour(rng, 0.35, 0.7))


def planks(rng: np.random.Generator) -> Floats:
    """Wooden boards, either way round."""
    n = int(rng.integers(5, 11))
    tone = _cells(rng, n, 2, 0.15) + rng.uniform(0.04, 0.14) * noise(rng, 1.3, 9.0)
    wood = np.where((ROWS * n % SIZE) < 2 * n, 0.5, tone)
    return _tone(wood if rng.random() < 0.5 else wood.T, np.array([0.22, 0.36, 0.52]) * rng.uniform(0.6, 1.3))


def carpet(rng: np.random.Generator) -> Floats:
    """Pile."""
    return _tone(1.0 + rng.uniform(0.05, 0.18) * noise(rng, 0.4) + 0.08 * noise(rng, 2.0), _colour(rng, 0.2, 0.5))


def rug(rng: np.random.Generator) -> Floats:
    """Large coloured motifs with hard edges."""
    bands = [np.digitize(noise(rng, 2.6, shortest=4.0), [-0.7, 0.1, 0.8]) * 0.18 + 0.15 for _ in range(3)]
    return np.asarray(np.stack(bands, axis=-1) * 255.0 * (1.0 + 0.06 * noise(rng, 0.6)[..., None]))


def terrazzo(rng: np.random.Generator) -> Floats:
    """Chips of stone."""
    chips = np.digitize(noise(rng, 1.2, shortest=3.0), [-1.4, 1.2]) - 1
    return _tone(1.0 + rng.uniform(0.15, 0.35) * chips + 0.02 * noise(rng, 1.0), _colour(rng, 0.45, 0.7))


def brick(rng: np.random.Generator) -> Floats:
    """Courses of 64 mm."""
    row = ROWS // 32
    column = (COLUMNS + (row % 2) * 64) % SIZE // 128
    tone = rng.uniform(0.75, 1.15, (16, 4))[row, column] + 0.08 * noise(rng, 1.0)
    mortar = (ROWS % 32 < 4) | ((COLUMNS + (row % 2) * 64) % 128 < 5)
    return _tone(np.where(mortar, 1.3, tone), np.array([0.28, 0.36, 0.56]) * rng.uniform(0.7, 1.2))


def stripes(rng: np.random.Generator) -> Floats:
    """Upright, all alike, 16 to 64 mm wide."""
    n = int(rng.choice([8, 16, 32]))
    return _tone(1.0 + 0.3 * np.sign(np.sin(2 * np.pi * n * COLUMNS / SIZE)) + 0.01 * noise(rng, 0.5), _colour(rng))


def fabric(rng: np.random.Generator) -> Floats:
    """Clothes, cushions: folds and weave."""
    weave, folds = rng.uniform(0.04, 0.12), rng.uniform(0.1, 0.3)
    return _tone(1.0 + weave * noise(rng, 0.4) + folds * noise(rng, 2.4), _colour(rng, 0.15, 0.6))


def print_(rng: np.random.Generator) -> Floats:
    """Posters, parcels, book spines: patches of every size and colour."""
    out = np.full((SIZE, SIZE, 3), rng.uniform(60, 200))
    for _ in range(220):
        y, x = rng.integers(0, SIZE - 20, 2)
        h, w = rng.integers(4, 90, 2)
        out[y : y + h, x : x + w] = rng.uniform(20, 235, 3)
    return np.asarray(out * (1.0 + 0.05 * noise(rng, 0.8)[..., None]))


MAKERS: dict[str, tuple[Callable[[np.random.Generator], Floats], int]] = {
    "plain": (plain, 6),
    "plaster": (plaster, 5),
    "tiles": (tiles, 6),
    "pattern": (pattern, 3),
    "planks": (planks, 5),
    "carpet": (carpet, 4),
    "rug": (rug, 3),
    "terrazzo": (terrazzo, 3),
    "brick": (brick, 2),
    "stripes": (stripes, 2),
    "fabric": (fabric, 5),
    "print": (print_, 4),
}
"""Kind -> (maker, how many of it in an atlas)."""


def atlas(seed: int) -> Atlas:
    """All materials of a seed. Texel (row, column) of material k, level m: offset[m] + (k size + row) size + column."""
    rng = np.random.default_rng(seed)
    names: list[str] = []
    levels: list[list[npt.NDArray[np.uint32]]] = [[] for _ in range(LEVELS)]
    for name, (make, count) in MAKERS.items():
        for _ in range(count):
            names.append(name)
            image = np.clip(make(rng), 2.0, 250.0)
            for level in levels:
                b, g, r = (np.rint(image[..., k]).astype(np.uint32) for k in range(3))
                level.append(b | (g << np.uint32(8)) | (r << np.uint32(16)))
                half = image.shape[0] // 2
                image = image.reshape(half, 2, half, 2, 3).mean(axis=(1, 3))
    parts = [np.stack(level).ravel() for level in levels]
    offsets = np.cumsum([0, *(part.size for part in parts[:-1])]).astype(np.int64)
    return Atlas(np.concatenate(parts), offsets, names)

"""Procedural surfaces: deterministic, seamless, 512 x 512 texels of 3 mm, with structure from 3 mm to 1 m.

Structure at every scale is what lets honest block matching work both near and far; "plain" has none on purpose.
Noise is spectral synthesis: white noise filtered to 1/f^beta (Peitgen and Saupe, The Science of Fractal Images, 1988).
"""

from __future__ import annotations

from collections.abc import Callable
from functools import cache

import numpy as np
import numpy.typing as npt

SIZE = 512
TEXEL_MM = 3.0
LEVELS = 7

Floats = npt.NDArray[np.float64]
Colour = tuple[float, float, float]


def _noise(seed: int, beta: float, stretch: tuple[float, float] = (1.0, 1.0), shortest: float = 2.0) -> Floats:
    """Seamless noise of mean 0 and deviation 1. stretch: (rows, columns) elongation; shortest: cut-off in texels."""
    rng = np.random.default_rng(seed)
    fy = np.fft.fftfreq(SIZE)[:, None] * stretch[0]
    fx = np.fft.rfftfreq(SIZE)[None, :] * stretch[1]
    f = np.hypot(fy, fx)
    f[0, 0] = 1.0
    gain = np.maximum(f, 4.0 / SIZE) ** (-beta / 2) * np.exp(-((f * shortest) ** 2))
    gain[0, 0] = 0.0
    field = np.fft.irfft2(np.fft.rfft2(rng.standard_normal((SIZE, SIZE))) * gain, s=(SIZE, SIZE))
    return np.asarray(field / field.std())


def _grid() -> tuple[npt.NDArray[np.intp], npt.NDArray[np.intp]]:
    rows, columns = np.indices((SIZE, SIZE))
    return rows, columns


def _paint(tone: Floats, colour: Colour, tint: Floats | None = None) -> Floats:
    """tone (1 = as the colour) to 512 x 512 x 3 BGR 0..255; tint shifts the hue a little."""
    image = tone[..., None] * np.array(colour[::-1]) * 255.0
    if tint is not None:
        image = image * (1.0 + tint[..., None] * np.array([-0.06, 0.0, 0.06]))
    return np.asarray(np.clip(image, 2.0, 250.0), dtype=np.float64)


def _cells(seed: int, rows: int, columns: int, low: float, high: float) -> Floats:
    """One random tone for each of rows x columns cells of the texture."""
    tones = np.random.default_rng(seed).uniform(low, high, (rows, columns))
    r, c = _grid()
    return np.asarray(tones[r * rows // SIZE, c * columns // SIZE])


def _carpet() -> Floats:
    pile = 0.16 * _noise(1, 0.3) + 0.12 * _noise(2, 1.8)
    return _paint(1.0 + pile + 0.10 * np.tanh(2.0 * _noise(3, 2.6, shortest=12.0)), (0.42, 0.36, 0.34), _noise(4, 2.0))


def _tiles() -> Floats:
    r, c = _grid()
    grout = ((r * 5 % SIZE) < 12) | ((c * 5 % SIZE) < 12)
    tone = _cells(5, 5, 5, 0.86, 1.08) + 0.07 * _noise(6, 1.2) + 0.05 * _noise(7, 2.4)
    return _paint(np.where(grout, 0.62 + 0.05 * _noise(8, 0.5), tone), (0.66, 0.63, 0.57), _noise(9, 2.0))


def _wood(seed: int = 10, colour: Colour = (0.52, 0.36, 0.22), planks: int = 12) -> Floats:
    r, _ = _grid()
    seam = (r * planks % SIZE) < planks * 2
    tone = _cells(seed, planks, 3, 0.8, 1.12) + 0.16 * _noise(seed + 1, 1.3, (1.0, 9.0), 1.5)
    return _paint(np.where(seam, 0.5, tone + 0.06 * _noise(seed + 2, 1.0)), colour, _noise(seed + 3, 2.0))


def _panel() -> Floats:
    r, c = _grid()
    groove = ((r * 2 % SIZE) < 10) | ((c * 3 % SIZE) < 12)
    tone = 1.0 + 0.13 * _noise(20, 1.5, (7.0, 1.0), 1.5) + 0.06 * _noise(21, 0.8) + 0.05 * _noise(22, 2.5)
    return _paint(np.where(groove, 0.6, tone), (0.6, 0.46, 0.32))


def _wallpaper() -> Floats:
    """Stripes, and leaves strewn without any repetition inside a texture."""
    _, c = _grid()
    tone = 1.0 + 0.05 * np.sin(2 * np.pi * 8 * c / SIZE) + 0.10 * _noise(30, 0.8) + 0.06 * _noise(31, 2.5)
    rng = np.random.default_rng(32)
    reach = np.arange(-24, 25)
    for _ in range(260):
        (y, x), size = rng.integers(0, SIZE, 2), rng.uniform(5, 24)
        angle, depth = rng.uniform(0, np.pi), rng.choice([-0.34, -0.24, 0.16])
        along = reach[None, :] * np.cos(angle) + reach[:, None] * np.sin(angle)
        across = reach[:, None] * np.cos(angle) - reach[None, :] * np.sin(angle)
        leaf = (along / size) ** 2 + (across / (0.45 * size)) ** 2 < 1.0
        tone[np.ix_((y + reach) % SIZE, (x + reach) % SIZE)] += depth * leaf
    return _paint(tone, (0.62, 0.6, 0.48), _noise(33, 2.2))


def _brick() -> Floats:
    r, c = _grid()
    row = r * 16 // SIZE
    column = ((c + (row % 2) * SIZE // 12) % SIZE) * 6 // SIZE
    tones = np.random.default_rng(40).uniform(0.72, 1.15, (16, 6))
    mortar = ((r * 16 % SIZE) < 70) | (((c + (row % 2) * SIZE // 12) * 6 % SIZE) < 26)
    tone = tones[row, column] + 0.1 * _noise(41, 0.9) + 0.05 * _noise(42, 2.4)
    return _paint(np.where(mortar, 1.25 + 0.06 * _noise(43, 0.6), tone), (0.56, 0.36, 0.28), _noise(44, 2.0))


def _books() -> Floats:
    """Three shelves of spines of random width, height and colour."""
    rng = np.random.default_rng(50)
    image = np.empty((SIZE, SIZE, 3))
    image[:] = (30.0, 36.0, 44.0)
    for top in range(0, SIZE, 128):
        x = 0
        while x < SIZE:
            width = int(rng.integers(7, 20))
            height = int(rng.integers(70, 112))
            colour = rng.uniform(25, 215, 3) * rng.uniform(0.5, 1.0)
            spine = image[top + 118 - height : top + 118, x + 1 : x + width]
            spine[:] = colour
            spine[10 : 10 + int(rng.integers(4, 30))] = rng.uniform(40, 235, 3)
            x += width
        image[top + 118 : top + 128] = (70.0, 100.0, 135.0)
    return np.clip(image * (1.0 + 0.06 * _noise(51, 0.9)[..., None]), 2.0, 250.0)


def _fabric() -> Floats:
    r, c = _grid()
    plaid = 0.12 * (np.sin(2 * np.pi * 6 * r / SIZE) > 0.3) + 0.12 * (np.sin(2 * np.pi * 6 * c / SIZE) > 0.5)
    return _paint(0.9 + plaid + 0.12 * _noise(60, 0.4) + 0.10 * _noise(61, 2.2), (0.34, 0.4, 0.5), _noise(62, 1.8))


def _cardboard() -> Floats:
    image = _paint(1.0 + 0.07 * _noise(70, 1.6, (1.0, 4.0)) + 0.13 * _noise(71, 0.7), (0.62, 0.48, 0.33))
    rng = np.random.default_rng(72)
    for _ in range(150):
        y, x = int(rng.integers(0, SIZE - 40)), int(rng.integers(0, SIZE - 60))
        h, w = int(rng.integers(2, 26)), int(rng.integers(3, 44))
        image[y : y + h, x : x + w] *= rng.uniform(0.3, 0.75) if rng.random() < 0.75 else 1.3
    return np.clip(image, 2.0, 250.0)


def _poster() -> Floats:
    bands = [np.digitize(_noise(80 + k, 2.6, shortest=3.0), [-0.8, 0.0, 0.7]) * 0.27 + 0.14 for k in range(3)]
    image = np.stack(bands, axis=-1) * 255.0
    return np.clip(image * (1.0 + 0.07 * _noise(84, 1.0)[..., None]), 2.0, 250.0)


def _clothes() -> Floats:
    tone = 1.0 + 0.16 * _noise(90, 0.6) + 0.22 * _noise(91, 2.0, (0.5, 2.0))
    return _paint(tone, (0.25, 0.29, 0.42), _noise(92, 1.5))


def _shirt() -> Floats:
    r, _ = _grid()
    stripes = np.where(r * 24 // SIZE % 2 == 0, 1.0, 0.55)
    return _paint(stripes + 0.08 * _noise(95, 0.8) + 0.1 * _noise(96, 2.2), (0.7, 0.42, 0.36))


def _skin() -> Floats:
    return _paint(1.0 + 0.1 * _noise(97, 2.0), (0.7, 0.52, 0.42))


def _plain() -> Floats:
    return _paint(1.0 + 0.004 * _noise(98, 1.5), (0.72, 0.71, 0.67))


def _ceiling() -> Floats:
    return _paint(1.0 + 0.05 * _noise(99, 1.6), (0.78, 0.77, 0.74))


MAKERS: dict[str, Callable[[], Floats]] = {
    "carpet": _carpet,
    "tiles": _tiles,
    "wood": _wood,
    "panel": _panel,
    "wallpaper": _wallpaper,
    "brick": _brick,
    "books": _books,
    "fabric": _fabric,
    "cardboard": _cardboard,
    "poster": _poster,
    "clothes": _clothes,
    "shirt": _shirt,
    "skin": _skin,
    "plain": _plain,
    "ceiling": _ceiling,
}


def index_of(name: str) -> int:
    """Number of a texture in the atlas. Raises KeyError with the names there are."""
    try:
        return list(MAKERS).index(name)
    except ValueError:
        raise KeyError(f"no texture is named '{name}' (there are: {', '.join(MAKERS)})") from None


@cache
def atlas() -> tuple[npt.NDArray[np.uint32], npt.NDArray[np.int64]]:
    """All textures with their mip levels, packed 0x00RRGGBB: (flat texels, offset of each level).

    Texel (row, column) of texture k on level m is at offset[m] + (k * size + row) * size + column, size = 512 >> m.
    """
    levels: list[list[npt.NDArray[np.uint32]]] = [[] for _ in range(LEVELS)]
    for make in MAKERS.values():
        image = make()
        for level in range(LEVELS):
            b, g, r = (np.rint(image[..., k]).astype(np.uint32) for k in range(3))
            levels[level].append(b | (g << np.uint32(8)) | (r << np.uint32(16)))
            half = image.shape[0] // 2
            image = image.reshape(half, 2, half, 2, 3).mean(axis=(1, 3))
    parts = [np.stack(level).ravel() for level in levels]
    offsets = np.cumsum([0, *(part.size for part in parts[:-1])]).astype(np.int64)
    return np.concatenate(parts), offsets

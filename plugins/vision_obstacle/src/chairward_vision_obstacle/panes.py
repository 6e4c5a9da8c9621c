"""Pictures for people."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from chairward.stages import Image


def black_and_white(mask: npt.NDArray[np.bool_]) -> Image:
    """White obstacle, black floor, h x w x 3 (thesis section 3)."""
    grey = mask.astype(np.uint8) * 255
    return np.repeat(grey[..., None], 3, axis=2)

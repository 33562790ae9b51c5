"""Motion blur: a picture as the mean of several within the time that a shutter is open."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from taichi_soft.render.colors import to_linear, to_srgb

SHUTTER = 0.5
"""Share of a frame during which the shutter is open, as cameras for films have it."""

_LIGHT = to_linear(np.arange(256, dtype=np.float32) / 255.0)


def shutter_times(pictures: int) -> list[float]:
    """How long after each other the pictures of a frame are taken, in frames. The last ends the frame."""
    if pictures == 1:
        return [1.0]
    return [1.0 - SHUTTER] + [SHUTTER / (pictures - 1)] * (pictures - 1)


def mean_picture(pictures: Sequence[NDArray[np.uint8]]) -> NDArray[np.uint8]:
    """The mean of the light of sRGB pictures, uint8 (height, width, 3). One alone is returned as it is."""
    if len(pictures) == 1:
        return pictures[0]
    total: NDArray[np.float32] = _LIGHT[pictures[0]]
    for picture in pictures[1:]:
        total += _LIGHT[picture]
    return np.round(255.0 * to_srgb(total / np.float32(len(pictures)))).astype(np.uint8)

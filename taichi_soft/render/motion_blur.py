"""Motion blur: average several subframes while the shutter is open."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from taichi_soft.render.colors import to_linear, to_srgb

SHUTTER = 0.5
"""Fraction of a frame's duration for which the shutter is open. The value is usual for film cameras."""

_LIGHT = to_linear(np.arange(256, dtype=np.float32) / 255.0)


def shutter_times(pictures: int) -> list[float]:
    """Return the time to advance before each subframe, as a fraction of a frame's duration.

    The last subframe is at the end of the frame.
    """
    if pictures == 1:
        return [1.0]
    return [1.0 - SHUTTER] + [SHUTTER / (pictures - 1)] * (pictures - 1)


def mean_picture(pictures: Sequence[NDArray[np.uint8]]) -> NDArray[np.uint8]:
    """Average sRGB images, uint8 (height, width, 3), in linear light.

    A single image is returned unchanged.
    """
    if len(pictures) == 1:
        return pictures[0]
    total: NDArray[np.float32] = _LIGHT[pictures[0]]
    for picture in pictures[1:]:
        total += _LIGHT[picture]
    return np.round(255.0 * to_srgb(total / np.float32(len(pictures)))).astype(np.uint8)

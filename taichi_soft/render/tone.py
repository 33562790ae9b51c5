"""Tone mapping from unbounded linear light to the screen: a toe, a linear middle and a shoulder."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from taichi_soft.render.colors import to_srgb

Floats = NDArray[np.float32]

WHITE = 4.0
"""Linear light that an image shows as pure white."""

TOE = 0.010
"""Linear light that is reduced by half. Darker tones are reduced more, and brighter tones less."""

KNEE = 0.55
"""Linear light above which bright tones are compressed."""

STEPS = 4096
"""Number of entries of the table that kernels use."""


def tone_map(light: NDArray[np.floating]) -> Floats:
    """Map linear light of a scene to linear light of a screen, 0 to 1. 0 maps to 0, `WHITE` maps to 1.

    Args:
        light: array of any shape, clamped to 0 and `WHITE`.
    """
    x = np.clip(np.asarray(light, dtype=np.float64), 0.0, WHITE)
    deep = x * x / (x + TOE)
    return np.asarray(_shoulder(deep) / _shoulder(np.float64(WHITE * WHITE / (WHITE + TOE))), np.float32)


def _shoulder(x: NDArray[np.float64] | np.float64) -> NDArray[np.float64]:
    """Return x up to the knee, and a smooth exponential shoulder above it."""
    room = 1.0 - KNEE
    return np.where(x < KNEE, x, 1.0 - room * np.exp(-np.maximum(x - KNEE, 0.0) / room))


def encode_table() -> Floats:
    """Return a table of sRGB, 0 to 255, for `STEPS` values of light from 0 to `WHITE`.

    The square roots of these values are evenly spaced, because the eye distinguishes dark tones better than
    bright ones.
    """
    return np.asarray(255.0 * to_srgb(tone_map(_table_light())), dtype=np.float32)


def light_table() -> Floats:
    """Return the linear light for sRGB 0 to 255, (256,): the inverse of `encode_table`."""
    return np.asarray(np.interp(np.arange(256), encode_table(), _table_light()), dtype=np.float32)


def _table_light() -> NDArray[np.float64]:
    root = np.linspace(0.0, 1.0, STEPS)
    return np.asarray(WHITE * root * root)

"""Check points and colours passed by callers."""

from __future__ import annotations

from numpy.typing import ArrayLike

from taichi_soft.core.checks import as_array
from taichi_soft.core.errors import OptionError


def as_point(value: ArrayLike, name: str) -> tuple[float, float, float]:
    """Convert `value` to three finite floats. Raises: OptionError that calls the value `name`."""
    x, y, z = as_array(value, name, (3,)).tolist()
    return x, y, z


def as_color(value: ArrayLike, name: str) -> tuple[float, float, float]:
    """Convert `value` to red, green and blue from 0 to 1.

    Raises: OptionError that calls the value `name`.
    """
    color = as_point(value, name)
    if min(color) < 0.0 or max(color) > 1.0:
        raise OptionError(f"{name} must be red, green, blue from 0 to 1, got {color}")
    return color

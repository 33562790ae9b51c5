"""Arguments of the drawing calls, checked at the boundary."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from taichi_soft.errors import OptionError


def as_number(value: Any, name: str, low: float, high: float) -> float:
    """`value` as a float from `low` to `high`. Raises: OptionError."""
    number = as_array(value, name, ()).item()
    if not low <= number <= high:
        raise OptionError(f"{name} must lie between {low:g} and {high:g}, got {number:g}")
    return float(number)


def as_count(value: Any, name: str, low: int, high: int) -> int:
    """`value` as a whole number from `low` to `high`. Raises: OptionError."""
    whole = isinstance(value, (int, np.integer)) and not isinstance(value, bool)
    if not whole or not low <= value <= high:
        raise OptionError(f"{name} must be a whole number from {low} to {high}, got {value!r}")
    return int(value)


def as_point(value: ArrayLike, name: str) -> tuple[float, float, float]:
    """`value` as three finite floats. Raises: OptionError."""
    x, y, z = as_array(value, name, (3,)).tolist()
    return x, y, z


def as_color(value: ArrayLike, name: str) -> tuple[float, float, float]:
    """`value` as red, green, blue from 0 to 1. Raises: OptionError."""
    color = as_point(value, name)
    if min(color) < 0.0 or max(color) > 1.0:
        raise OptionError(f"{name} must be red, green, blue from 0 to 1, got {color}")
    return color


def as_array(values: ArrayLike, name: str, shape: tuple[int | None, ...]) -> NDArray[np.float64]:
    """`values` as finite float64 of that shape (None: any length). Raises: OptionError."""
    try:
        array = np.array(values)
    except ValueError as error:
        raise OptionError(f"{name} is not an array of numbers ({error})") from None
    wanted = "(" + ", ".join("n" if length is None else str(length) for length in shape) + ")"
    if array.dtype.kind not in "fiu":
        raise OptionError(f"{name} must be numbers of shape {wanted}, got {values!r}")
    if array.ndim != len(shape) or any(
        want not in (None, got) for want, got in zip(shape, array.shape, strict=True)
    ):
        raise OptionError(f"{name} must have shape {wanted}, got {array.shape}")
    real = array.astype(np.float64)
    if not math.isfinite(real.sum()) and not np.isfinite(real).all():
        first = int(np.argmin(np.isfinite(real.reshape(len(real), -1)).all(axis=1))) if real.ndim else 0
        bad = real[first].tolist() if real.ndim else real.item()
        raise OptionError(f"{name} must be finite, but entry {first} is {bad}")
    return real
